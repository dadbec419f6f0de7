"""What is said of a made lens: numbers by name, and lines."""

from __future__ import annotations

from math import floor, sqrt
from typing import Any

import numpy as np

from optics.tolerancing.metrology.alignment import Alignment
from optics.tolerancing.metrology.as_built_light import AsBuilt, Way

MICROMETRES, NANOMETRES = 1e3, 1e6  # of a millimetre
GAIN = 0.01  # of rel_l2: what a re-positioning must bring to be worth the work
ROWS = (
    "shift in x, y, z / um",
    "tilt about x, y, z / deg",
    "error of height, PV / um",
    "error of height, RMS / um",
    "points beside the surface",
    "rel_l2 of the fitted lens",
)
# correlation of neighbouring residuals: six times that of as many points of pure noise, within these bounds
LIKE, BY_CHANCE = (0.1, 0.25), 6.0


def as_built_data(built: AsBuilt) -> dict[str, Any]:
    """Return the numbers of a made lens by name: mm, degrees, W/mm^2."""
    light, fit = built.light_error, built.made.fit
    ways: dict[Way, Alignment | None] = {"datums": built.datums, "best fit": built.fitted}
    return {
        "surface": built.side,
        "align": built.way,
        "points": _on_surface(built),
        "missing": built.measured.missing,
        "beside": built.measured.beside,
        "alignments": {
            name: None
            if alignment is None
            else {
                "shift_mm": alignment.motion.shift.tolist(),
                "tilt_degrees": np.degrees(alignment.motion.rotation_vector).tolist(),
                "peak_to_valley_mm": alignment.peak_to_valley,
                "rms_mm": alignment.rms,
                "undetermined": list(alignment.undetermined),
            }
            | {"beside": _beside(built, alignment), "rel_l2": built.rel_l2_of[name]}
            for name, alignment in ways.items()
        },
        "no_best_fit": built.no_fit or None,
        "outliers": built.outlying or None,
        "noise_mm": fit.noise,
        "fitted_degrees_of_freedom": fit.freedom,
        "covered": built.made.covered,
        "measured_light": built.known,
        "correlation_of_residuals": built.made.unresolved,
        "rel_l2": {
            "designed": built.nominal.metrics["rel_l2"],
            "decided": light is not None,
            "made": light and light.rel_l2,
            "error": light and light.error,
            "fitted_lens": built.measurement.metrics["rel_l2"],
            "noise_floor": light and light.floor,
        },
        "re_positioning": built.correction
        and {
            "rel_l2_before": built.correction.before,
            "rel_l2_after": built.correction.after,
            "moves": {
                m.name: {"unit": m.unit, "amount": m.amount, "alone": m.alone, "rel_l2_alone": m.rel_l2_alone}
                for m in built.correction.moves
            },
        },
        "change": float(np.linalg.norm(built.change) / np.linalg.norm(built.nominal.irradiance)),
        "efficiency": built.measurement.metrics["efficiency"],
    }


def _on_surface(built: AsBuilt) -> int:
    """Return how many points lie on the surface, in the frame of the file."""
    return built.datums.points.shape[1]


def _beside(built: AsBuilt, alignment: Alignment) -> int:
    """Return how many points with a value lie beside the surface."""
    return _on_surface(built) + built.measured.beside - alignment.points.shape[1]


def as_built_lines(built: AsBuilt) -> list[str]:
    """Return what is said of a made lens on the command line."""
    measured, fit = built.measured, built.made.fit
    lines = [
        f"{_on_surface(built):,} points of the {built.side}; left out: {measured.missing:,} without a value, "
        f"{measured.beside:,} beside the surface",
        f"{'':26} {'datums':>24} {'best fit':>24}",
    ]
    columns = [_column(built, "datums", built.datums), _column(built, "best fit", built.fitted)]
    lines += [f"{name:26} {a:>24} {b:>24}" for name, a, b in zip(ROWS, *columns)]
    lines.append(
        f"noise of the measurement {NANOMETRES * fit.noise:.3g} nm; "
        f"the correction follows {fit.freedom:,.0f} degrees of freedom"
    )
    light, designed = built.light_error, f"rel_l2 {built.nominal.metrics['rel_l2']:.4f} as designed"
    if light is None:
        part = floor(1000 * built.known) / 10
        lines.append(
            f"{designed}; as made not decided: only {part:g} % of the light for the target crosses where the "
            f"{built.side} was measured. The fitted lens, aligned by {built.way}, is smooth in the gaps"
        )
    else:
        lines.append(
            f"{designed}, {light.rel_l2:.4f} +- {light.error:.2g} as made, aligned by {built.way}; "
            f"the noise adds {light.floor:.4f} in squares to the fitted lens"
        )
    moved = built.correction
    if moved and moved.after > (1 - GAIN) * moved.before:
        lines.append("no re-positioning of the lens or the target brings light back")
    elif moved:
        lines.append(
            f"re-positioned: rel_l2 {moved.before:.4f} -> {moved.after:.4f}, all motions together, by "
            "light through front and rear alone"
        )
        lines += [
            f"  {m.name:16} {m.amount:+9.4f} {m.unit:8} "
            f"(alone {m.alone:+9.4f}: {m.rel_l2_alone:.4f} predicted)"
            for m in moved.moves
        ]
    return [*lines, *_notes(built)]


def _column(built: AsBuilt, way: Way, alignment: Alignment | None) -> list[str]:
    """Return what is said of an alignment, under ROWS; dashes where there is none."""
    if alignment is None:
        return ["-"] * len(ROWS)
    return [
        _triple(MICROMETRES * alignment.motion.shift),
        _triple(np.degrees(alignment.motion.rotation_vector)),
        f"{MICROMETRES * alignment.peak_to_valley:.4g}",
        f"{MICROMETRES * alignment.rms:.4g}",
        f"{_beside(built, alignment):,}",
        f"{built.rel_l2_of[way]:.4f}",
    ]


def _notes(built: AsBuilt) -> list[str]:
    """Return sentences on what the numbers cannot tell."""
    notes = []
    if built.no_fit:
        notes.append(f"no best fit: {built.no_fit}")
    if built.outlying and built.outlying not in built.no_fit:
        notes.append(built.outlying)
    if built.fitted and built.fitted.undetermined:
        names = ", ".join(built.fitted.undetermined)
        notes.append(f"the surface does not show all motions: the best fit leaves out a part of {names}")
    if built.made.unresolved > np.clip(BY_CHANCE / sqrt(built.made.fit.residuals.size), *LIKE):
        notes.append(
            "what the fit leaves is no noise, since neighbouring points agree in it: errors of the surface "
            "are finer than the points resolve, and rel_l2 may be off by more than is said here; "
            "measure more points"
        )
    if built.way == "best fit":
        notes.append("the best fit hides tilt and decentre; datums show what they do to the light")
    return notes


def _triple(numbers: Any) -> str:
    return " ".join(f"{n:.3g}" for n in numbers)
