"""How far traced rays are from exact ones where tracing is hardest, and how many come to a wrong end.

Run: thbcad bench tracing_stability

`oracles.tracing_accuracy` says what a roundoff is, and when a fate is wrong.
"""

from __future__ import annotations

from optics.runtime import Row, load_backend
from oracles.tracing_accuracy import LIMIT, cases, measure


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
    return out
