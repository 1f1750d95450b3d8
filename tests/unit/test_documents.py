"""Documents name only what exists: links, files, commands with their options, and keys.

The examples of CONTRIBUTING.md are executed.
"""

import ast
import inspect
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from numba import njit

from sph import declarations, kernels, registry, simd
from sph.cli import main
from sph.compiled import FLAGS
from sph.config import outside
from sph.config.choices import ModelChoice
from sph.config.sections import SECTIONS

ROOT = Path(__file__).parents[2]
DOCUMENTS = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs" / "problems").glob("*.md")),
    ROOT / "docs" / "benchmarks" / "README.md",
    ROOT / "docs" / "studies" / "README.md",
]
every_document = pytest.mark.parametrize(
    "document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT))
)
EXAMPLES = re.findall(
    r"Create `(sph/[\w/]+)/(\w+)\.py`:\n\n```python\n(.*?)```",
    (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"),
    re.DOTALL,
)
CREATED = {f"{folder}/{name}.py" for folder, name, _ in EXAMPLES} | {
    "configs/shear_wave.toml", "sph/parts/tether/__init__.py"
}  # fmt: skip


def text_of(document: Path) -> str:
    return document.read_text(encoding="utf-8")


def anchors(document: Path) -> set[str]:
    """The anchors that GitHub makes of the headings."""
    headings = re.findall(r"^#+ (.+)$", text_of(document), re.MULTILINE)
    shown = (re.sub(r"\[(.*?)\]\(.*?\)", r"\1", one).lower() for one in headings)
    return {re.sub(r"[^\w\- ]", "", one).replace(" ", "-") for one in shown}


@every_document
def test_relative_link_targets_exist(document):
    wrong = []
    for link in re.findall(r"\]\(([^)\s]+)\)", text_of(document)):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        target = document.parent / path if path else document
        if not target.exists() or (anchor and anchor not in anchors(target)):
            wrong.append(link)
    assert not wrong


@every_document
def test_named_files_exist(document):
    named = re.findall(
        r"(?<![\w/.~-])((?:sph|tests|scripts|configs|docs)/[\w./-]*\w)", text_of(document)
    )
    placeholders = {name for name in named if "NAME" in name}
    assert not {name for name in named if not (ROOT / name).exists()} - CREATED - placeholders


def models(package: str) -> list[type]:
    """The class of each file of a package that is found by its folder."""
    if package == "sph.problems":
        return [registry.load(package, name).Problem for name in registry.names(package)]
    return [registry.model_class(package, name) for name in registry.names(package)]


def keys() -> dict[str, set[str]]:
    """The keys of each table, those of all problems together; figures of the summary may be of
    `report`, too.
    """
    found = {name: set(table.model_fields) for name, table in SECTIONS.items() if name != "report"}
    found["problem"] = {key for problem in models("sph.problems") for key in problem.model_fields}
    found["problem"] |= {"file", *outside.SOURCES}
    return found


@every_document
def test_named_keys_exist(document):
    tables = keys()
    text = re.sub(r"https?://\S+", "", text_of(document))
    named = re.findall(rf"(?<![\w/.-])({'|'.join(tables)})\.([A-Za-z]\w*)(?![\w(])", text)
    assert not {f"{table}.{key}" for table, key in named if key not in tables[table] | {"py", "md"}}


@every_document
def test_options_of_commands_exist(document):
    wrong = []
    for line in re.findall(r"^ *(sph [a-z].*)$|`(sph [a-z].*?)`", text_of(document), re.MULTILINE):
        words = shlex.split(" ".join(line), comments=True)
        command = main.commands.get(words[1])
        options = command and {name for one in command.params for name in one.opts} | {"--help"}
        given = {word for word in words[2:] if re.match(r"-\w|--\w", word)}
        if command is None or not given <= options:
            wrong.append(" ".join(words))
    assert not wrong


def test_readme_lists_every_configuration():
    section = text_of(ROOT / "README.md").split("\n## Problems\n")[1].split("\n## ")[0]
    cells = re.findall(r"^\| (`.*?) \|", section, re.MULTILINE)
    listed = [name for cell in cells for name in re.findall(r"`(\w+)`", cell)]
    assert sorted(listed) == sorted(path.stem for path in (ROOT / "configs").glob("*.toml"))


def test_first_lines_of_modules_are_whole_sentences():
    """`sph list` prints those of models, parts and problems."""
    texts = {path: path.read_text(encoding="utf-8") for path in (ROOT / "sph").rglob("*.py")}
    first = {path: (ast.get_docstring(ast.parse(text)) or "") for path, text in texts.items()}
    lines = {path: said.partition("\n")[0] for path, said in first.items()}
    assert not {str(path) for path, said in lines.items() if len(said) > 90 or said[-1:] != "."}


def test_help_offers_table_of_parameters_only_where_a_model_has_some():
    offered = ", or a table { name, parameters }"
    assert ModelChoice("sph.kernels").describe().endswith(offered)
    assert not ModelChoice("sph.formulations.gas.schemes").describe().endswith(offered)


def test_contributing_has_example_for_each_folder():
    assert {folder for folder, _, _ in EXAMPLES} == {
        "sph/kernels", "sph/formulations/gas/schemes", "sph/eos", "sph/parts/viscosity/switches",
        "sph/problems",
    }  # fmt: skip


def own_names(kind, folder):
    """What a class defines, or another class of its folder from which it inherits."""
    package = folder.replace("/", ".")
    found = {}
    for one in reversed(kind.__mro__):
        if one.__module__.startswith(package) and not one.__module__.endswith(".base"):
            found |= vars(one)
    return found


@pytest.mark.parametrize(("folder", "name", "code"), EXAMPLES, ids=[one[1] for one in EXAMPLES])
def test_example_defines_names_common_to_its_folder(folder, name, code):
    defined = {"__name__": f"example_{name}"}
    exec(compile(code, f"CONTRIBUTING.md, {name}.py", "exec"), defined)
    (example,) = (
        kind
        for kind in defined.values()
        if isinstance(kind, type) and kind.__module__ == defined["__name__"]
    )
    siblings = [own_names(kind, folder) for kind in models(folder.replace("/", "."))]
    common = set.intersection(*(set(one) for one in siblings))
    methods = {one for one in common if inspect.isfunction(siblings[0][one]) and one[0] != "_"}
    methods -= {"enclosed_over_q3", "potential_depth"}  # only for gravity; a kernel may lack them
    assert methods
    assert methods <= set(vars(example))
    if folder != "sph/problems":
        example_model = example(*(0.5 for _ in example._fields))
        declarations.check_on_vectors([example_model])


def test_example_of_a_pair_loop_runs_on_vectors():
    text = text_of(ROOT / "docs" / "design.md").partition("## Vectors")[2].partition("\n## ")[0]
    code = re.search(r"```python\n(.*?)```", text, re.DOTALL).group(1)
    space = {**vars(simd), "njit": njit, "COMPILED": FLAGS, "w": kernels.w}  # no file to cache for
    exec(compile(code, "docs/design.md", "exec"), space)
    kernel, dim = kernels.make("cubic_spline"), (0, 0, 0)
    mass, r = np.random.default_rng(1).random((2, 32))
    expected = np.sum(mass * kernel.w(dim, r / 0.8))
    for lanes, kind in ((simd.DOUBLE, float), (simd.SINGLE, np.float32), (simd.SCALAR, float)):
        found = space["sum_of_kernels"](lanes, kernel, dim, mass.astype(kind), r.astype(kind), 0.8)
        # 32 terms of order one, of some roundings each
        assert found == pytest.approx(expected, rel=32 * float(np.finfo(kind).eps))
