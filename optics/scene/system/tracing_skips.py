"""What tracing leaves out, decided from the problem alone, before anything is traced."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import takewhile
from math import erf, exp, pi, sqrt

from optics.scene.problem import Problem
from optics.scene.receivers import GaussianWindow
from optics.scene.sources import LightSource
from optics.scene.system.source import aperture_of

ROUNDING = 1e-10  # relative, of loss and gradient: the resolution of meeting points in double precision


@dataclass(frozen=True)
class Skip:
    """One part of the work that a problem may not need.

    what : the part.  applies : it is left out.  why : what in the problem allows it, or forbids it.
    tolerance : relative change of loss and gradient when it is left out; None where it is unknown before
        tracing.
    """

    name: str
    what: str
    applies: bool
    why: str
    tolerance: float | None = ROUNDING

    @property
    def line(self) -> str:
        """The line that `thbcad check --explain` prints."""
        if not self.applies:
            return f"does not skip {self.what}: {self.why}"
        change = "" if self.tolerance is None else f" (changes less than {self.tolerance:.1g})"
        return f"skips {self.what}: {self.why}{change}"


def skips(problem: Problem, source: LightSource, parallel: bool) -> list[Skip]:
    """Return every Skip of a problem, those that do not apply too.

    source : its own.  parallel : rays stay parallel in the lens.
    """
    rays = _of_rays(problem, source, parallel)
    front, rear = problem.optic.front.freeform, problem.optic.rear.freeform
    faces = problem.faces_met
    kept = list(takewhile(lambda f: getattr(f.optic, f.face).freeform is None, faces))[: len(faces) - 1]
    frozen, first = bool(kept), faces[0].name if problem.element else "the front"
    what = ", ".join(face.name for face in kept) if frozen and problem.element else first
    deep = max(f.finest for f in (front, rear) if f is not None) > 0
    state = f"{what} {'has' if len(kept) == 1 else 'have'} no freeform" if frozen else f"{first} is free"
    return [
        *rays,
        Skip("front", f"{what} in all evaluations but the first", frozen, state),
        Skip("gradients", f"gradients by the shape of {what}", frozen, state),
        Skip(
            "levels",
            "knots and levels that no refined cell needs",
            deep,
            "the spline's net holds the knots of refined cells only" if deep else "there is one level",
        ),
        Skip(
            "camera",
            "screen and camera",
            True,
            "the irradiance is summed from the landing points; a camera would add noise",
            None,
        ),
        Skip(
            "fresnel",
            "Fresnel's losses",
            not problem.optimizer.fresnel,
            "optimizer.fresnel = true, so that the light asked for reckons with them"
            if problem.optimizer.fresnel
            else "optimizer.fresnel = false; metrics and verify have them",
            None,
        ),
        _far_pixels(problem, source),
        Skip(
            "compilation",
            "compiling the kernels anew",
            True,
            "lens, screen and weights come to them as data, not as constants",
        ),
    ]


def _of_rays(problem: Problem, source: LightSource, parallel: bool) -> list[Skip]:
    pairs = zip(problem.source.half_width, aperture_of(problem))
    wider = source.collimated and any(beam > aperture for beam, aperture in pairs)
    if not source.collimated:
        aperture = "the source lights all around"
    elif wider:
        aperture = "the beam is wider than the lens"
    else:
        aperture = "all of the beam meets the lens"
    lens, colours = problem.optic, bool(problem.source.spectrum)
    blurs = source.diverging or lens.front.slope_rms > 0 or lens.rear.slope_rms > 0
    return [
        Skip(
            "meeting points",
            "the search for meeting points with the rear",
            parallel,
            "rays stay parallel behind a plane front: evaluation is one constant matrix"
            if parallel
            else "rays are not parallel in the lens",
        ),
        Skip("aperture", "rays of the source that pass beside the lens", wider, aperture),
        Skip(
            "converged rays",
            "Newton's steps of rays that have met the surface",
            not parallel,
            "no steps are taken at all"
            if parallel
            else "every ray stops by itself, within the resolution and one more step",
        ),
        Skip(
            "first meetings",
            "the proof that of several meetings it is the first, while optimising",
            not parallel,
            "there is no search"
            if parallel
            else "metrics, verify and trace prove it; a ray that meets a surface twice may take another "
            "meeting",
            None,
        ),
        _edges(problem, parallel),
        Skip(
            "blur",
            "directions of the beam and errors of the slopes",
            not blurs,
            "many directions and errors are sampled"
            if blurs
            else "the light has no divergence, and the surfaces are smooth",
        ),
        Skip(
            "wavelengths",
            "other wavelengths",
            not colours,
            "every line of the spectrum is measured" if colours else "the light has one wavelength",
        ),
    ]


def _edges(problem: Problem, parallel: bool) -> Skip:
    source, lens = problem.source, problem.optic
    beam = [min(s, f) for s, f in zip(source.half_width, lens.front.half_width)]
    within = parallel and all(b <= r for b, r in zip(beam, lens.rear.half_width))
    why = "no parallel ray meets an edge before the rear"
    if not within:
        why = "rays may meet an edge: `thbcad trace` measures their flux"
    why = f"{why}; light through front and rear is unchanged"
    return Skip("edges", "the edges and reflected light", True, why)


def _far_pixels(problem: Problem, source: LightSource) -> Skip:
    """Return the Skip of pixels that a ray or a cell cannot light."""
    window = problem.optimizer.window
    if window == "cells" and (source.diverging or not source.extended):  # the blur of a beam has no rays
        what = "all pixels that an edge of a cell does not cross"
        return Skip("taps", what, True, "what lies inside is summed once for all cells", ROUNDING)
    taps = {
        "cells": 2,
        "pixel": 2,
        "bspline": problem.optimizer.window_degree + 1,
        "gaussian": GaussianWindow(problem.optimizer.sigma).taps,
    }[window]
    support = "beyond its support the window is zero"
    if window == "gaussian":
        support = (
            f"the Gaussian is cut off at {GaussianWindow.cut:g} sigma, and the target is measured "
            "with the same window"
        )
    return Skip(
        "taps",
        f"all but {taps} x {taps} pixels around a ray",
        True,
        support,
        gaussian_tail() if window == "gaussian" else ROUNDING,
    )


def gaussian_tail(cut: float = GaussianWindow.cut) -> float:
    """Return a bound of the relative L2 change of an image where the Gaussian window is not cut off.

    The window g lowered to zero at c sigma and rescaled differs from g by 2 m in the L1 norm, where
    m = 1 - erf(c / sqrt 2) + 2 c exp(-c^2 / 2) / sqrt(2 pi) is the mass taken away.  Two directions make
    4 m (Young's inequality).
    """
    return 4 * (1 - erf(cut / sqrt(2)) + 2 * cut * exp(-(cut**2) / 2) / sqrt(2 * pi))
