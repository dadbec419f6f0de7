"""The engine of the exact tracer: rays meet the splines themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from optics.base.runtime import Backend
from optics.light.engines.light_model import Film
from optics.light.engines.traced_model import TracedModel
from optics.light.measuring import MappedCells
from optics.light.tracing import Tracer
from optics.scene.receivers import Window
from optics.scene.sources import LightSource, RayGrid, Rays, mirror_half
from optics.scene.system import System

SOFT_RIM = 0.02  # of the half-width: where rays count less and less
FAR = 100.0  # half-widths: from there single precision moves meeting points by 1e-5 of them
KEPT = 3  # sets of rays: of a stage, of its rough steps, and others


class DrawnRays:
    """Rays of a source for films.  The last sets are kept: drawing one takes as long as several traces."""

    def __init__(self) -> None:
        self._kept: list[tuple[LightSource, tuple[object, ...], RayGrid | Rays, Sequence[int]]] = []

    def __call__(self, source: LightSource, film: Film) -> tuple[RayGrid | Rays, Sequence[int]]:
        """Return the rays, and the directions in which they are one half of the light."""
        for drawn_of, drawing, rays, axes in self._kept:
            if drawn_of is source and drawing == film.drawing:
                return rays, axes
        fresh, axes = None if film.fresh is None else np.random.default_rng(film.fresh), ()
        rays = source.rays(film.rays, fresh)
        if source.extended and isinstance(rays, Rays):
            rays, axes = mirror_half(rays, film.axes), film.axes
        self._kept = [(source, film.drawing, rays, axes), *self._kept][:KEPT]
        return rays, axes


@dataclass(frozen=True, eq=False)
class ExactEngine:
    """Light models of exact rays and cells on a Dr.Jit backend: an `Engine`.

    soft_rim : as of `Tracer`.  drawn : the rays, which stages of a design have in common.
    of_drawn : traces rays drawn from a source that is not FAR, whose noise is far above its rounding; None is
        `backend`.
    """

    backend: Backend
    soft_rim: float = SOFT_RIM
    drawn: DrawnRays = field(default_factory=DrawnRays, repr=False)
    of_drawn: Backend | None = None

    def model(self, system: System, film: Film) -> TracedModel:
        """Return the light model of a system with the meshes of a lens, see `Engine`."""
        rays, window, mirrors = measured_rays(self.backend, system, film, self.drawn)
        path = system.path.with_soft_rims(self.soft_rim)
        if not system.problem.optimizer.fresnel:
            path = path.without_reflection()
        backend = self.backend
        if self.of_drawn and film.window is not None and system.source.extended and isinstance(rays, Rays):
            near = np.abs(rays.origin).max() < FAR * max(system.designed.front.half_width)
            backend = self.of_drawn if near else backend
        tracer = Tracer(backend, path, rays, proven=False, polarised=False)
        light = float(rays.flux.sum())
        return TracedModel(backend, tracer, film.screen, window, mirrors, light)


def measured_rays(
    backend: Backend, system: System, film: Film, drawn: DrawnRays
) -> tuple[RayGrid | Rays, Window | MappedCells, Sequence[int]]:
    """Return the rays for a film, how they are measured, and in which directions they are one half.

    Cells of light that stays parallel up to the rear end at its rim, so that no cell is cut.
    """
    lens = system.designed
    if film.window is None:
        front, rear = (s.half_width for s in (lens.front, lens.rear))
        lit = [min(pair) for pair in zip(front, rear)] if system.parallel else front
        cells = system.source.cells([n - 1 for n in film.rays], lit).half(film.axes)
        rays = cells.rays()
        mapped = MappedCells(backend, film.screen, cells.emitted, rays.flux, cells.turned, film.axes)
        return rays, mapped, film.axes
    rays, axes = drawn(system.source, film)
    return rays, film.window, axes
