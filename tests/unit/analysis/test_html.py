"""report.html: valid HTML, nothing from outside, and every figure of the summary."""

import base64
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from test_figures import state_of, write_run
from test_info import ENDED, ended, tube  # noqa: F401  (fixtures)

from sph.analysis import figures, info
from sph.analysis.html import page
from sph.analysis.info.words import number
from sph.cli import main

VOID = {"meta", "img", "br", "hr", "input", "link", "source"}
# What may stand in what (HTML, "Content model"), for the elements that the pages use.
INSIDE = {
    "li": {"ul"}, "tr": {"thead", "tbody"}, "th": {"tr"}, "td": {"tr"}, "thead": {"table"},
    "tbody": {"table"}, "figcaption": {"figure"}, "summary": {"details"}, "head": {"html"},
    "body": {"html"}, "title": {"head"}, "meta": {"head"}, "style": {"head"},
}  # fmt: skip
NO_BLOCKS_IN = {"p", "h1", "h2", "pre", "span", "a"}
BLOCKS = {"div", "p", "table", "ul", "section", "h1", "h2", "pre", "figure", "details"}


class Page(HTMLParser):
    """A page, read strictly: every element is closed, in order, where it may stand."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.open, self.tags, self.ids, self.addresses, self.text = [], [], [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        assert len(attributes) == len(attrs), attrs
        parent = self.open[-1] if self.open else None
        assert parent in INSIDE.get(tag, {parent}), (parent, tag)
        assert not (tag in BLOCKS and {*self.open} & NO_BLOCKS_IN), (self.open, tag)
        assert tag != "img" or {"alt", "src"} <= {*attributes}
        self.tags.append(tag)
        self.ids += [attributes["id"]] if "id" in attributes else []
        named = ("src", "href", "srcset", "action", "data", "poster")
        self.addresses += [attributes[name] for name in named if name in attributes]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)

    @property
    def words(self):
        return "\n".join(self.text)


def read(path) -> Page:
    """The page in a file; nothing in it comes from elsewhere."""
    text = path.read_text(encoding="utf-8")
    assert text.startswith("<!DOCTYPE html>\n")
    found = Page(text)
    assert len({*found.ids}) == len(found.ids)
    for address in found.addresses:
        is_anchor = address.startswith("#") and address[1:] in found.ids
        assert is_anchor or address.startswith("data:image/png;base64,"), address[:60]
    assert not {"script", "link", "iframe", "object", "embed"} & {*found.tags}
    assert not re.search(r"url\(|@import|\son\w+=", text.split("<body>")[0])
    assert "default-src &#x27;none&#x27;" in text
    return found


@pytest.fixture
def drawn(monkeypatch):
    """Small pictures in place of the run's own, which take seconds."""

    def draw(sources):
        paths = [sources[0] / "figures" / f"{name}.png" for name in ("profiles", "my_picture")]
        paths[0].parent.mkdir(exist_ok=True)
        for shade, path in enumerate(paths):
            Image.fromarray(np.full((2, 2), shade, np.uint8)).save(path)
        return paths

    monkeypatch.setattr(figures, "draw", draw)


def made(*arguments):
    done = CliRunner().invoke(main, ["report", "--html", *map(str, arguments)])
    assert done.exit_code == 0, done.stderr
    return done


def test_page_of_run_holds_every_figure_of_its_summary(ended, drawn):  # noqa: F811
    assert made(ended.path).stdout.endswith(f"wrote {ended.path / 'report.html'}\n")
    found = read(ended.path / "report.html")
    own = ("particles", "dimension", "time", "steps")  # in the words at the top
    for one in info.of(ended.path)["figures"]:
        if one["name"] in own or one["name"].startswith("errors."):
            continue
        assert one["name"].partition(".")[2] in found.text, one["name"]
        assert number(one["value"]) in found.text, one["name"]
        assert not one["meaning"] or one["meaning"] in found.text, one["name"]
    for norm in ("0.25", "0.5", "1.5", "0.125"):
        assert norm in found.text


def test_page_of_run_holds_configuration_steps_cost_and_provenance(ended, drawn):  # noqa: F811
    made(ended.path)
    found = read(ended.path / "report.html")
    state = info.of(ended.path)
    for words in (
        "physics.C", "0.15", "too few neighbours", "heating: not given", "rates", "viscosity",
        "No restarts.", "SHA-256 of the last state", "checkpoint_000002.h5",
    ):  # fmt: skip
        assert words in found.words, words
    assert ended.config.read_text() in found.words
    assert all(one["name"] in found.text for one in state["columns"])


def test_pictures_are_inside_the_page(ended, drawn):  # noqa: F811
    made(ended.path)
    found = read(ended.path / "report.html")
    inline = [one for one in found.addresses if one.startswith("data:")]
    held = [base64.b64decode(one.partition(",")[2]) for one in inline]
    names = ("profiles", "my_picture")
    assert held == [(ended.path / "figures" / f"{one}.png").read_bytes() for one in names]
    assert "Profiles of the last state" in found.text
    assert "my picture" in found.text


def test_pictures_of_run_are_those_of_sph_plot(ended, monkeypatch):  # noqa: F811
    from sph.analysis.figures import style

    monkeypatch.setattr(style, "DPI", 20)
    made(ended.path)
    found = read(ended.path / "report.html")
    assert found.tags.count("img") == len([*(ended.path / "figures").glob("*.png")]) == 3


