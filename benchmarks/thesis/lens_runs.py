"""Lenses by the thesis's method: coefficients behind an arctangent, and the norm of the misfit as the loss.

    c = (2 b / pi) arctan w,    L(w) = ||E(c) - T|| / ||T||        (thesis 5.3, 5.4)

b is z_freedom, E the irradiance on the target's pixels, and T the target irradiance,
as it is or filtered as E is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

import optics
from optics.interface.api import Model, System
from optics.light.analysis import Measurement
from thbcad import Lens, THBSurface
from thbcad.splines import KnotVector

Floats = NDArray[np.float64]
Loss = Callable[[Floats], tuple[float, Floats]]  # w -> loss and gradient

COARSE = 10  # control points in each direction: what a net of these cannot follow is detail
NEAR = 0.025  # of the target's width: light so close to the wanted light blurs its border
DENSE = 201  # samples of a sag in each direction, for roughness and detail


@dataclass(frozen=True, eq=False)
class Misfit:
    """The loss and its gradient by w; call it with w.

    wanted : T, (rows, columns), W/mm^2.  bound : b, mm.
    """

    model: Model
    wanted: Floats
    bound: float

    def __call__(self, w: Floats) -> tuple[float, Floats]:
        irradiance, pull = self.model.vjp(self.coefficients(w))
        difference = irradiance - self.wanted
        misfit, scale = np.linalg.norm(difference), np.linalg.norm(self.wanted)
        slope = difference / ((misfit or 1.0) * scale)
        return float(misfit / scale), pull(slope) * (2 * self.bound / np.pi) / (1 + w * w)

    def coefficients(self, w: Floats) -> Floats:
        """Return c, mm."""
        return 2 * self.bound / np.pi * np.arctan(w)

    def variables(self, coefficients: Floats) -> Floats:
        """Return w of coefficients; those at the bound are brought just within it."""
        return np.tan(np.clip(coefficients / self.bound, -0.999, 0.999) * np.pi / 2)


@dataclass(frozen=True, eq=False)
class Training:
    """What an optimiser did.

    w : after the last step, (n,).  losses : of every evaluation.  seconds : since the start, of every
    evaluation.  kept : {evaluation: w}.  crossed : w where the loss first fell to the mark, None where never.
    """

    w: Floats
    losses: Floats
    seconds: Floats
    kept: dict[int, Floats]
    crossed: Floats | None = None


def trained(
    loss: Loss,
    start: Floats,
    optimiser: optics.Optimiser,
    iterations: int,
    keep: tuple[int, ...] = (),
    mark: float = 0.0,
) -> Training:
    """Return the training of w from a start.

    keep : the evaluations whose w is kept, from 0.  mark : a loss; where it is first reached w is kept too.
    """
    losses: list[float] = []
    seconds: list[float] = []
    kept: dict[int, Floats] = {}
    crossed: list[Floats] = []
    last, begun = [start], perf_counter()

    def recorded(w: Floats) -> tuple[float, Floats]:
        if len(losses) in keep:
            kept[len(losses)] = w.copy()
        value, gradient = loss(w)
        if value <= mark and not crossed:
            crossed.append(w.copy())
        losses.append(value)
        seconds.append(perf_counter() - begun)
        return value, gradient

    optimiser.run(recorded, start, iterations, lambda w: last.__setitem__(0, np.array(w)))
    return Training(last[0], np.array(losses), np.array(seconds), kept, *crossed)


def unfiltered_target(system: System) -> Floats:
    """Return the target irradiance on the pixels, not filtered, (rows, columns), W/mm^2."""
    from optics.base.runtime import load_backend
    from optics.designing.optimisation import transmitted_flux

    target = system.target
    return target.irradiance(target.screen(), transmitted_flux(system, load_backend("double", None)))


def merit(system: System, lens: Lens) -> dict[str, float]:
    """Return the figures of merit of a lens, on fresh rays and box pixels.

    rel_l2, psnr_db, efficiency, stray, astray (flux that lands NEAR of the target's width or more from where
    light is wanted, or beside the target / source), and of the free sag: dof, roughness (rms of the second
    derivatives times the half-width), detail (rms of the sag less its fit by a net of COARSE x COARSE, mm).
    """
    measured = system.measure(lens)
    near = binary_dilation(measured.target > 0, iterations=round(NEAR * measured.target.shape[1]))
    dark = float(measured.irradiance[~near].sum()) * system.target.screen().pixel_area
    astray = measured.metrics["stray"] + dark / system.problem.source.flux
    return {**measured_merit(measured, lens), "astray": float(astray)}


def measured_merit(found: Measurement, lens: Lens) -> dict[str, float]:
    """Return the figures of `merit` of a lens that is measured already, without astray."""
    chosen = {key: float(found.metrics[key]) for key in ("rel_l2", "psnr_db", "efficiency", "stray")}
    return {**chosen, **sag_figures(lens.sags[-1])}


def sag_figures(sag: THBSurface) -> dict[str, float]:
    """Return dof, roughness and detail of a sag, see `merit`."""
    u, v = (np.linspace(kv.start, kv.stop, DENSE) for kv in (sag.space.kv_u, sag.space.kv_v))
    second = [sag.grid(u, v, derivative=order) for order in ((2, 0), (1, 1), (0, 2))]
    bending = second[0] ** 2 + 2 * second[1] ** 2 + second[2] ** 2
    half_width = (sag.space.kv_u.stop - sag.space.kv_u.start) / 2
    values = sag.grid(u, v)
    left, right = _projector(sag.space.kv_u, u), _projector(sag.space.kv_v, v)
    rest = values - left @ values @ right.T
    return {
        "dof": float(sag.space.dim),
        "roughness": float(np.sqrt(bending.mean()) * half_width),
        "detail": float(np.sqrt(np.mean(rest**2))),
    }


def _projector(kv: KnotVector, u: Floats) -> Floats:
    """Return the matrix that takes samples at u to those of their least-squares fit by COARSE functions."""
    coarse = KnotVector.uniform(kv.degree, COARSE - kv.degree, kv.start, kv.stop)
    basis = np.linalg.qr(coarse.collocation(u).toarray()).Q
    return basis @ basis.T
