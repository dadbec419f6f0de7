"""The light of a lens as it was made, and what the noise of the measurement leaves unknown of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot, sqrt
from typing import Any, Literal

import numpy as np

from optics.base.runtime import Backend, UserError
from optics.light.analysis import Measurement, Verdict, contrast_error, delivery_checks, judged, measure
from optics.scene.problem import Verify
from optics.scene.system import System
from optics.tolerancing.machining import landing_response
from optics.tolerancing.metrology.alignment import (
    Alignment,
    Floats,
    best_fit,
    by_datums,
    outliers,
    without_outliers,
)
from optics.tolerancing.metrology.corrected_surface import RAYS, MadeSurface, made_surface, measured_light
from optics.tolerancing.metrology.measured_points import MeasuredPoints
from optics.tolerancing.metrology.rigid_corrections import RigidCorrection, rigid_correction
from thbcad.lens import FreeformSurface, Lens, require_sound

Side = Literal["front", "rear"]
Way = Literal["datums", "best fit"]
RelL2 = Callable[[FreeformSurface], float]

DRAWS = 3  # pairs of noise: one alone gives f to 1 %, three the size of the change of first order to 40 %
SEED = 0x5EED7  # simulated points drawn with a usual seed must not share their noise with it
WEAKER = 30.0  # what bends light is finer than heights: a smoothing that leaves more of it, and more noise
# of the functions where points are: noise that hides ripple is smoothed until hardly anything is left
FREE, MOST_FITS = 0.25, 6


@dataclass(frozen=True)
class LightError:
    """What noise and smoothing do to rel_l2 of a made lens.

    rel_l2 : without what the noise adds to it on average.  error : its standard deviation.
    floor : f, what the noise adds to the fitted lens: rel_l2^2 of that is larger by f^2.
    """

    rel_l2: float
    error: float
    floor: float


@dataclass(frozen=True, eq=False)
class AsBuilt:
    """A lens as it was made.

    lens : with the made surface.  way : the alignment that it belongs to.
    correction : the re-positioning that gets most of the light back, if asked for.
    datums, fitted : both alignments; None where no best fit was found, and `no_fit` says why.
    rel_l2_of : of the fitted lens by either.
    known : fraction of the light for the target that crosses where the surface was measured.
    light_error : None where less than all does: what was not measured is not known.
    outlying : that some points lie far from where the others do, a sentence; empty where none do.
    """

    lens: Lens
    measured: MeasuredPoints
    side: Side
    way: Way
    made: MadeSurface
    datums: Alignment
    fitted: Alignment | None
    no_fit: str
    outlying: str
    nominal: Measurement
    measurement: Measurement
    rel_l2_of: Mapping[Way, float]
    known: float
    light_error: LightError | None
    correction: RigidCorrection | None

    def verdict(self, limits: Verify, notes: Sequence[str] = ()) -> Verdict:
        """Return the verdict on the light of the made lens; not decided where part of it was not measured.

        limits : of a problem.  notes : sentences beside it.
        """
        metrics = self.measurement.metrics
        if self.light_error is None:
            remark = f"only {100 * self.known:.3g} % of the light crosses where the {self.side} was measured"
            checks = [replace(c, value=None, remark=remark) for c in delivery_checks(metrics, limits)]
            return judged(metrics, checks, notes, of_file=False)
        error = self.light_error
        both = hypot(error.error, metrics["rel_l2_error"])  # of metrology, and of the measured light itself
        light: dict[str, float | None] = {"rel_l2_debiased": error.rel_l2, "rel_l2_error": both}
        if metrics.get("contrast_error") is not None:
            light |= contrast_error(light, self.measurement.target)
        known = metrics | light | _less_certain(metrics, error.error)
        return judged(known, delivery_checks(known, limits), notes, of_file=False)

    @property
    def change(self) -> Floats:
        """dE = made - designed irradiance, (rows, columns), W/mm^2."""
        return self.measurement.irradiance - self.nominal.irradiance


def _less_certain(metrics: dict[str, Any], error: float) -> dict[str, Any]:
    """Return uniformity and zones whose light on each place has one more error, relative to its mean."""
    out, uniformity = {}, metrics.get("uniformity")
    if uniformity is not None:
        names = ("min_over_mean_error", "min_over_max_error", "rsd_error")
        out["uniformity"] = uniformity | {name: hypot(uniformity[name], error) for name in names}
    if "zones" in metrics:
        out["zones"] = [
            row | {"error": hypot(row["error"], error * row["value"]), "margin_in_errors": None}
            for row in metrics["zones"]
        ]
    return out


def default_side(lens: Lens) -> Side:
    """Return the surface that carries a freeform sag, the rear where both do or none."""
    return "front" if lens.front.sag is not None and lens.rear.sag is None else "rear"


def surface_of(lens: Lens, side: Side) -> FreeformSurface:
    """Return the front or the rear of a lens.

    Raises UserError : another word.
    """
    if side not in ("front", "rear"):
        raise UserError(f"surface must be front or rear, got {side!r}")
    return lens.front if side == "front" else lens.rear


def with_surface(lens: Lens, side: Side, surface: FreeformSurface) -> Lens:
    """Return the lens with another front or rear."""
    return replace(lens, front=surface) if side == "front" else replace(lens, rear=surface)


def light_as_built(
    system: System,
    measured: MeasuredPoints,
    backend: Backend,
    side: Side,
    way: Way = "datums",
    nominal: Measurement | None = None,
    correct: bool = True,
) -> AsBuilt:
    """Return a lens as it was made, traced.

    measured : points of the front or the rear, in its frame.  way : "datums", the file's frame is the lens's,
        or "best fit", the frame that brings the points nearest to the design.
    backend : of double precision.  nominal : what the designed lens delivers, where it is known.
    correct : also look for the re-positioning that gets most of the light back.

    Raises UserError : another surface or alignment, points that do not determine the surface or make no lens,
        a surface that light meets from behind too, or a best fit that is asked for and does not exist.
    """
    lens = system.designed
    designed = surface_of(lens, side)
    _require_met_in_front(system, side)
    points, outlying = without_outliers(designed, measured.points)
    aligned, no_fit = _alignments(designed, points, way)
    chosen = made_surface(designed, aligned[way])
    lit = landing_response(system, backend, side, RAYS)
    known = measured_light(aligned[way].points[:2], lit, designed.outline)

    def rel_l2(surface: FreeformSurface) -> float:
        other = system.with_lens(with_surface(lens, side, surface))
        return float(measure(other, backend).metrics["rel_l2"])

    made = with_surface(lens, side, chosen.surface)
    try:
        require_sound(made)
    except ValueError as error:
        raise UserError(f"no lens has the {side} that was measured: {error}") from None
    built = system.with_lens(made)
    measurement = measure(built, backend)
    corrects = correct and len(system.seen_receivers) == 1  # tolerances follow the light of one lens
    rel_l2_of = {way: float(measurement.metrics["rel_l2"])}
    for other in {*aligned} - {way}:
        rel_l2_of[other] = rel_l2(made_surface(designed, aligned[other], chosen.fit.smoothing).surface)
    return AsBuilt(
        lens=made,
        measured=measured,
        side=side,
        way=way,
        made=chosen,
        datums=aligned["datums"],
        fitted=aligned.get("best fit"),
        no_fit=no_fit,
        outlying=outlying or next(filter(None, (outliers(designed, each) for each in aligned.values())), ""),
        nominal=nominal or measure(system, backend),
        measurement=measurement,
        rel_l2_of=rel_l2_of,
        known=known,
        light_error=None if known < 1 else _light_error(chosen, aligned[way], rel_l2_of[way], rel_l2),
        correction=rigid_correction(built, measurement.target, backend) if corrects else None,
    )


def _require_met_in_front(system: System, side: Side) -> None:
    """Raise UserError where light meets the measured surface from behind: such surfaces are traced without
    what was measured."""
    optic = system.problem.optic
    for face in system.problem.faces_met:
        if face.optic is optic and face.face == side and face.backwards:
            raise UserError(
                f"light meets {face.name} from behind, where a measured surface is not traced; "
                "measure another surface"
            )


def _alignments(designed: FreeformSurface, points: Floats, way: Way) -> tuple[dict[Way, Alignment], str]:
    """Return points as they are aligned by datums and by a best fit, and why there is no best fit, if so."""
    if way not in ("datums", "best fit"):
        raise UserError(f"align must be datums or best fit, got {way!r}")
    aligned: dict[Way, Alignment] = {"datums": by_datums(designed, points)}
    try:
        return aligned | {"best fit": best_fit(designed, points)}, ""
    except UserError as error:  # datums need no fit
        if way == "best fit":
            raise
        return aligned, str(error)


def _light_error(made: MadeSurface, points: Alignment, fitted: float, rel_l2: RelL2) -> LightError:
    """Return what noise and smoothing do to rel_l2, from a second fit that smooths less and is free enough.

    What smoothing takes from the light hardly matters there, and the noise that it leaves is taken off.
    How much the two fits then differ is part of the error.  Where noise would bring more than all that was
    found, as an outlier makes it seem, rel_l2 is only known to be no greater than that of the fits.

    fitted : rel_l2 of the made surface.
    """
    floor, _ = _noise(made, fitted, rel_l2, 1)
    for fits in range(1, MOST_FITS + 1):
        finer = made_surface(made.designed, points, made.fit.smoothing / WEAKER**fits)
        if finer.fit.freedom >= FREE * finer.covered * finer.fit.surface.space.dim:
            break
    rough = rel_l2(finer.surface)
    added, spread = _noise(finer, rough, rel_l2, DRAWS)
    value, smooth = sqrt(max(rough**2 - added, 0.0)), sqrt(max(fitted**2 - floor, 0.0))
    error = hypot(spread / value, value - smooth) if value else max(rough, fitted)
    return LightError(value, error, sqrt(max(floor, 0.0)))


def _noise(made: MadeSurface, here: float, rel_l2: RelL2, draws: int) -> tuple[float, float]:
    """Return (f^2, the standard deviation of rel_l2^2 / 2) that noise like the measured one brings.

    Noise n and -n are traced in pairs: the mean of rel_l2^2 exceeds that of the fit by f^2, where the change
    of first order cancels, and half the difference is that change.

    here : rel_l2 of the made surface.
    """
    rng = np.random.default_rng(SEED)
    squares, changes = [], []
    for _ in range(draws):
        noise = made.fit.noise * rng.standard_normal(len(made.fit.residuals))
        up, down = (rel_l2(made.with_noise(noise, sign)) ** 2 for sign in (1.0, -1.0))
        squares.append((up + down) / 2 - here**2)
        changes.append((up - down) / 4)
    return float(np.mean(squares)), float(np.sqrt(np.mean(np.square(changes))))
