"""Hooks of MkDocs: pages of the site from documents outside docs/, and MathJax."""

import os
import re
from importlib.metadata import distribution
from pathlib import Path

from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File

ROOT = Path(__file__).parents[2]
PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
}
# One script with all glyphs and extensions, from a package that only holds MathJax.
MATHJAX = ("django-static-mathjax", "mathjax/static/mathjax/es5/tex-svg-full.js")


def relinked(text: str, folder: str, page: str) -> str:
    """Return Markdown with the links that a page of the site needs.

    `folder` is the directory of the document in the repository, `page` the page's path in docs/.
    Of a link to a file that is not part of the site, the text remains.
    """

    def changed(match: re.Match) -> str:
        shown, link = match.groups()
        path, hash_sign, anchor = link.partition("#")
        if not path or re.match(r"[a-z]+:", link):
            return match.group()
        target = os.path.normpath(os.path.join(folder, path))
        if target in PAGES:
            target = f"docs/{PAGES[target]}"
        if not target.startswith("docs/"):
            return shown[1:-1]
        place = os.path.relpath(target, os.path.dirname(f"docs/{page}"))
        return f"{shown}({place}{hash_sign}{anchor})"

    return re.sub(r"(\[[^\]\[]*\])\(([^)\s]+)\)", changed, text)


def on_files(files, config):
    """Add the documents of the repository's top directory, and MathJax."""
    for name, page in PAGES.items():
        text = (ROOT / name).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=relinked(text, "", page)))
    package, path = MATHJAX
    script = str(distribution(package).locate_file(path))
    files.append(File.generated(config, "site/tex-svg.js", abs_src_path=script))
    return files


def on_page_markdown(markdown, page, config, files):
    """Let pages of docs/ link to documents of the top directory."""
    source = page.file.src_uri
    if source in PAGES.values():
        return markdown
    return relinked(markdown, os.path.dirname(f"docs/{source}"), source)


def on_post_page(output, page, config):
    """Refuse pages that load anything from another server: the site works without network."""
    tag = r"<(?:script|link|img|iframe)\b[^>]*(?:src|href)=\"?(?:https?:)?//[^>]*>"
    if loaded := re.search(tag, output):
        raise PluginError(f"{page.file.src_uri} loads {loaded.group()}")
    return output
