"""`thbcad sweep`: every combination of the values of some keys, as a table with pictures."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

from optics.base.runtime import UserError, note, speaking_of
from optics.interface.commands.outcome import DONE, MISSED, PART_FAILS, Outcome
from optics.interface.commands.problem_options import changes_of, result_path
from optics.interface.sweeps import STORE, Sweep, sweep as run, value_list
from optics.scene.problem import load_problem


def sweep(options: Namespace) -> Outcome:
    """Design the variants of a problem file and write the folder of the sweep."""
    out = result_path(options, "_sweep")
    ranges: dict[str, list[Any]] = {}
    with speaking_of("--vary"):
        for text in options.vary:
            key, values = value_list(text, Path(options.problem).parent)
            if key in ranges:
                raise UserError(f"{key} is varied twice; give all its values at once")
            ranges[key] = values
    problem = load_problem(options.problem, changes_of(options))
    try:
        found = run(
            problem,
            ranges,
            out,
            options.workers,
            options.scheduler,
            progress=True,
            resume=options.resume,
            force=options.force,
            keep_lenses=options.lenses,
        )
    except KeyboardInterrupt:
        if (out / STORE).exists():  # else nothing was done
            note(f"what is done is stored in {out}; the same command with --resume goes on")
        raise
    grades = found.grades()
    data = {"folder": str(out), "counts": found.counts(), "grades": grades, "rows": found.table()}
    missed = PART_FAILS if {*grades} == {"file or part fails"} else MISSED
    return Outcome(data, _lines(found), DONE if grades.get("made") else missed)


def _lines(found: Sweep) -> list[str]:
    counts = ", ".join(f"{count} {status}" for status, count in found.counts().items() if count)
    grades = ", ".join(f"{count} {grade}" for grade, count in found.grades().items())
    lines = [f"{len(found.rows)} variants: {counts}" + (f"; {grades}" if grades else "")]
    if best := found.best:
        values = ", ".join(f"{key} = {value}" for key, value in zip(found.keys, best.values))
        lines.append(f"best: {values}: {best.metrics.get('verdict', '')}")
    lines += sorted({f"{row.status}: {row.sentence}" for row in found.rows if row.sentence})
    return [*lines, f"table {found.folder / 'sweep.csv'}   page {found.folder / 'sweep.html'}"]
