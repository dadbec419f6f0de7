"""Contents of the site: the text of each page as MkDocs gets it, and linked files from outside docs/."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from scripts.docs_site import api_pages, outside_files, problem_page
from scripts.docs_site.benchmark_pages import benchmark_pages
from scripts.docs_site.command_page import with_help
from scripts.docs_site.outside_files import DOCS, PAGES, folder_files, site_place, with_links

SECTION = re.compile(r"^## (\w+)\n", re.MULTILINE)  # of the page of benchmarks
FENCE = re.compile(r"^(```\w+) .*$", re.MULTILINE)  # what stands behind a language is for the tests
ORIGINS = {place: path for path, place in PAGES.items()}  # of pages that lie outside docs/


def generated_pages() -> dict[str, str]:
    """Return the pages that are no files of docs/ as {place in the site: text}."""
    pages = {place: path.read_text("utf-8") for place, path in ORIGINS.items()}
    pages |= {room.page: room.text() for room in api_pages.rooms()}
    return pages | {f"benchmarks/{name}.md": text for name, text in benchmark_pages().items()}


def page_text(markdown: str, place: str) -> str:
    """Return a page with the parts that are made at build time, and with links that hold in the site.

    markdown : of a page of docs/ or of `ORIGINS`.  place : of the page in the site.
    """
    if place == "benchmarks.md":
        markdown = SECTION.sub(r"## [\1](benchmarks/\1.md)\n", markdown)
    elif place == "commands.md":
        markdown = with_help(markdown)
    elif place == "problem_file.md":
        markdown = problem_page.with_keys(markdown)
    elif place == "api.md":
        markdown = markdown.replace(api_pages.MARK, api_pages.overview())
    markdown = FENCE.sub(r"\1", markdown)
    return with_links(markdown, ORIGINS.get(place, DOCS / place), place)


def outside_places(pages: Mapping[Path, str]) -> dict[str, Path]:
    """Return files and folders outside docs/ that pages link to, with the files of folders, by their place.

    pages : {the file that a page is made of: its text}.
    """
    linked = {target for path, text in pages.items() for target in outside_files.linked_files(text, path)}
    folders = [target for target in linked if target.is_dir()]
    linked |= {path for folder in folders for path in folder_files(folder)}
    places = {site_place(target, "")[0]: target for target in sorted(linked) if target.exists()}
    return {place: target for place, target in places.items() if place.startswith(outside_files.FOLDER)}
