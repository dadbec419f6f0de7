"""What is said of a made lens: numbers by name, and lines."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from optics.as_built.alignment import Alignment
    from optics.as_built.as_built_light import AsBuilt, Way
    from optics.as_built.rigid_corrections import Move, RigidCorrection

MICROMETRES, NANOMETRES = 1e3, 1e6  # of a millimetre
GAIN = 0.01  # of rel_l2: what a re-positioning must bring to be worth the work
LIKE = 0.25  # correlation of neighbouring residuals: that of 100 points of pure noise is below 0.1
COVERED = 0.5  # of the cells hold a point: with fewer the fit bridges gaps


def as_built_data(built: AsBuilt) -> dict[str, Any]:
    """Return the numbers of a made lens by name: mm, degrees, W/mm^2."""
    light, fit = built.light_error, built.made.fit
    ways: dict[Way, Alignment] = {"datums": built.datums, "best fit": built.fitted}
    return {
        "surface": built.side,
        "align": built.way,
        "points": _on_surface(built),
        "missing": built.measured.missing,
        "beside": built.measured.beside,
        "alignments": {
            name: _alignment(alignment) | {"rel_l2": built.rel_l2_of[name]}
            for name, alignment in ways.items()
        },
        "noise_mm": fit.noise,
        "fitted_degrees_of_freedom": fit.freedom,
        "covered": built.made.covered,
        "correlation_of_residuals": built.made.unresolved,
        "rel_l2": {
            "designed": built.nominal.metrics["rel_l2"],
            "made": light.rel_l2,
            "error": light.error,
            "fitted_lens": built.measurement.metrics["rel_l2"],
            "noise_floor": light.floor,
        },
        "re_positioning": _correction(built.correction),
        "change": float(np.linalg.norm(built.change) / np.linalg.norm(built.nominal.irradiance)),
        "efficiency": built.measurement.metrics["efficiency"],
    }


def _on_surface(built: AsBuilt) -> int:
    """Return how many points lie on the surface, in the frame of the file."""
    return built.datums.points.shape[1]


def _correction(correction: RigidCorrection | None) -> dict[str, Any] | None:
    if correction is None:
        return None
    return {
        "rel_l2_before": correction.before,
        "rel_l2_after": correction.after,
        "moves": {m.name: _move(m) for m in correction.moves},
    }


def _move(move: Move) -> dict[str, Any]:
    return {
        "unit": move.unit,
        "amount": move.amount,
        "alone": move.alone,
        "rel_l2_alone": move.rel_l2_alone,
    }


def _alignment(alignment: Alignment) -> dict[str, Any]:
    return {
        "shift_mm": alignment.motion.shift.tolist(),
        "tilt_degrees": np.degrees(alignment.motion.tilt).tolist(),
        "peak_to_valley_mm": alignment.peak_to_valley,
        "rms_mm": alignment.rms,
        "undetermined": list(alignment.undetermined),
    }


def as_built_lines(built: AsBuilt) -> list[str]:
    """Return what is said of a made lens on the command line."""
    measured, fit, light = built.measured, built.made.fit, built.light_error
    lines = [
        f"{_on_surface(built):,} points of the {built.side}; left out: {measured.missing:,} without a value, "
        f"{measured.beside:,} beside the surface",
        f"{'':26} {'datums':>24} {'best fit':>24}",
    ]
    ways = [built.datums, built.fitted]
    rows = [
        ("shift in x, y, z / um", [_triple(MICROMETRES * a.motion.shift) for a in ways]),
        ("tilt about x, y, z / deg", [_triple(np.degrees(a.motion.tilt)) for a in ways]),
        ("error of height, PV / um", [f"{MICROMETRES * a.peak_to_valley:.4g}" for a in ways]),
        ("error of height, RMS / um", [f"{MICROMETRES * a.rms:.4g}" for a in ways]),
        ("rel_l2 of the fitted lens", [f"{built.rel_l2_of[way]:.4f}" for way in ("datums", "best fit")]),
    ]
    lines += [f"{name:26} {a:>24} {b:>24}" for name, (a, b) in rows]
    lines.append(
        f"noise of the measurement {NANOMETRES * fit.noise:.3g} nm; "
        f"the correction follows {fit.freedom:,.0f} degrees of freedom"
    )
    lines.append(
        f"rel_l2 {built.nominal.metrics['rel_l2']:.4f} as designed, "
        f"{light.rel_l2:.4f} +- {light.error:.4f} as made, aligned by {built.way}; "
        f"the noise adds {light.floor:.4f} in squares to the fitted lens"
    )
    return [*lines, *_correction_lines(built.correction), *_notes(built)]


def _correction_lines(correction: RigidCorrection | None) -> list[str]:
    """Return what re-positioning does, the best motion first."""
    if correction is None:
        return []
    if correction.after > (1 - GAIN) * correction.before:
        return ["no re-positioning of the lens or the target brings light back"]
    lines = [
        f"re-positioned: rel_l2 {correction.before:.4f} -> {correction.after:.4f}, all motions together, by "
        "light through front and rear alone"
    ]
    for m in correction.moves:
        lines.append(
            f"  {m.name:16} {m.amount:+9.4f} {m.unit:8} "
            f"(alone {m.alone:+9.4f}: {m.rel_l2_alone:.4f} predicted)"
        )
    return lines


def _notes(built: AsBuilt) -> list[str]:
    """Return sentences on what the numbers cannot tell."""
    notes = []
    if built.fitted.undetermined:
        names = ", ".join(built.fitted.undetermined)
        notes.append(f"the surface does not show all motions: the best fit leaves out a part of {names}")
    if built.made.covered < COVERED:
        notes.append(
            f"only {100 * built.made.covered:.0f} % of the surface's cells hold a point: "
            "in gaps the light is that of a smooth correction, not of the lens"
        )
    if built.made.unresolved > LIKE:
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
