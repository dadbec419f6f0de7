"""Events of MkDocs: pages that are made, links that lead out of docs/, equations."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files, InclusionLevel

from scripts.docs_site import api_pages, outside_files
from scripts.docs_site.benchmark_pages import benchmark_pages
from scripts.docs_site.equations import with_equations
from scripts.docs_site.made_pages import ORIGINS, generated_pages, outside_places, page_text
from scripts.docs_site.outside_files import DOCS, LANGUAGES, code_page, folder_page

os.environ["COLUMNS"] = "100"  # of help: pages do not depend on the terminal


def on_config(config: Any) -> None:
    """Name the made pages in the navigation."""
    reference = next(section["Reference"] for section in config["nav"] if "Reference" in section)
    api = next(entry for entry in reference if "API" in entry)
    rooms = [{room.module: room.page} for room in api_pages.rooms()]
    split = next(k for k, entry in enumerate(rooms) if "optics" in entry)
    api["API"] = [api["API"], {"thbcad": rooms[:split]}, {"optics": rooms[split:]}]
    benchmarks = next(section["Benchmarks"] for section in config["nav"] if "Benchmarks" in section)
    benchmarks += [{name: f"benchmarks/{name}.md"} for name in benchmark_pages()]


def on_files(files: Files, config: Any) -> Files:
    """Add made pages, and what pages link to outside docs/."""
    written = {DOCS / file.src_uri: file.content_string for file in files.documentation_pages()}
    pages = generated_pages()
    for place, text in pages.items():
        files.append(File.generated(config, place, content=text))
    written |= {path: pages[place] for place, path in ORIGINS.items()}
    for place, target in outside_places(written).items():
        files.append(_outside_file(config, place, target))
    return files


def _outside_file(config: Any, place: str, target: Path) -> File:
    """Return a file or folder of the checkout that lies outside docs/ as a file of the site."""
    kind = {"inclusion": InclusionLevel.NOT_IN_NAV}
    if target.is_dir():
        return File.generated(config, place, content=folder_page(target), **kind)
    if target.suffix in LANGUAGES:
        return File.generated(config, place, content=code_page(target), **kind)
    return File.generated(config, place, abs_src_path=str(target))


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Return a page with what is made at build time, and with links that hold in the site."""
    place = page.file.src_uri
    if place == outside_files.HOME:
        page.meta["hide"] = ["navigation"]  # it has nothing beside it
    if page.file.generated_by and place not in ORIGINS:
        return markdown
    return page_text(markdown, place)


def on_page_content(html: str, **_: Any) -> str:
    """Return a page with its equations as MathML."""
    return with_equations(html)
