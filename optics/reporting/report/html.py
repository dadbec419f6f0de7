"""The report: one HTML file that holds its figures, tables and links to the files beside it."""

import base64
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import zip_longest
from typing import Any, cast

from optics.base.runtime import Check, Grade, Result, checks_of
from optics.light.analysis import NEGLIGIBLE, WHAT_HELPS, Verdict, photometric_lines
from optics.reporting.report.metric_words import PERCENT, effort_sentence, key_list, metric_rows, number_text
from optics.reporting.report.page_style import STYLE
from optics.scene.photometry import Units, units_of
from optics.scene.problem import Problem

OF_THE_SPLINES = (
    "Heights, slopes and radii are those of the splines that the CAD files hold; a sphere differs from its "
    "spline by up to 1e-11 mm in height, and by more in its radii."
)
# in the name of a check of a limit of manufacturing; a note says more of what was missed
LIMIT = re.compile(r" (?:beyond|short of) limits\.")
COLOURS: dict[Grade, str] = {
    "made": "good",
    "light misses": "bad",
    "file or part fails": "bad",
    "not decided": "open",
}  # classes of the page's style
RESULTS: dict[Result, str] = {"passed": "good", "failed": "bad", "undecided": "open"}
FIRST, STILL = "photo", "scene"  # of the pictures: the first, and the one behind the page to be turned
OF_LENS = (
    "solid",
    "sag",
    "mesh",
    "front_sag",
    "front_mesh",
    "face_sag",
    "face_mesh",
    "loss",
    "rays_1",
    "rays_2",
)
FILES = {
    "lens.step": "the closed solid in its own frame, for CAD",
    "lens.json": "the exact surfaces",
    "problem.toml": "the problem with every default",
    "metrics.json": "the metrics below with every digit",
    "verify.json": "the checks below",
    "manufacture.json": "the numbers for manufacturing with their bounds",
    "history.csv": "every evaluation of the optimiser",
    "irradiance.npz": "irradiance and target as arrays with axes",
    "irradiance_16bit.png": "the irradiance, linear grey, pixel by pixel",
}
PARTS = {
    "scene.step": "all elements where they lie, as an assembly",
    ".step": "the closed solid of that element, in its own frame",
    ".lens.json": "its exact surfaces",
}  # how names of other files end


@dataclass(frozen=True)
class Report:
    """What a report shows.

    metrics : numbers by name
    verification : as `optics.base.runtime.verification`
    manufacture : rows (name, value, unit, position)
    pictures : (caption, PNG bytes) by name
    verdict : on the design as a whole, for the banner, with notes for below it; None for none
    background : sentences that forbid nothing and ask for nothing, folded below the notes
    run : the run and the solid that the page speaks of: hashes by name
    view : a self-contained HTML page that shows the lens at work, as `view.scene_page`; "" for none
    parts : names of the files of other elements
    """

    problem: Problem
    metrics: dict[str, Any]
    verification: dict[str, Any]
    manufacture: Sequence[tuple[str, float, str, str]]
    pictures: Mapping[str, tuple[str, bytes]]
    verdict: Verdict | None = None
    background: Sequence[str] = ()
    run: Mapping[str, str] = field(default_factory=dict)
    view: str = ""
    levels: Sequence[tuple[str, bytes]] = ()
    parts: Sequence[str] = ()


def report_html(report: Report, problem_text: str) -> str:
    """Return the report as one HTML page, whose only references are names of files beside it."""
    metrics, units = report.metrics, units_of(report.problem.source.unit)
    photo = [picture for name, picture in report.pictures.items() if name == FIRST]
    parts = {name: next(w for end, w in PARTS.items() if name.endswith(end)) for name in report.parts}
    listed = {**FILES, **parts}
    files = "".join(f'<li><a href="{name}">{name}</a>: {words}</li>' for name, words in listed.items())
    return (
        f"{page_head(escape(report.problem.title))}{_banner(report)}"
        f'<div class="first">{figures_html(photo)}{key_list(metrics, units)}</div>'
        f"{list_html(photometric_lines(metrics, units), 'notes')}"
        f"<p>{effort_sentence(metrics)}{_other_ways(metrics, units)}</p>"
        f"{_pictures(report)}"
        f'<div class="numbers">{_numbers(report, units)}</div>'
        f'<div class="files"><h2>Files</h2><ul>{files}</ul>'
        f"{list_html(map(': '.join, report.run.items()), 'run')}</div>"
        f'<div class="problem"><h2>Problem</h2><pre>{escape(problem_text)}</pre></div></html>\n'
    )


