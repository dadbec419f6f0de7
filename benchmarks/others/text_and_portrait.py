"""Four pictures of Li, Tang and Feng (2025): a text and a portrait, on a near target and in the far field.

They state RRMSE.  What divides it, and how both images are scaled, is not known here: four ways are printed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.others.case_run import CaseRun, run_case, time_rows
from benchmarks.rows.row import Row

THEIRS = {"text_near": 0.239, "pearl_near": 0.127, "text_far": 0.246, "pearl_far": 0.134}
WANTED = {"text": 0.06, "pearl": 0.04}
SECONDS, ENOUGH = "about 2000 s", 30.0
REACHED = 40.0  # degrees from the axis: as far as light is asked for, see examples/others/pictures.py

Floats = NDArray[np.float64]


def picture_rows(folder: Path, quick: bool) -> list[Row]:
    """Return the rows of the pictures; a quick run has the text on the near target only."""
    out = []
    for name, theirs in THEIRS.items():
        if quick and name != "text_near":
            continue
        run = run_case(name, folder)
        out += _rows(name, run, theirs)
    return out


def _rows(name: str, run: CaseRun, theirs: float) -> list[Row]:
    picture, _, place = name.partition("_")
    scores = relative_errors(*_scored(run, place == "far"))
    quantity = "irradiance, box pixels" if place == "near" else f"intensity within {REACHED:g} degrees"
    label = f"{picture}, {place} target"
    (first, value), *rest = scores.items()
    return [
        Row(
            f"{label}: RRMSE {first}",
            value,
            "",
            f"{theirs:g}, normalisation unknown",
            WANTED[picture],
            quantity=quantity,
            estimator=run.metrics["estimator"],
            error=run.metrics["rel_l2_floor"],
        ),
        *(Row(f"  RRMSE {words}", value) for words, value in rest),
        Row("  ssim", run.metrics["ssim"]),
        Row("  efficiency", run.metrics["efficiency"]),
        *time_rows(run, SECONDS, ENOUGH),
    ]


def relative_errors(irradiance: Floats, target: Floats) -> dict[str, float]:
    """Return the relative root mean square error by the ways to scale and to divide.

    With unit means it is ||E - T|| over ||T||, or over sqrt(n) times the mean of T.  By least squares it is
    ||a E - T|| / ||T|| with the a that makes it least.  By peaks E and T are divided by their own greatest
    values.
    """
    e, t = irradiance / irradiance.mean(), target / target.mean()
    off, size = np.linalg.norm(e - t), np.linalg.norm(t)
    scaled = e * (e * t).sum() / (e * e).sum()
    peak = np.linalg.norm(e / e.max() - t / t.max()) / np.linalg.norm(t / t.max())
    return {
        "of unit means": float(off / size),
        "of unit means, by the mean of T": float(off / np.sqrt(t.size)),
        "by least squares": float(np.linalg.norm(scaled - t) / size),
        "of unit peaks": float(peak),
    }


def _scored(run: CaseRun, far: bool) -> tuple[Floats, Floats]:
    """Return irradiance and target on the pixels that count: in the far field those within the disk."""
    irradiance, target = run.design.irradiance, run.design.target
    if not far:
        return irradiance.ravel(), target.ravel()
    hx, hy = np.radians(run.design.problem.target.half_width)
    rows, columns = target.shape
    x, y = (np.tan(h * ((2 * np.arange(n) + 1) / n - 1)) for h, n in ((hx, columns), (hy, rows)))
    within = x**2 + y[:, None] ** 2 <= np.tan(np.radians(REACHED)) ** 2
    return irradiance[within], target[within]
