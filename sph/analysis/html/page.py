"""HTML text: the frame of a page, tables and pictures. All text is escaped here."""

import base64
import html
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from sph.output.files import opened
from sph.version import __version__

STYLE = """
:root { color-scheme: light dark; --paper: #fff; --line: #d5d9e0; --soft: #f4f6f9; --ink: #1c2430;
  --muted: #556; --accent: #0072b2; --note: #fdf3ec; }
@media (prefers-color-scheme: dark) {
  :root { --paper: #14181f; --line: #3a424e; --soft: #1f252e; --ink: #e4e8ee; --muted: #a9b2bf;
    --accent: #6cb4e8; --note: #38281b; }
}
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper);
  max-width: 72rem; margin: 0 auto; padding: 1.5rem; }
h1 { font-size: 1.7rem; margin: 0 0 .3rem; overflow-wrap: anywhere; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 .6rem; border-bottom: 1px solid var(--line); }
nav a { margin-right: 1rem; white-space: nowrap; }
a { color: var(--accent); }
table + table { margin-top: 1rem; }
sup { line-height: 0; }
p, li { overflow-wrap: anywhere; }
table { border-collapse: collapse; display: block; overflow-x: auto; }
th, td { text-align: left; padding: .25rem .8rem .25rem 0; vertical-align: top;
  border-bottom: 1px solid var(--line); }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; }
td.name { font-family: ui-monospace, monospace; font-size: .9em; }
td.name, td.number, td.unit { white-space: nowrap; }
td.value { font-family: ui-monospace, monospace; font-size: .9em; overflow-wrap: anywhere; }
pre { background: var(--soft); padding: .8rem; overflow-x: auto; font-size: .85rem; }
figure { margin: 1rem 0; } img { max-width: 100%; height: auto; }
figcaption { color: var(--muted); font-size: .9rem; }
.status { display: inline-block; padding: 0 .6rem; border-radius: .8rem; color: white;
  background: #555; }
.done { background: #00735a; } .failed { background: #b02a00; }
.stopped, .interrupted { background: #8a6100; } .running { background: #0072b2; }
.warning { border-left: .3rem solid #d55e00; background: var(--note); padding: .5rem .8rem;
  margin: .5rem 0; }
.bar { background: var(--accent); height: .8rem; min-width: 1px; }
.share { width: 16rem; min-width: 6rem; }
footer { margin-top: 3rem; color: var(--muted); font-size: .85rem; }
@media (min-width: 40rem) { /* names stay in sight while a wide table scrolls */
  .name:first-child { position: sticky; left: 0; background: var(--paper); }
}
@media (max-width: 40rem) { /* a meaning stands below its name and value, over the whole width */
  body { padding: 1rem; }
  .meanings thead { display: none; } .meanings tbody { display: block; }
  .meanings tr { display: flex; flex-wrap: wrap; gap: 0 .8rem; padding: .3rem 0;
    border-bottom: 1px solid var(--line); }
  .meanings td { border: 0; padding: 0; }
  .meanings td:last-child { flex-basis: 100%; color: var(--muted); }
}
@media print { nav { display: none; } details { display: block; } }
"""
# Nothing is loaded, even if a text of the run contained markup: images are inline.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"


class Section(NamedTuple):
    """A part of a page: its heading and its HTML."""

    title: str
    body: str

    @property
    def anchor(self) -> str:
        return self.title.lower().replace(" ", "-")


def page(title: str, head: str, sections: Sequence[Section]) -> str:
    """Return the whole page. head: HTML below the title."""
    links = "\n".join(f'<a href="#{one.anchor}">{escaped(one.title)}</a>' for one in sections)
    parts = "\n".join(
        f'<section id="{one.anchor}">\n<h2>{escaped(one.title)}</h2>\n{one.body}\n</section>'
        for one in sections
    )
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{escaped(POLICY)}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="sph {escaped(__version__)}">
<title>{escaped(title)}</title>
<style>{STYLE}</style>
</head>
<body>
<header>
<h1>{escaped(title)}</h1>
{head}
<nav>
{links}
</nav>
</header>
<main>
{parts}
</main>
<footer>Written by sph {escaped(__version__)}.</footer>
</body>
</html>
"""


def escaped(text: object) -> str:
    """Return text that HTML shows as it is, without control characters."""
    plain = "".join(one if one.isprintable() or one in "\n\t" else "�" for one in str(text))
    return html.escape(plain)


def paragraph(text: object, kind: str = "") -> str:
    marked = f' class="{kind}"' if kind else ""
    return f"<p{marked}>{escaped(text)}</p>"


def items(lines: Iterable[object]) -> str:
    return "<ul>\n" + "\n".join(f"<li>{escaped(line)}</li>" for line in lines) + "\n</ul>"


def preformatted(title: str, text: str) -> str:
    """Text in a box that opens on a click."""
    return f"<details>\n<summary>{escaped(title)}</summary>\n<pre>{escaped(text)}</pre>\n</details>"


def table(header: Sequence[str], rows: Iterable[Sequence[object]], kinds: Sequence[str]) -> str:
    """Return a table. kinds: "name", "value", "number" or "" of each column.

    Also "unit" for powers, and "bar" for shares of 1.
    """
    is_list = tuple(kinds[:2]) == ("name", "number") and not kinds[-1]
    opening = '<table class="meanings">' if is_list else "<table>"
    classes = ["share" if kind == "bar" else kind for kind in kinds]
    top = "".join(
        _cell("th", escaped(cell), kind) for cell, kind in zip(header, classes, strict=True)
    )
    lines = [
        "".join(
            _cell("td", _FORMS.get(kind, escaped)(cell), shown)
            for cell, kind, shown in zip(row, kinds, classes, strict=True)
        )
        for row in rows
    ]
    body = "\n".join(f"<tr>{line}</tr>" for line in lines)
    return f"{opening}\n<thead><tr>{top}</tr></thead>\n<tbody>\n{body}\n</tbody>\n</table>"


def picture(path: Path, caption: str) -> str:
    """Return a picture (PNG), contained in the page. Raises FileError."""
    with opened(path) as file:
        content = base64.b64encode(file.read()).decode()
    return (
        f'<figure>\n<img alt="{escaped(caption)}" src="data:image/png;base64,{content}">\n'
        f"<figcaption>{escaped(caption)}</figcaption>\n</figure>"
    )


def _cell(tag: str, inner: str, kind: str) -> str:
    return f'<{tag} class="{kind}">{inner}</{tag}>' if kind else f"<{tag}>{inner}</{tag}>"


def _bar(share: object) -> str:
    width = 100.0 * min(max(float(str(share)), 0.0), 1.0)
    return f'<div class="bar" style="width: {width:.1f}%"></div>'


def _unit(text: object) -> str:
    return re.sub(r"\^(\S+)", r"<sup>\1</sup>", escaped(text))


_FORMS: dict[str, Callable[[object], str]] = {"bar": _bar, "unit": _unit}
