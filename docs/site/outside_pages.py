"""Brings pages that lie outside of docs/, and those made from the programs, into the site, and points links to them.

On a code host the pages link to each other as files of the repository. In the site, a link to one of PAGES leads to its
page in the site; a link to any other file outside of docs/ becomes plain text. A link to a missing file stays as it is,
so that mkdocs warns about it.
"""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path, PurePosixPath

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

TOP = Path(__file__).parents[2]
PAGES = {
    "README.md": "readme.md",
    "CHANGELOG.md": "changelog.md",
    "deploy/README.md": "deploy.md",
    "benchmarks/README.md": "benchmarks.md",
    ".github/CONTRIBUTING.md": "contributing.md",
}
"""Path in the repository, and path in the site."""

_LINK = re.compile(r"(?<!!)\[([^\]]*)\]\(([^)#\s]+)(#[^)\s]*)?\)|(!\[[^\]]*\])\(([^)#\s]+)\)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the outside pages and the made ones."""
    sys.path.insert(0, str(TOP / "docs"))
    from help_pages import site_pages

    for name, text in site_pages().items():
        files.append(File.generated(config, name, content=text))
    for source, place in PAGES.items():
        files.append(File.generated(config, place, content=(TOP / source).read_text()))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Rewrite the links of a page from paths in the repository to paths in the site."""
    sources = {place: source for source, place in PAGES.items()}
    place = page.file.src_uri
    folder = PurePosixPath(sources.get(place, f"docs/{place}")).parent

    def rewritten(link: re.Match[str]) -> str:
        text, target = link[4] or f"[{link[1]}]", link[5] or link[2]
        if target.startswith(("http:", "https:", "mailto:")):
            return link[0]
        path = os.path.normpath(folder / target).replace(os.sep, "/")
        if path in PAGES:
            return f"{text}({_relative(PAGES[path], place)}{link[3] or ''})"
        if path.startswith("docs/"):
            return f"{text}({_relative(path.removeprefix('docs/'), place)}{link[3] or ''})"
        return str(link[1]) if (TOP / path).exists() else link[0]

    return _LINK.sub(rewritten, markdown)


def _relative(target: str, place: str) -> str:
    return os.path.relpath(target, PurePosixPath(place).parent).replace(os.sep, "/")
