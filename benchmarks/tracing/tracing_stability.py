"""How far traced rays are from exact ones where tracing is hardest, and how many come to a wrong end.

Run: thbcad bench tracing_stability

`oracles.tracing_accuracy` says what a roundoff is, and when a fate is wrong.  `oracles.rough_fronts` judges
first meetings with rough fronts.
"""

from __future__ import annotations

import numpy as np

from benchmarks.rows.row import Row
from optics.base.runtime import Backend, load_backend
from oracles.rough_fronts import SOURCES, disagreeing, judge, rough_front
from oracles.tracing_accuracy import LIMIT, cases, measure

SLOPES = (1.0, 2.0, 3.0)  # root mean square
ROUGH = 350_000  # rays of each source: a million for every slope
EXACT = 112  # of them judged by rational numbers: a thousand in all
UNSURE = 20_000  # rays that show what the faster search does
UNDECIDED = 1e-4  # of the rays


def rows() -> list[Row]:
    """Return the measured rows."""
    out = []
    for precision in ("double", "single"):
        backend = load_backend(precision, 1)
        for case in cases():
            found = measure(backend, case)
            name = f"{precision}, {case.name}"
            out.append(
                Row(f"{name}: landing points", found.points, "u", f"{case.setup.origin.shape[1]} rays", LIMIT)
            )
            out.append(Row(f"{name}: shares of flux", found.shares, "u", "", LIMIT))
            out.append(
                Row(
                    f"{name}: wrong, undecided, no number",
                    found.wrong + found.unresolved + found.numberless,
                    "rays",
                    "",
                    0,
                )
            )
    return [*out, *_rough_fronts(load_backend("double", 1))]


def _rough_fronts(backend: Backend) -> list[Row]:
    """Return how many rays come to another meeting with a rough front than the first, or to none for sure."""
    out = []
    for slope in SLOPES:
        for number, (name, source) in enumerate(SOURCES.items()):
            front = rough_front(slope, radius=-16.0 if number else np.inf, seed=int(10 * slope) + number)
            rays = source(front, ROUGH, 5 + number)
            judged = judge(backend, front, rays, EXACT)
            faster = disagreeing(backend, front, next(rays.slices(UNSURE)), proven=False)
            title = f"rough front of slope {slope:g}, {name}"
            how = f"{judged.rays} rays, {judged.exact} by rational numbers"
            out.append(Row(f"{title}: another meeting than the first", judged.wrong, "rays", how, 0))
            out.append(Row(f"{title}: undecided", judged.undecided, "rays", "", int(UNDECIDED * ROUGH)))
            name = f"{title}: another meeting by the faster search of designs"
            out.append(Row(name, faster / UNSURE, "", f"{UNSURE} rays"))
    return out
