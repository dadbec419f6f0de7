"""Where light goes through front and rear: the least lens that loses none of it, and what a cut costs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import Backend
from optics.light.tracing import Tracer
from optics.scene.sources import RayGrid, Rays, single_rays
from optics.scene.system import OpticalSystem
from thbcad.checks import Floats
from thbcad.lens import Lens
from thbcad.outlines import Outline, Polygon

CELLS = (512, 512)  # of the source; sources with extent have as many rays


@dataclass(frozen=True, eq=False)
class LitPoints:
    """Where rays that go through front and rear meet them.

    points : x and y of front and of rear, (2, n) mm each.  flux : W, behind the rear.
    lit : which of them land on the target.
    """

    points: tuple[Floats, Floats]
    flux: Floats
    lit: NDArray[np.bool_]

    @classmethod
    def of(cls, system: OpticalSystem, lens: Lens, backend: Backend, rays: RayGrid | Rays) -> LitPoints:
        """Trace rays of the source of a system."""
        single = single_rays(rays, lens)
        tracer = Tracer(backend, system.path(lens), single)
        with backend.dr.suspend_grad():
            hits, landing = tracer.trace_all()
            arrives = (landing.flux > 0) & landing.arrives
            front, rear = ((h.x, h.y) for h in hits if h is not None)
            values = [*front, *rear, landing.x, landing.y, landing.flux, arrives]
            backend.dr.eval(values)
        *values, flux, arrive = (a.numpy() for a in values)
        x, y, u, v, s, t = (a[arrive] for a in values)
        hx, hy = system.target.settings.half_width
        lit = (np.abs(s) <= hx) & (np.abs(t) <= hy)
        return cls((np.stack([x, y]), np.stack([u, v])), flux[arrive], lit)


@dataclass(frozen=True)
class CutCost:
    """What a cut of a lens costs: the shares of light that meets front or rear beside what is left.

    through : of the light that goes through front and rear.  on_target : of that on the target.
    """

    through: float
    on_target: float


def least_half_widths(system: OpticalSystem, lens: Lens, backend: Backend) -> dict[str, tuple[float, float]]:
    """Return the half-widths of front and rear, in their outline, that would lose none of their light, mm.

    backend : of double precision.
    """
    if system.source.extended or system.blurred:
        rays: RayGrid | Rays = system.source.rays(CELLS)
    else:  # corners of cells, so that the border of the light is among them
        rays = system.source.cells(CELLS).rays()
    found = LitPoints.of(system, lens, backend, rays)
    least = {}
    for name, surface, points in zip(("front", "rear"), (lens.front, lens.rear), found.points):
        hx, hy = np.array(surface.half_width) * float(surface.outline.gauge(*points).max(initial=0.0))
        if surface.outline.is_rectangle:  # of which both sides are free
            hx, hy = np.abs(points).max(axis=1, initial=0.0)
        least[name] = float(hx), float(hy)
    return least


def cut_cost(system: OpticalSystem, lens: Lens, backend: Backend, cut: Outline | Polygon) -> CutCost:
    """Return what is lost of the light of a lens that is cut along z.  backend : of double precision."""
    found = LitPoints.of(system, lens, backend, system.source.rays(CELLS))
    left = cut.contains(*found.points[0]) & cut.contains(*found.points[1])

    def lost(among: NDArray[np.bool_]) -> float:
        total = float(found.flux[among].sum())
        return float(found.flux[among & ~left].sum()) / total if total else 0.0

    return CutCost(lost(np.ones_like(left)), lost(found.lit))
