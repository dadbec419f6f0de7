"""Where light meets the surfaces: the least lens or mirror that loses none of it, and what a cut costs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optics.base.runtime import Backend
from optics.light.tracing import Tracer
from optics.scene.limits import LitPart
from optics.scene.sources import RayGrid, Rays
from optics.scene.system import System
from thbcad.checks import Bools, Floats
from thbcad.lens import radii_within
from thbcad.outlines import Outline, Polygon

CELLS = (512, 512)  # of the source; sources with extent have as many rays


@dataclass(frozen=True, eq=False)
class LitPoints:
    """Where rays that leave the last surface meet all of them.

    points : x and y of every surface in its element's own frame, (2, n) mm each.  flux : W, behind the last.
    lit : which of them land on the target.
    """

    points: list[Floats]
    flux: Floats
    lit: Bools

    @classmethod
    def of(cls, system: System, backend: Backend, rays: RayGrid | Rays) -> LitPoints:
        """Trace rays of the source of a system."""
        path = system.path
        single = rays.rays(path.before)
        tracer = Tracer(backend, path, single)
        with backend.dr.suspend_grad():
            hits, landing = tracer.trace_all()
            arrives = (landing.flux > 0) & landing.arrives
            met = [row for h in hits if h is not None for row in (h.x, h.y)]
            values = [*met, landing.x, landing.y, landing.flux, arrives]
            backend.dr.eval(values)
        *values, flux, arrive = (a.numpy() for a in values)
        *met, s, t = (a[arrive] for a in values)
        own_y = [-y if face.backwards else y for face, y in zip(system.problem.faces_met, met[1::2])]
        hx, hy = system.target.settings.half_width
        lit = (np.abs(s) <= hx) & (np.abs(t) <= hy)
        return cls([np.stack(pair) for pair in zip(met[::2], own_y)], flux[arrive], lit)


@dataclass(frozen=True)
class CutCost:
    """What a cut of a lens costs: the shares of light that meets front or rear beside what is left.

    through : of the light that goes through front and rear.  on_target : of that on the target.
    """

    through: float
    on_target: float


def least_half_widths(system: System, backend: Backend) -> dict[str, tuple[float, float]]:
    """Return the half-widths of the faces that light meets, in their outline, that would lose none of their
    light, mm, by the name of the face.

    backend : of double precision.
    """
    if system.source.extended or system.blurred:
        rays: RayGrid | Rays = system.source.rays(CELLS)
    else:  # corners of cells, so that the border of the light is among them
        rays = system.source.cells(CELLS).rays()
    found = LitPoints.of(system, backend, rays)
    least: dict[str, tuple[float, float]] = {}
    shapes = (surface.shape for surface in system.path.surfaces)
    for name, surface, points in zip(system.problem.face_names, shapes, found.points):
        hx, hy = np.array(surface.half_width) * float(surface.outline.gauge(*points).max(initial=0.0))
        if surface.outline.is_rectangle:  # of which both sides are free
            hx, hy = np.abs(points).max(axis=1, initial=0.0)
        x, y = least.get(name, (0.0, 0.0))  # of a face that is met twice
        least[name] = max(x, float(hx)), max(y, float(hy))
    return least


def lit_parts(system: System, backend: Backend) -> dict[str, LitPart]:
    """Return the parts that light meets of the free "front" and "rear" of the element that is designed.

    backend : of double precision.
    """
    optic, parts = system.problem.optic, dict[str, LitPart]()
    halves = least_half_widths(system, backend)
    for name, face in zip(system.problem.face_names, system.problem.faces_met):
        half = halves[name]
        if face.optic is optic and face.face in optic.free and min(half) > 0:
            parts[face.face] = LitPart(half, *radii_within(system.designed, face.face, half))
    return parts


def cut_cost(system: System, backend: Backend, cut: Outline | Polygon) -> CutCost:
    """Return what is lost of the light of a lens that is cut along z.  backend : of double precision."""
    found = LitPoints.of(system, backend, system.source.rays(CELLS))
    own = (face.optic is system.problem.optic for face in system.problem.faces_met)
    left = np.logical_and.reduce([cut.contains(*points) for points, mine in zip(found.points, own) if mine])

    def lost(among: Bools) -> float:
        total = float(found.flux[among].sum())
        return float(found.flux[among & ~left].sum()) / total if total else 0.0

    return CutCost(lost(np.ones_like(left)), lost(found.lit))