def _pictures(report: Report) -> str:
    """Return the pictures of the light, then those of the lens and how it was found."""
    pictures = report.pictures
    others = [name for name in pictures if name.endswith(("_sag", "_mesh")) and name not in OF_LENS]
    of_lens = {name: pictures[name] for name in (*OF_LENS, *others) if name in pictures}
    of_light = {name: pictures[name] for name in pictures if name not in (*of_lens, FIRST, STILL)}
    still = [picture for name, picture in pictures.items() if name == STILL]
    parts = [
        f'<h2>{title}</h2><div class="figures">{figures_html(some.values())}</div>'
        for title, some in (("Light", of_light), (report.problem.optic.noun.capitalize(), of_lens))
        if some
    ]
    levels = f'<h2>Levels</h2><div class="levels">{figures_html(report.levels)}</div>'
    kept = f'<div class="of-levels">{levels}</div>' if report.levels else ""
    view = f"{figures_html(still)}{_frame(report.view)}"
    scene = f'<div class="still">{view}</div>' if still else view
    return f"{scene}{''.join(parts)}{kept}"


def _numbers(report: Report, units: Units) -> str:
    """Return the tables."""
    passed = f'<span class="{COLOURS[report.verification["grade"]]}">{report.verification["grade"]}</span>'
    metrics = _table(("name", "value", "unit", "meaning"), metric_rows(report.metrics, units), ("", "n"))
    rows = ((name, number_text(value), unit, position) for name, value, unit, position in report.manufacture)
    manufacture = _table(("quantity", "value", "unit", "where"), rows, ("", "n"))
    return (
        f"<h2>Metrics</h2>{metrics}"
        f"<h2>Manufacture</h2><p>{OF_THE_SPLINES}</p>{manufacture}"
        f"<h2>Verification: {passed}</h2>{_check_table(report.verification)}"
    )


def figures_html(pictures: Iterable[tuple[str, bytes]]) -> str:
    """Return pictures, (caption, PNG bytes) each, as HTML."""
    return "".join(
        f'<figure><img alt="{escape(caption)}" src="data:image/png;base64,{base64.b64encode(png).decode()}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
        for caption, png in pictures
    )


def check_page(
    title: str,
    verification: Mapping[str, Any],
    sentences: Iterable[str],
    pictures: Iterable[tuple[str, bytes]],
) -> str:
    """Return a page of checks by themselves, with sentences and pictures above them."""
    shown = f'{list_html(sentences, "notes")}<div class="levels">{figures_html(pictures)}</div>'
    return f"{page_head(escape(title))}{shown}{_check_table(verification)}</html>\n"


def page_head(title: str, more: str = "") -> str:
    """Return the begin of a page, up to its title; title : HTML.  more : elements of its head."""
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width,initial-scale=1">{more}'
        f"<title>{title}</title><style>{STYLE}</style><h1>{title}</h1>"
    )


def _banner(report: Report) -> str:
    """Return the verdict, what is wrong, and the other notes."""
    verdict = report.verdict
    if verdict is None:
        return ""
    banner = f'<p class="banner {COLOURS[verdict.grade]}">{escape(verdict.sentence)}</p>'
    wrong = [c for c in verdict.checks if not c.ok]
    missed = {LIMIT.split(c.name)[0] for c in wrong if LIMIT.search(c.name)}
    causes = {
        note: {cause.split(": got ")[0] for cause in note.split("; ")} & missed for note in verdict.notes
    }
    of_limits = [note for note, quantities in causes.items() if quantities]
    with_remedy = {quantity for quantities in causes.values() for quantity in quantities}
    others = (c for c in wrong if LIMIT.split(c.name)[0] not in with_remedy)
    problems = [*map(_failure, others), *of_limits]
    if verdict.grade == "light misses":
        problems.append(f"thbcad check problem.toml names what binds; {WHAT_HELPS}")
    notes = [note for note in verdict.notes if note not in of_limits]
    folded = list_html(report.background, "notes")
    background = f"<details><summary>Background</summary>{folded}</details>" if folded else ""
    return f"{banner}{list_html(problems, 'bad')}{list_html(notes, 'notes')}{background}"


