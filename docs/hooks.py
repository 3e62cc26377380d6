"""Hooks of the documentation site (mkdocs.yml): pages and files outside docs/, links, formulas."""

import os
import re
from importlib.metadata import distribution
from pathlib import Path
from posixpath import normpath, relpath
from typing import Final

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT: Final = Path(__file__).parents[1]
TOP_PAGES: Final = {"CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
"""Pages of the repository's root by name, with their names on the site."""

LINK: Final = re.compile(r"\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s#]+)(#[^)\s]*)?\)")
"""Text, path and anchor of a link of a page."""

NAMED_PAGE: Final = re.compile(r"\bdocs/((?:[\w-]+/)*[\w-]+)\.md\b")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages of the root, the files that pages link to outside docs/, and MathJax."""
    for name, site_name in TOP_PAGES.items():
        files.append(File.generated(config, site_name, content=(ROOT / name).read_text(encoding="utf-8")))
    for page in list(files.documentation_pages()):
        for _, path, _ in LINK.findall(page.content_string):
            source = _outside(page.src_uri, path)
            if source is None or source in (*TOP_PAGES, "README.md") or source.startswith("docs/"):
                continue
            if (ROOT / source).is_file() and f"source/{source}" not in files.src_uris:
                files.append(File.generated(config, f"source/{source}", abs_src_path=str(ROOT / source)))
    package = distribution("sphinx-mathjax-offline")
    for entry in package.files or ():
        _, _, name = entry.as_posix().partition("static/mathjax/")
        if name == "tex-chtml.js" or name.startswith("output/chtml/fonts/woff-v2/"):
            files.append(File.generated(config, f"assets/mathjax/{name}", abs_src_path=str(entry.locate())))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Point links that leave docs/ to their copies on the site; links to folders become text."""

    def mend(match: re.Match[str]) -> str:
        text, path, anchor = match.groups()
        source = _outside(page.file.src_uri, path)
        if source is None:
            return match[0]
        if (ROOT / source).is_dir():
            return text
        if source == "README.md":
            target = "index.md"
        elif source.startswith("docs/"):
            target = source.removeprefix("docs/")
        else:
            target = TOP_PAGES.get(source, f"source/{source}")
        return f"[{text}]({relpath(target, os.path.dirname(page.file.src_uri) or '.')}{anchor or ''})"

    return LINK.sub(mend, markdown)


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Make links of the pages that docstrings name."""

    def link(match: re.Match[str]) -> str:
        target = files.get_file_from_path(f"{match[1]}.md")
        if target is None:
            return match[0]
        return f'<a href="{target.url_relative_to(page.file)}">{target.page.title if target.page else match[1]}</a>'

    return NAMED_PAGE.sub(link, html) if page.file.src_uri.startswith("reference/api/") else html


def _outside(page: str, path: str) -> str | None:
    """Return the path from the repository's root of a link that leaves docs/, or None."""
    if re.match(r"[a-z]+:", path):
        return None
    folder = "" if page in TOP_PAGES.values() else "docs/" + os.path.dirname(page)
    source = normpath(f"{folder}/{path}" if folder else path)
    return None if folder and source.startswith("docs/") else source
