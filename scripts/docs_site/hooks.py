"""Events of MkDocs: pages that are made, links that lead out of docs/, equations."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files, InclusionLevel

from scripts.docs_site import api_pages, outside_files, problem_page
from scripts.docs_site.benchmark_pages import benchmark_pages
from scripts.docs_site.command_page import with_help
from scripts.docs_site.equations import with_equations
from scripts.docs_site.outside_files import DOCS, LANGUAGES, PAGES, code_page, folder_files, folder_page

os.environ["COLUMNS"] = "100"  # of help: pages do not depend on the terminal
BENCHMARKS = benchmark_pages()
SECTION = re.compile(r"^## (\w+)\n", re.MULTILINE)  # of the page of benchmarks
FENCE = re.compile(r"^(```\w+) .*$", re.MULTILINE)  # what stands behind a language is for the tests
ORIGINS = {place: path for path, place in PAGES.items()}  # of pages that lie outside docs/


def on_config(config: Any) -> None:
    """Name the made pages in the navigation."""
    reference = next(section["Reference"] for section in config["nav"] if "Reference" in section)
    api = next(entry for entry in reference if "API" in entry)
    rooms = [{room.module: room.page} for room in api_pages.rooms()]
    split = next(k for k, entry in enumerate(rooms) if "optics" in entry)
    api["API"] = [api["API"], {"thbcad": rooms[:split]}, {"optics": rooms[split:]}]
    benchmarks = next(section["Benchmarks"] for section in config["nav"] if "Benchmarks" in section)
    benchmarks += [{name: f"benchmarks/{name}.md"} for name in BENCHMARKS]


def on_files(files: Files, config: Any) -> Files:
    """Add made pages, and what pages link to outside docs/."""
    pages = {place: path.read_text("utf-8") for place, path in ORIGINS.items()}
    pages |= {room.page: room.text() for room in api_pages.rooms()}
    pages |= {f"benchmarks/{name}.md": text for name, text in BENCHMARKS.items()}
    for place, text in pages.items():
        files.append(File.generated(config, place, content=text))
    written = {
        DOCS / file.src_uri: file.content_string
        for file in files.documentation_pages()
        if not file.generated_by
    }
    written |= {path: pages[place] for place, path in ORIGINS.items()}
    linked = {target for path, text in written.items() for target in outside_files.linked_files(text, path)}
    for target in sorted(linked):
        _add_outside(files, config, target)
    return files


def _add_outside(files: Files, config: Any, target: Path) -> None:
    """Add a file or folder of the checkout that lies outside docs/."""
    place = outside_files.site_place(target, "")[0]
    if not place.startswith(outside_files.FOLDER) or not target.exists() or files.get_file_from_path(place):
        return
    kind = {"inclusion": InclusionLevel.NOT_IN_NAV}
    if target.is_dir():
        files.append(File.generated(config, place, content=folder_page(target), **kind))
        for path in folder_files(target):
            _add_outside(files, config, path)
    elif target.suffix in LANGUAGES:
        files.append(File.generated(config, place, content=code_page(target), **kind))
    else:
        files.append(File.generated(config, place, abs_src_path=str(target)))


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Return a page with what is made at build time, and with links that hold in the site."""
    place = page.file.src_uri
    if place == outside_files.HOME:
        page.meta["hide"] = ["navigation"]  # it has nothing beside it
    if place == "benchmarks.md":
        markdown = SECTION.sub(r"## [\1](benchmarks/\1.md)\n", markdown)
    if page.file.generated_by and place not in ORIGINS:
        return markdown
    if place == "commands.md":
        markdown = with_help(markdown)
    elif place == "problem_file.md":
        markdown = problem_page.with_keys(markdown)
    elif place == "api.md":
        markdown = markdown.replace(api_pages.MARK, api_pages.overview())
    markdown = FENCE.sub(r"\1", markdown)
    return outside_files.with_links(markdown, ORIGINS.get(place, DOCS / place), place)


def on_page_content(html: str, **_: Any) -> str:
    """Return a page with its equations as MathML."""
    return with_equations(html)
