"""Files that pages link to and that lie outside docs/: pictures as they are, examples as pages of code."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
FOLDER = "repository"  # of the site, for what is copied
LANGUAGES = {".py": "python", ".toml": "toml"}
PAGES = {ROOT / "CONTRIBUTING.md": "contributing.md", ROOT / "CHANGELOG.md": "changelog.md"}
HOME = "README.md"  # of docs/; links to the README of the checkout lead there too
CODE_OR_LINK = re.compile(
    r"^```.*?^```|`[^`\n]*`|\]\((?!https?:|#)([^)#\s]+)([^)]*)\)", re.DOTALL | re.MULTILINE
)


def linked_files(text: str, origin: Path) -> Iterator[Path]:
    """Yield what a page links to; origin : the file that the page is made of."""
    for found in CODE_OR_LINK.finditer(text):
        if found[1]:
            yield (origin.parent / found[1]).resolve()


def with_links(text: str, origin: Path, page: str) -> str:
    """Return a page whose links lead to places of the site; page : its own place there."""

    def replaced(found: re.Match[str]) -> str:
        if not found[1]:
            return found[0]
        place = site_place((origin.parent / found[1]).resolve(), found[2].lstrip("#"))
        start = os.path.dirname(page) or "."
        return f"]({os.path.relpath(place[0], start)}{'#' * bool(place[1])}{place[1]})"

    return CODE_OR_LINK.sub(replaced, text)


def site_place(target: Path, anchor: str) -> tuple[str, str]:
    """Return where a file of the checkout lies in the site, and the anchor there."""
    if target in PAGES:
        return PAGES[target], anchor
    if target in (ROOT, ROOT / HOME):
        return HOME, ""
    if target == DOCS / "benchmarks.md" and anchor:
        return f"benchmarks/{anchor}.md", ""
    if target.is_relative_to(DOCS):
        return target.relative_to(DOCS).as_posix(), anchor
    name = f"{FOLDER}/{target.relative_to(ROOT).as_posix()}"
    if target.is_dir():
        return f"{name}/index.md", anchor
    return f"{name}.md" if target.suffix in LANGUAGES else name, anchor


def code_page(path: Path) -> str:
    """Return a page that shows a file of code."""
    name = path.relative_to(ROOT).as_posix()
    return f"# {name}\n\n```{LANGUAGES[path.suffix]}\n{path.read_text('utf-8').rstrip()}\n```\n"


def folder_page(folder: Path) -> str:
    """Return a page with the files of a folder."""
    names = [path.name for path in folder_files(folder)]
    lines = [f"- [{name}]({name}{'.md' if Path(name).suffix in LANGUAGES else ''})" for name in names]
    return "\n".join([f"# {folder.relative_to(ROOT).as_posix()}", "", *lines, ""])


def folder_files(folder: Path) -> list[Path]:
    """Return the files of a folder that a reader may want."""
    return sorted(path for path in folder.iterdir() if path.is_file() and path.name[0] not in "._")
