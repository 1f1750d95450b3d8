"""The comparison of messages with the texts in tests/messages.txt."""

import pytest
from snapshots import HEADER, Messages, Snapshot, base_of, file_of, read


@pytest.fixture
def snapshot(tmp_path):
    """snapshot(update=False): one with a text of test_a, two of test_b and one of another file."""
    path = tmp_path / "messages.txt"
    entries = {"f::test_a": "one", "f::test_b[x]": "two\n\nlines", "f::test_b[x] #2": "more",
               "g::test_c": "other"}  # fmt: skip
    path.write_text(HEADER + "".join(f"\n--- {name}\n{text}\n" for name, text in entries.items()))

    def made(update=False):
        return Snapshot(path, update)

    assert made().kept == entries
    return made


def test_compare_equal_text_passes_and_other_fails(snapshot, tmp_path):
    messages = Messages(snapshot(), "f::test_b[x]", tmp_path)
    messages.check("two\n\nlines\n")
    messages.check("more")
    with pytest.raises(pytest.fail.Exception, match="#3"):
        messages.check("one too many")
    with pytest.raises(pytest.fail.Exception, match=r"-one\n\+two\n"):
        Messages(snapshot(), "f::test_a", tmp_path).check("two")


def test_compare_ignores_directories_and_masked_parts(snapshot, tmp_path):
    messages = Messages(snapshot(update=True), "f::test_a", tmp_path)
    messages.check(f"cannot write {tmp_path}/test_a0/file: 17.5 s", mask=r"\d+\.\d")
    assert messages.snapshot.seen == {"f::test_a": "cannot write <tmp>/file: # s"}


def test_write_replaces_texts_of_run_tests_and_drops_removed_tests(snapshot, tmp_path):
    one = snapshot(update=True)
    Messages(one, "f::test_b[x]", tmp_path).check("new")
    one.write({"f::test_b[x]", "f::test_d"})  # test_a is not in its file any more
    assert read(one.path) == {"f::test_b[x]": "new", "g::test_c": "other"}


def test_raised_needs_type_and_facts(snapshot, tmp_path):
    messages = Messages(snapshot(), "f::test_a", tmp_path)
    with messages.raised(ValueError, "on"):
        raise ValueError("one")
    with pytest.raises(AssertionError), messages.raised(ValueError, "physics.eta"):
        raise ValueError("one")
    with pytest.raises(KeyError), messages.raised(ValueError):
        raise KeyError("one")


def test_kept_texts_belong_to_existing_tests(pytestconfig):
    tests = pytestconfig.rootpath / "tests"
    kept = read(tests / "messages.txt")
    assert kept
    for name in kept:
        function = base_of(name).partition("::")[2].partition("[")[0]
        assert f"def {function}(" in (tests / file_of(name)).read_text(), name