def test_text_of_a_run_is_no_markup(tube, drawn):  # noqa: F811
    evil = '<script src="http://example.org/x.js"></script> & "\x00\x1b'
    figure = '<img src="http://example.org/x.png">'
    tube.write_summary(
        ENDED
        | {
            "status": "failed", "reason": evil, "left_out": [evil], "report": {figure: 1.0},
            "warnings": [{"kind": evil, "text": evil}],
        }
    )  # fmt: skip
    made(tube.path)
    found = read(tube.path / "report.html")
    assert evil.replace("\x00\x1b", "��") in found.words
    assert figure in found.text


@pytest.mark.parametrize("status", ["running", "interrupted"])
def test_page_of_run_that_has_not_ended(tube, drawn, status):  # noqa: F811
    if status == "running":
        with tube.alone():
            made(tube.path)
    else:
        made(tube.path)
    found = read(tube.path / "report.html")
    assert status in found.text
    assert "Left out, because the run has not ended." in found.text


def test_page_of_run_without_checkpoints(tube):  # noqa: F811
    for path in tube.checkpoints():
        path.unlink()
    tube.config.write_text(tube.config.read_text())
    made(tube.path)
    assert "None: the run has no checkpoint." in read(tube.path / "report.html").text


def test_page_of_run_goes_into_given_directory(ended, drawn, tmp_path):  # noqa: F811
    made(ended.path, "-o", tmp_path / "pages" / "one")
    read(tmp_path / "pages" / "one" / "report.html")
    assert not (ended.path / "report.html").exists()


def test_page_of_sweep_compares_its_runs(tmp_path):
    errors = {}
    for n in (40, 80):
        states = [state_of("shock_tube", f"problem.n={n}", time=t) for t in (0.0, 0.2)]
        run = write_run(tmp_path / "sweep" / f"problem.n={n},physics.alpha=1.0", states)
        norms = {name: 10.0 * value / n for name, value in {"L1": 0.25, "L2": 0.5}.items()}
        norms |= {"Linf": 1.5, "relative_L1": 0.125}
        errors[n] = norms["L1"]
        made_errors = ENDED["errors"] | {"fields": {"density": norms}}
        run.write_summary(ENDED | {"errors": made_errors, "particles": n, "warnings": []})
    stopped = write_run(tmp_path / "sweep" / "problem.n=160", states)
    stopped.write_summary(ENDED | {"status": "stopped", "reason": "SIGTERM", "errors": None})
    made(tmp_path / "sweep")
    found = read(tmp_path / "sweep" / "report" / "report.html")
    for words in (
        "problem.n=40", "stopped", "peak_density", "energy_drift_max", "problem.discontinuity",
        f"{errors[40]:.3g}", f"{errors[80]:.3g}", "Findings",
    ):  # fmt: skip
        assert words in found.words, words
    assert "SIGTERM" in found.words
    assert "problem.n=40, physics.alpha=1.0" in found.text  # a heading of a column, in two lines
    drawn = (tmp_path / "sweep" / "report").glob("*.png")
    assert found.tags.count("img") == len([*drawn]) > 0


def test_table_escapes_and_draws_shares():
    shown = page.table(("a", "b"), [("<b>", 0.25), ("c", 2.0)], ("name", "bar"))
    assert "&lt;b&gt;" in shown
    assert "width: 25.0%" in shown
    assert "width: 100.0%" in shown
    Page(shown)
    assert "length<sup>-D</sup></td>" in page.table(("a",), [("mass length^-D",)], ("unit",))


def test_tables_with_meanings_become_lists_in_narrow_windows(ended, drawn):  # noqa: F811
    made(ended.path)
    text = (ended.path / "report.html").read_text(encoding="utf-8")
    tables = re.findall(r"<table(.*?)>\n<thead>(.*?)</thead>", text)
    lists = [given == ' class="meanings"' for given, head in tables if "meaning" in head]
    assert len(lists) > 4
    assert all(lists)
    assert not any(given for given, head in tables if "meaning" not in head)
    narrow = re.search(r"@media \(max-width: \d+rem\) \{(.*?)\n\}", page.STYLE, re.DOTALL)[1]
    assert ".meanings tr { display: flex" in narrow


def luminance(colour: str) -> float:
    """Relative luminance of #rgb or #rrggbb (WCAG 2.2)."""
    digits = colour[1:] if len(colour) == 7 else "".join(2 * one for one in colour[1:])
    shares = [int(digits[start : start + 2], 16) / 255 for start in (0, 2, 4)]
    linear = [one / 12.92 if one <= 0.04045 else ((one + 0.055) / 1.055) ** 2.4 for one in shares]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


def contrast(one: str, other: str) -> float:
    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("is_dark", [False, True])
def test_text_is_readable_on_light_and_dark_pages(is_dark):
    blocks = re.findall(r":root {(.*?)}", page.STYLE, re.DOTALL)
    light, dark = (dict(re.findall(r"--(\w+): (#\w+)", one)) for one in blocks)
    assert set(dark) == set(light) == set(re.findall(r"var\(--(\w+)\)", page.STYLE))
    colours = dark if is_dark else light
    pairs = [("ink", "paper"), ("muted", "paper"), ("accent", "paper"), ("ink", "soft"),
             ("ink", "note")]  # fmt: skip
    # 4.5: level AA of the Web Content Accessibility Guidelines for text of this size
    for text, behind in pairs:
        assert contrast(colours[text], colours[behind]) > 4.5, (text, behind)
    for shade in re.findall(r" background: (#\w+)", page.STYLE):  # of the states of a run
        assert contrast("#fff", shade) > 4.5, shade
