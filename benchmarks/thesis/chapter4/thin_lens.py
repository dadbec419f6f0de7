"""The thin lens of the thesis: its gradient by every method, and the errors of differences by the step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.thesis.records import Found
from optics.base.runtime import load_backend

Floats = NDArray[np.float64]

F = 4.0
D_O = (5.0, 6.0, 8.0, 10.0, 20.0)
TABLE = 10.0  # d_o of the table of nodes
STEPS = np.logspace(-15, -0.5, 59)  # a step of 1 meets the pole of d_o = 5
STRAIGHT = (1e-4, 1e-2)  # steps between which truncation alone makes the error
METHODS = ("forward", "central")


def thin_lens() -> Found:
    """Return gradients, nodes, printed tables, and errors of differences."""
    load_backend("double", None)  # it looks for a working LLVM before Dr.Jit is loaded
    from examples.thesis import computational_graph, gradients

    points = [np.array([F, d_o]) for d_o in D_O]
    table, values = computational_graph.main(F, TABLE), []
    for p in points:
        by_hand = computational_graph.main(*p)
        rows = gradients.main(*p)
        rows["forward mode by hand"] = by_hand[-1, 1:3]
        rows["reverse mode by hand"] = by_hand[[1, 0], 3]
        values.append({name: row.tolist() for name, row in rows.items()})
    differences = gradients.forward_difference, gradients.central_difference
    errors = {
        method: np.array([_errors(difference, p, gradients.symbolic) for p in points])
        for method, difference in zip(METHODS, differences)
    }
    numbers = {"gradients": values, "nodes": table.tolist(), "printed": printed_tables(table[:, 0]).tolist()}
    for method, rows in errors.items():
        numbers[method] = [_summary(row) for row in rows]
    shown = {f"{method} errors": rows.astype(np.float32) for method, rows in errors.items()}
    return Found(numbers, {"steps": STEPS, **shown})


def printed_tables(v: Floats) -> Floats:
    """Return (dL/df by Table 4.2, dL/df and dL/dd_o by Table 4.3), all as printed."""
    v1, v2, v3, v4, v5, v6, _, v8, _ = v
    t3, t5 = v1, 1.0 - 1.0  # along f: v5' is printed as v2' + v4'
    t7 = v3 * (-t5 / v5**2) + v6 * t3
    a7 = 2 * v8
    a3, a5 = v6 * a7, -v3 * a7 / v5**2
    a4 = v1 * a5
    return np.array([2 * t7, v1 * a3 - a4, v2 * a3 + v4 * a5])


def _errors(difference, p: Floats, symbolic) -> Floats:
    """Return |relative error| of dL/df for every step."""
    exact = symbolic(*p)[0]
    return np.array([abs(difference(p, step)[0] / exact - 1) for step in STEPS])


def _summary(errors: Floats) -> dict[str, float]:
    """Return the best step, its error, the errors at both ends, and the slope where truncation rules."""
    inexact = np.where(errors > 0, errors, np.inf)  # differences of dyadic numbers can be exact
    best, (low, high) = int(inexact.argmin()), np.searchsorted(STEPS, STRAIGHT)
    slope = np.polyfit(np.log(STEPS[low:high]), np.log(errors[low:high]), 1)[0]
    return {
        "best_step": float(STEPS[best]),
        "best_error": float(errors[best]),
        "error_at_smallest": float(errors[0]),
        "error_at_greatest": float(errors[-1]),
        "slope": float(slope),
    }
