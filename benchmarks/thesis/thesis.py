"""The studies of the thesis: gradients, optimisers, constraints, nets, networks, refinement, and its lenses.

A. N. M. Heemels, Composing Light, Delft University of Technology, 2025.  Every study is a module with its
runs, its pictures, and a section of a page that judges the thesis's claims by the numbers of the runs.
"""

from __future__ import annotations

import json
import sys
from importlib import import_module
from pathlib import Path
from typing import cast

from benchmarks.checkout import BUILD, ROOT
from benchmarks.rows.row import Row
from benchmarks.thesis.pages import Section, section_text, verdicts_text
from benchmarks.thesis.records import Found, RunFolder, Study, completed
from optics.base.runtime import UserError
from thbcad.io import json_text, write_bytes, write_text

STUDIES = {
    1: "chapter4.gradients",
    2: "chapter4.optimisers",
    3: "chapter4.constraints",
    4: "chapter5.fixed_nets",
    5: "chapter5.networks",
    6: "chapter6.height_map",
    7: "chapter6.pearl",
    8: "chapter6.extended",
    9: "chapter2.small_figures",
    10: "chapter7.several_sources",
}
CHAPTERS = {  # number: title, studies
    2: ("Chapter 2: small optical figures", (9,)),
    4: ("Chapter 4: gradients, optimisers, constraints", (1, 2, 3)),
    5: ("Chapter 5: fixed nets, and networks as parametrisation", (4, 5)),
    6: ("Chapter 6: refinement, the pearl, the extended source", (6, 7, 8)),
    7: ("Chapter 7: light from several sources", (10,)),
}
LIMITS = {True: 600, False: 7200}  # seconds of the quick set and of the full one
RUNS = BUILD / "thesis"
PAGES = ROOT / "docs" / "thesis"
STORED = "results.json"  # of PAGES: the numbers of all runs
INTRODUCTION = """\
# The thesis

A. N. M. Heemels, *Composing Light* (Delft University of Technology, 2025) shapes lenses by differentiable
ray tracing and gradual refinement. The mathematics of this project follows it.

- [Corrections](corrections.md): where the thesis does not hold as printed, and what holds.
- [Chapter 3](chapter3.md): from the knot vector to the THB surface, step by step, with pictures.
"""
STUDIED = """\
## The studies

The studies of the thesis are run here with this project's exact tracer, and its claims are judged by numbers.
Each page says what was run, and for every claim what was found, and what it would take to hold. The numbers
of all runs are in [results.json](results.json), problem files and scripts in
[examples/thesis](../../examples/thesis).

`thbcad bench thesis` runs all studies, `--quick` a small version of each, `--only 4` one of them; `--resume`
goes on with the runs that are missing, even after `kill -9`. The pages lie in `build/thesis/full/pages` and
`build/thesis/quick/pages`; of the full set, `--store` writes them here.

In studies 2, 4, 5, 7 and 8 the loss is ||E - T|| / ||T||; Adam does not see the factor.
"""


def rows(quick: bool = False, only: int | None = None, resume: bool = False) -> list[Row]:
    """Run the studies, write their pages into build/thesis, and return times and verdicts."""
    if only is not None and only not in STUDIES:
        raise UserError(f"--only must be one of {', '.join(map(str, STUDIES))}, got {only}")
    folder = RUNS / ("quick" if quick else "full")
    chosen = STUDIES if only is None else (only,)
    table, sections = [], {}
    for number in chosen:
        study = _study(number)
        runs = RunFolder(folder / str(number))
        if not resume:
            runs.clear()
        results = completed(study, quick, runs)
        sections[number] = section = study.section(results)
        for name, png in study.pictures(results):
            write_bytes(_made(folder / "pages") / f"{name}.png", png)
        table += _rows(study, section, results)
    for name, text in _texts(sections).items():
        write_text(_made(folder / "pages") / name, text)
    print(f"pages: {folder / 'pages'}", file=sys.stderr)
    seconds = sum(row.value for row in table if row.unit == "s")
    return [*table, Row("all", seconds, "s", limit=LIMITS[quick] if only is None else None)]


def publish() -> list[Path]:
    """Write docs/thesis from the full set of runs, and return the paths."""
    results = {n: completed(_study(n), False, RunFolder(RUNS / "full" / str(n))) for n in STUDIES}
    numbers = {n: {name: found.numbers for name, found in runs.items()} for n, runs in results.items()}
    write_text(_made(PAGES) / STORED, json_text(numbers))
    for n, runs in results.items():
        for name, png in _study(n).pictures(runs):
            write_bytes(PAGES / f"{name}.png", png)
    texts = pages()
    for path, text in texts.items():
        write_text(path, text)
    return [*texts]


def pages() -> dict[Path, str]:
    """Return the text of every page of docs/thesis, from the stored numbers."""
    stored = json.loads((PAGES / STORED).read_text("utf-8"))
    results = {int(n): {name: Found(numbers) for name, numbers in runs.items()} for n, runs in stored.items()}
    sections = {n: _study(n).section(runs) for n, runs in results.items()}
    return {PAGES / name: text for name, text in _texts(sections).items()}


def _texts(sections: dict[int, Section]) -> dict[str, str]:
    """Return the pages by their names."""
    out, links = {}, []
    for chapter, (title, numbers) in CHAPTERS.items():
        present = [sections[n] for n in numbers if n in sections]
        if present:
            out[f"chapter{chapter}.md"] = "\n".join([f"# {title}\n", *map(section_text, present)])
            links.append(f"- [{title}](chapter{chapter}.md)")
    place = {n: f"chapter{chapter}.md" for chapter, (_, numbers) in CHAPTERS.items() for n in numbers}
    whole = [sections[n] for n in sorted(sections)]
    parts = [INTRODUCTION + "\n".join(links) + "\n", STUDIED, verdicts_text(whole, place.__getitem__)]
    out["README.md"] = "\n".join(parts)
    return out


def _rows(study: Study, section: Section, results: dict[str, Found]) -> list[Row]:
    """Return the time of a study, and how many of its claims hold, fail and cannot be judged."""
    words = [claim.word for claim in section.claims]
    seconds = sum(found.numbers["seconds"] for found in results.values())
    head = Row(f"study {study.NUMBER}: {study.TITLE}", seconds, "s", f"{len(results)} runs")
    return [head, *(Row(f"  claims: {word}", words.count(word)) for word in dict.fromkeys(words))]


def _study(number: int) -> Study:
    return cast(Study, import_module(f"benchmarks.thesis.{STUDIES[number]}"))


def _made(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder
