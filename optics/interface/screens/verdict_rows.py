"""The first screens of commands that judge: a verdict on light and file, then every limit that is missed."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

from optics.base.runtime import Check, Result, Subject, checks_of, grade
from optics.interface.screens.screen import FAIL, MARK_OF, OPEN, PASS, Entry, Screen
from optics.light.analysis import Verdict, error_words
from optics.tolerancing.machining import RISE, SurfaceFindings, ToolFindings
from optics.tolerancing.metrology import AsBuilt

OTHERS = 4  # failed checks that are shown; the full output has all
MARKS: dict[Result, str] = {"passed": PASS, "failed": FAIL, "undecided": OPEN}
TRACED = ("OCCT", "optiland", "text of the file")  # who checks a file, as the names of checks call them
PERCENT = 100


def design_screen(
    metrics: Mapping[str, Any], checked: Mapping[str, Any], folder: Path, hints: Sequence[str]
) -> Screen:
    """Return the screen of a finished design.

    checked : of `verification`.  hints : sentences on what to do if the light misses.
    """
    checks = checks_of(checked)
    body = metrics.get("element", "lens")
    file = f"lens.step is the {'designed' if metrics['evaluations'] else 'given'} {body}"
    cost = f"{_count(metrics['dof'])} coefficients, {metrics['evaluations']} evaluations"
    return Screen(
        "",
        "",
        (
            *_light_rows(metrics, checks),
            *_subject_rows(checks, "file", file, f"; more: thbcad verify {shlex.quote(str(folder))}"),
            *(Entry("next", hint) for hint in hints),
            Entry("cost", f"{cost}, {metrics['wall_s']['total']:.1f} s", f"open {folder}/report.html"),
        ),
    )


def verify_screen(checked: Mapping[str, Any], what: str, light: Sequence[str]) -> Screen:
    """Return the screen of a verified file.

    what : the file and what it is compared with.  light : lines on the light that another program made.
    """
    checks = checks_of(checked)
    names = [check.name for check in checks]
    programs = [name for name in TRACED if any(name in each for each in names)]
    subjects = {check.subject for check in checks}
    by = f"checked by {', '.join(programs)}" if programs else ""
    rows = [*_subject_rows(checks, "file", what)] if "file" in subjects else []
    if "light" in subjects:
        rows += _subject_rows(checks, "light", "the result keeps the limits of [verify]")
    if by:
        rows.append(Entry("by", by.replace("OCCT", "OpenCASCADE").removeprefix("checked by ")))
    rows += [Entry("traced", line) for line in light]
    rows += [Entry("note", sentence) for sentence in checked.get("notes", ())]
    rows += [Entry("missing", sentence) for sentence in checked.get("left_out", ())]
    return Screen("", "", tuple(rows))


def made_screen(built: AsBuilt, verdict: Verdict, folder: Path) -> Screen:
    """Return the screen of a lens as it was made.  folder : that was written."""
    light, designed = built.light_error, f"{PERCENT * built.nominal.metrics['rel_l2']:.3g} % as designed"
    error = (
        f"not known: only {built.known:.1%} of the light crosses where the {built.side} was measured"
        if light is None
        else f"error {PERCENT * light.rel_l2:.3g} ± {PERCENT * light.error:.1g} % as made, {designed}"
    )
    rows = [Entry("light", error, mark=MARK_OF[verdict.grade]), *_missed(verdict.checks)]
    moved = built.correction
    if moved and moved.after < moved.before:
        change = f"from {PERCENT * moved.before:.3g} % to {PERCENT * moved.after:.3g} %"
        rows.append(Entry("moved", f"re-positioning changes the error {change}"))
    rows += [Entry("note", note) for note in verdict.notes]
    return Screen("", "", (*rows, Entry("files", str(folder), "more: --full")))


def road_screen(road_class: str, where: str, checks: Sequence[Check]) -> Screen:
    """Return the screen of a road.  where : the installation, in words."""
    rows = [Entry("class", f"{road_class} of EN 13201-2:2015; {where}", mark=MARK_OF[grade(checks)])]
    rows += [Entry("", _words(check), mark=MARKS[check.result]) for check in checks]
    return Screen("", "", tuple(rows))


def tool_screen(findings: ToolFindings, title: str, folder: Path) -> Screen:
    """Return the screen of a tool: whether it fits, whether its cusps need polishing, how long it takes."""
    rows = [row for surface in findings.surfaces for row in _tool_rows(findings, surface)]
    hard = [check for check in findings.checks if check.name.startswith("acceleration")]
    rows += [Entry("limit", _words(check), mark=MARKS[check.result]) for check in hard]
    cut = findings.order.words if findings.surfaces else "draft only; --ball or --nose names a tool"
    return Screen(title, cut, (*rows, Entry("files", str(folder), "more: --full")))


def _tool_rows(findings: ToolFindings, surface: SurfaceFindings) -> list[Entry]:
    fit = surface.fit
    result: Result = "passed" if fit.proven else "failed" if fit.refuted else "undecided"
    radius = fit.least.lower
    concave = f"minimum concave radius {radius:.4g} mm" if isfinite(radius) else "nothing is concave"
    word = {"passed": "fits", "failed": "does not fit", "undecided": "may not fit"}[result]
    rows = [Entry(surface.name, f"{findings.order.words} {word}; {concave}", mark=MARKS[result])]
    if surface.polish is None:
        return rows
    polish = "polish, or use a smaller step" if surface.polish else "no polishing needed"
    rows.append(Entry("cusps", f"{polish}: {_cusps(surface)}", mark=FAIL if surface.polish else PASS))
    if surface.rows is not None:
        rows.append(Entry("time", f"{surface.rows.hours:.3g} hours for one pass"))
    elif surface.motion is not None:
        rows.append(Entry("servo", _servo(findings, surface)))
    return rows


def _cusps(surface: SurfaceFindings) -> str:
    """Return how high the cusps are, and the effect on the light that decides about polishing."""
    high, light = f"cusps {1e6 * surface.cusp_height:.3g} nm high", surface.light
    if light is not None and (surface.rise > RISE or not surface.polish):
        return f"{high} change the error from {light.without:.2%} to {light.with_cusps:.2%}"
    assert surface.blur is not None  # as for `polish`
    assert surface.pitch is not None
    return f"{high} blur the light by up to {surface.blur.worst()[0] * surface.pitch:.2g} pixels"


def _servo(findings: ToolFindings, surface: SurfaceFindings) -> str:
    motion, order = surface.motion, findings.order
    assert motion is not None  # the caller looks
    limit = order.acceleration
    rpm = order.rpm if order.rpm is not None or limit is None else motion.highest_rpm(limit)
    if rpm is None or not isfinite(rpm):
        return (
            f"{motion.cut.turns:.0f} turns, {motion.cut.length:.0f} m; give --rpm or --acceleration for hours"
        )
    return f"{motion.cut.hours(rpm):.3g} hours at {rpm:.4g} rpm, up to {motion.acceleration(rpm):.3g} m/s²"


def _light_rows(metrics: Mapping[str, Any], checks: Sequence[Check]) -> list[Entry]:
    """Return a row with the numbers of the light, and one for each of its limits that is missed."""
    of_light = [check for check in checks if check.subject == "light"]
    uniformity, zones = metrics.get("uniformity") or {}, metrics.get("zones")
    words = []
    if uniformity.get("min_over_mean") is not None:
        words.append(f"U0 {uniformity['min_over_mean']:.3f}")
    if zones:
        kept = sum(row["margin"] >= 0 for row in zones)
        words.append(f"{kept} of {len(zones)} zones kept")
    words += [
        f"error {error_words(dict(metrics))}",
        f"{metrics['efficiency']:.1%} on the target",
        f"stray {PERCENT * metrics['stray']:.2g}%",
    ]
    mark = MARK_OF[grade(of_light)] if of_light else ""
    return [Entry("light", "   ".join(words), mark=mark), *_missed(of_light)]


def _subject_rows(checks: Sequence[Check], subject: Subject, done: str, more: str = "") -> list[Entry]:
    """Return a row for the file or the light, and one for each check that does not pass.

    done : what is true if all pass.  more : goes after the number of checks.
    """
    rows = [check for check in checks if check.subject == subject]
    found = grade(rows)
    mark = MARK_OF[found]
    failed = sum(check.result != "passed" for check in rows)
    text = (
        f"{done} ({len(rows)} check{'s' * (len(rows) > 1)}{more})"
        if mark == PASS
        else f"{failed} of {len(rows)} checks do not pass"
    )
    return [Entry(subject, text, mark=mark), *_missed(rows)]


def _missed(checks: Sequence[Check]) -> list[Entry]:
    """Return a row for each check that does not pass, the failed ones first, up to OTHERS."""
    rows = sorted((check for check in checks if check.result != "passed"), key=lambda check: check.result)
    shown = [Entry("", _words(check), mark=MARKS[check.result]) for check in rows[:OTHERS]]
    return shown + [Entry("", f"{len(rows) - OTHERS} more with --full")] * (len(rows) > OTHERS)


def _words(check: Check) -> str:
    remark = f"; {check.remark}" if check.remark else ""
    return f"{check.name}: {check.got} ({check.wanted}){remark}"


def _count(number: int) -> str:
    """Return a whole number with blanks between thousands."""
    return f"{number:,}".replace(",", " ")
