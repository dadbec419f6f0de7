"""How far light lands from where it did, when its direction changes before or in the lens.

All light that passes a point u of the rear makes one spot on the target.  That is the linear image of the
beam's angles delta and of the errors s of the slopes,

    dX = B delta + F s_front + R s_rear,        all three (2, 2), at fixed u.

A ray that starts turned, or is turned at the front, meets the rear at another point.  With the index k of a
ray, its direction a inside the lens and its point u of the rear, the change of direction at fixed u is

    da / d(delta) = a_delta - a_k u_k^-1 u_delta.

Snell's law at the rear and the way to the target make dX of it.  Derivatives along a ray that keeps its
index would mix in the curvature of the rear, which varies wildly where X does not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from optics.base.runtime import Backend
from optics.light.refraction import ShapedSurface
from optics.light.tracing import Tracer
from optics.scene.paths import LightPath
from optics.scene.sources import corner_flux
from optics.scene.system import System
from thbcad.checks import Floats

CELLS = 64  # of the source in each direction: the way to the target varies slowly
STEP = 1e-4  # radians, and slopes, of central differences: both their errors are about 1e-8


@dataclass(frozen=True, eq=False)
class LandingShifts:
    """Means over the flux of dX by what turns light, (2, 2), mm or degrees per radian or slope.

    front, rear : slopes of the surfaces; of a mirror those of its face, and nothing.
    variation : the standard deviation of that of the last surface over it, relative to its mean.
    """

    beam: Floats
    front: Floats
    rear: Floats
    variation: float


@dataclass(frozen=True, eq=False)
class _Rear:
    """Light at the last surface: u (2, n, m), z (n, m), slopes (2, n, m), a (2, n, m), flux (n, m)."""

    u: Floats
    z: Floats
    slopes: Floats
    a: Floats
    flux: Floats


def landing_shifts(system: System, path: LightPath, backend: Backend) -> LandingShifts:
    """Return the LandingShifts of a path through a lens, or by a mirror.

    system : without blur, of a source without extent.
    """
    cells = system.source.cells((CELLS, CELLS))
    s, t = (v.ravel() for v in np.meshgrid(cells.s, cells.t, indexing="ij"))
    rays = cells.at(s, t, corner_flux(cells.emitted).ravel())
    last = len(path.surfaces) - 1
    shaped = ShapedSurface.of(path, last)

    def at_rear(turn: Sequence[float] = (0.0, 0.0), front: Sequence[float] = (0.0, 0.0)) -> _Rear:
        errors = [np.reshape(front, (2, 1)) if any(front) else None, None]
        erring = path.with_slope_errors(errors) if last else path
        x, y, _ = rays.direction
        x, y = x + turn[0], y + turn[1]
        turned = replace(rays, direction=np.stack([x, y, np.sqrt(1 - x * x - y * y)]))
        tracer = Tracer(backend, erring, turned)
        with backend.dr.suspend_grad():
            hits, direction, flux = tracer.at(last)
        every = backend.dr.zeros(backend.Float, turned.flux.size)

        def grid(*values: object) -> Floats:
            rows = [np.asarray((v + every).numpy(), np.float64) for v in values]
            return np.stack(rows).reshape(len(rows), len(cells.s), len(cells.t))

        slopes, inside = grid(hits.zx, hits.zy), grid(*direction[:2])
        return _Rear(grid(hits.x, hits.y), grid(hits.z)[0], slopes, inside, grid(flux)[0])

    here = at_rear()
    inside_by_beam = _by_change(here, lambda d: at_rear(turn=d))
    inside_by_front = _by_change(here, lambda d: at_rear(front=d)) if last else np.zeros_like(inside_by_beam)
    by_inside = _differences(lambda d: _landing(shaped, here, here.a + d, here.slopes))
    by_rear = _differences(lambda d: _landing(shaped, here, here.a, here.slopes + d))
    known = here.flux > 0
    for field in (inside_by_beam, inside_by_front, by_inside, by_rear):
        known &= np.isfinite(field).all(axis=(0, 1))
    flux = here.flux[known] / here.flux[known].sum()

    def mean(field: Floats) -> Floats:
        return np.asarray(field[:, :, known] @ flux)

    rear = mean(by_rear)
    spread = np.sqrt((np.square(by_rear[:, :, known] - rear[:, :, None]) @ flux).sum())
    front = mean(np.einsum("ij...,jk...->ik...", by_inside, inside_by_front))
    return LandingShifts(
        mean(np.einsum("ij...,jk...->ik...", by_inside, inside_by_beam)),
        *((front, rear) if last else (rear, front)),
        float(spread / np.linalg.norm(rear)),
    )


def _by_change(here: _Rear, changed: Callable[[Sequence[float]], _Rear]) -> Floats:
    """Return the derivative of the direction inside by two components at fixed u, (2, 2, n, m)."""
    u_k, a_k = (np.stack([np.gradient(v, axis=k) for k in (1, 2)], axis=1) for v in (here.u, here.a))
    columns = []
    for step in np.diag([STEP, STEP]):
        after, before = changed(step.tolist()), changed((-step).tolist())
        lost = (after.flux == 0) | (before.flux == 0)
        u_d, a_d = ((x - y) / (2 * STEP) for x, y in ((after.u, before.u), (after.a, before.a)))
        with np.errstate(divide="ignore", invalid="ignore"):  # where no light is
            (a, b), (c, d) = u_k
            inverse = np.stack([np.stack([d, -b]), np.stack([-c, a])]) / (a * d - b * c)
            back = np.einsum("ij...,j...->i...", inverse, u_d)
            columns.append(np.where(lost, np.nan, a_d - np.einsum("ij...,j...->i...", a_k, back)))
    return np.stack(columns, axis=1)


def _differences(landing: Callable[[Floats], Floats]) -> Floats:
    """Return the derivative of landing points by two components, (2, 2, n, m)."""
    steps = np.reshape([[STEP, 0], [0, STEP]], (2, 2, 1, 1))
    return np.stack([(landing(d) - landing(-d)) / (2 * STEP) for d in steps], axis=1)


def _landing(shaped: ShapedSurface, here: _Rear, inside: Floats, slopes: Floats) -> Floats:
    """Return where light lands, (2, n, m): mm, or degrees in the far field."""
    along = [*inside, np.sqrt(1 - np.square(inside).sum(axis=0))]
    with np.errstate(divide="ignore", invalid="ignore"):  # light along the surface
        return np.array(shaped.landing((*here.u, here.z), along, list(slopes)))