def _failure(check: Check) -> str:
    """Return "quantity: got ..., wanted ..." of a check that failed or is undecided."""
    remark = f"; {check.remark}" if check.remark else ""
    return f"{check.name}: got {check.got}, wanted {check.wanted} {check.unit}".rstrip() + remark


def _frame(page: str) -> str:
    """Return a page within the page, whose program runs by itself: it sees no other page and no file."""
    if not page:
        return ""
    title = "Source, element and target, to be turned"
    return f'<iframe class="view" title="{title}" sandbox="allow-scripts" srcdoc="{escape(page)}"></iframe>'


def list_html(sentences: Iterable[str], name: str) -> str:
    """Return sentences as a list of a class, "" for none."""
    items = "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences)
    return f'<ul class="{name}">{items}</ul>' if items else ""


def _other_ways(metrics: dict[str, Any], units: Units) -> str:
    """Return a sentence on light that other ways than front and rear bring, or "" where none was followed."""
    fluxes = metrics.get("nonsequential")
    if not fluxes or not fluxes[units.key("target")]:
        return ""
    alone = number_text(metrics["rel_l2_sequential"], PERCENT)
    verdict = (
        f"it counts in all figures and pictures here; front and rear only make a relative error of {alone} %"
        if metrics["paths"] == "all"
        else f"below {NEGLIGIBLE:.0%} it counts nowhere"
    )
    return f" {fluxes['by_other_ways']:.2%} of the light on the target comes by other ways: {verdict}."


def _table(head: Sequence[str], rows: Iterable[Sequence[str]], classes: Sequence[str] = ()) -> str:
    """Return a table of texts.  classes : of the columns, "" for none; "result" is that of the result."""
    lines = ["<tr>" + "".join(f'<th scope="col">{escape(name)}</th>' for name in head) + "</tr>"]
    for row in rows:
        cells = ""
        for text, name in zip_longest(row, classes[: len(row)], fillvalue=""):
            name = RESULTS[cast("Result", text)] if name == "result" else name
            cells += f'<td class="{name}">{escape(text)}</td>' if name else f"<td>{escape(text)}</td>"
        lines.append(f"<tr>{cells}</tr>")
    return f'<div class="table"><table>{"".join(lines)}</table></div>'


def _check_table(verification: Mapping[str, Any]) -> str:
    rows = ((c.name, c.got, c.wanted, c.result) for c in checks_of(verification))
    table = _table(("check", "got", "wanted", "result"), rows, ("", "n", "n", "result"))
    return table + "".join(f"<p>Left out: {escape(text)}.</p>" for text in verification.get("left_out", ()))


@dataclass(frozen=True)
class PageSection:
    """A part of a page.

    sentences : above the table, as a list.  head, rows : of the table; none without rows.
    pictures : (caption, PNG bytes).
    """

    title: str
    sentences: Sequence[str] = ()
    head: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    pictures: Sequence[tuple[str, bytes]] = ()


def section_page(title: str, introduction: str, sections: Iterable[PageSection]) -> str:
    """Return a page that holds everything in itself.  introduction : a sentence or two, text."""
    body = "".join(_section(section) for section in sections)
    return f"{page_head(escape(title))}<p>{escape(introduction)}</p>{body}</html>\n"


def _section(section: PageSection) -> str:
    table = _table(section.head, section.rows) if section.rows else ""
    pictures = f'<div class="figures">{figures_html(section.pictures)}</div>' if section.pictures else ""
    return f"<h2>{escape(section.title)}</h2>{list_html(section.sentences, 'notes')}{table}{pictures}"
