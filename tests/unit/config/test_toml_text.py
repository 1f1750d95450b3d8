"""Lines of keys against the eye, values against the standard reader."""

import tomllib

import pytest

from sph.config.toml_text import key_lines, value_text

TEXT = """\
# [not.a.table]
top = 1
[ "a" . b ]  # a comment with = and [
"quoted key".x = '''
c = 1
'''
text = "a # no \\" comment"
list = [ 1,
  # ] still in it
  { d = 2 }, "]",
]
inline = { e = 1, f.g = [1, 2], h = { i = "}" } }
when = 2024-01-01T00:00:00Z
three = { m = \"""a""\""", n = \"""b"\""", o = "c" }
[[many]]
j = 1.5
[many.k]
[[many]]
j = 2.5
"""


def test_key_lines_are_where_keys_begin():
    assert key_lines(TEXT) == {
        ("top",): 2,
        ("a",): 3,
        ("a", "b"): 3,
        ("a", "b", "quoted key"): 4,
        ("a", "b", "quoted key", "x"): 4,
        ("a", "b", "text"): 7,
        ("a", "b", "list"): 8,
        ("a", "b", "list", 1): 10,
        ("a", "b", "list", 1, "d"): 10,
        ("a", "b", "inline"): 12,
        ("a", "b", "inline", "e"): 12,
        ("a", "b", "inline", "f"): 12,
        ("a", "b", "inline", "f", "g"): 12,
        ("a", "b", "inline", "h"): 12,
        ("a", "b", "inline", "h", "i"): 12,
        ("a", "b", "when"): 13,
        ("a", "b", "three"): 14,
        ("a", "b", "three", "m"): 14,
        ("a", "b", "three", "n"): 14,
        ("a", "b", "three", "o"): 14,
        ("many",): 15,
        ("many", 0): 15,
        ("many", 0, "j"): 16,
        ("many", 0, "k"): 17,
        ("many", 1): 18,
        ("many", 1, "j"): 19,
    }


def test_sample_text_is_valid_toml():
    assert set(tomllib.loads(TEXT)) == {"top", "a", "many"}


def test_key_lines_independent_of_line_ending():
    assert key_lines(TEXT.replace("\n", "\r\n")) == key_lines(TEXT)


@pytest.mark.parametrize(
    "value",
    [
        True,
        3,
        0.1,
        1e-30,
        1e22,
        'quotes " and \\ and\nlines and \x7f',
        [],
        [[0.0, 1.0], [2.5, 3.0]],
        {"min": 0.1, "odd key": {"deep": [1]}},
        {},
    ],
)
def test_value_text_reads_back_equal(value):
    text = value_text(value)
    assert "\n" not in text
    assert tomllib.loads(f"k = {text}")["k"] == value
