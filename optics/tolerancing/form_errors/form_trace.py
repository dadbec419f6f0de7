"""The corners of a source's cells, traced through a lens with height errors, and their light on pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from optics.base.runtime import Backend, DrArray, UserError
from optics.light.measuring import MappedCells
from optics.light.tracing import Tracer
from optics.scene.paths import HeightError
from optics.scene.receivers import Screen
from optics.scene.sources import SourceCells
from optics.scene.system import System
from thbcad.checks import Floats


@dataclass(frozen=True)
class ConstantJet:
    """A height and slopes that are the same everywhere, by which landing points are differentiated."""

    height: float
    by_x: float
    by_y: float

    def jet(self, x: Floats, y: Floats) -> Floats:
        """Return the three numbers for all points, (3, n)."""
        return np.repeat([[self.height], [self.by_x], [self.by_y]], len(x), axis=1)


@dataclass(frozen=True, eq=False)
class Traced:
    """Corners of cells on their way: where they meet front and rear and land, (2, nx + 1, ny + 1).

    front, rear : x and y, mm.  landing : mm, or degrees in the far field.
    passing : the fraction of their flux that arrives, (nx + 1, ny + 1); 0 where nothing does.
    """

    front: Floats
    rear: Floats
    landing: Floats
    passing: Floats


@dataclass(frozen=True, eq=False)
class FormTrace:
    """The corners of a source's cells, traced through a lens.

    system : its source has no extent.  backend : of double precision.
    """

    system: System
    cells: SourceCells
    backend: Backend

    def traced(self, front: HeightError | None = None, rear: HeightError | None = None) -> Traced:
        """Return where the corners go with height errors of front and rear."""
        dr, system, shape = self.backend.dr, self.system, (len(self.cells.s), len(self.cells.t))
        rays = self.cells.rays()
        rays = replace(rays, flux=np.ones_like(rays.flux))
        path = system.path.with_height_errors((front, rear))
        tracer = Tracer(self.backend, path, rays)
        with dr.suspend_grad():
            (at_front, at_rear), landing = tracer.trace_all()
            assert at_rear is not None
            every = dr.zeros(self.backend.Float, shape[0] * shape[1])
            met = at_rear if at_front is None else at_front  # light along z keeps x and y up to the rear
            arrives = landing.arrives
            numbers = [met.x, met.y, at_rear.x, at_rear.y, landing.x, landing.y, landing.flux]
            numbers = [dr.select(arrives, n, 0) + every for n in numbers]
            dr.eval(numbers)
        grids = np.stack([np.asarray(n.numpy(), dtype=np.float64).reshape(shape) for n in numbers])
        return Traced(grids[:2], grids[2:4], grids[4:6], grids[6])

    def irradiance(self, traced: Traced, screen: Screen, emitted: Floats | None = None) -> Floats:
        """Return the irradiance of traced cells on pixels, (rows, columns) W/mm^2.

        emitted : W, of the cells, of any sign; left out, their own.
        """
        emitted = self.cells.emitted if emitted is None else emitted
        image = np.zeros(screen.shape)
        for sign in (1, -1):
            part = np.maximum(sign * emitted, 0.0)
            if part.any():
                cells, corners = self._on_pixels(traced, screen, part)
                with self.backend.dr.suspend_grad():
                    image += sign * _picture(cells(*corners), screen)
        return image

    def irradiance_change(self, traced: Traced, screen: Screen, displacement: Floats) -> Floats:
        """Return the derivative of the irradiance as landing points move, (rows, columns) W/mm^2.

        displacement : (2, nx + 1, ny + 1), mm or degrees; what is not finite counts as 0.
        """
        dr = self.backend.dr
        cells, (x, y, passing, sound) = self._on_pixels(traced, screen, self.cells.emitted)
        dr.enable_grad(x, y)
        image = cells(x, y, passing, sound)
        for corner, move in zip((x, y), np.nan_to_num(displacement)):
            dr.set_grad(corner, self.backend.array(move.ravel()))
        return _picture(dr.forward_to(image), screen)

    def moved(self, by_s: float, by_t: float) -> FormTrace:
        """Return the trace of corners whose parameters are shifted."""
        return replace(self, cells=replace(self.cells, s=self.cells.s + by_s, t=self.cells.t + by_t))

    def _on_pixels(
        self, traced: Traced, screen: Screen, emitted: Floats
    ) -> tuple[MappedCells, tuple[DrArray, ...]]:
        """Return the map of cells to pixels, and what it is called with."""
        x, y, passing = (self.backend.array(a.ravel()) for a in (*traced.landing, traced.passing))
        every = np.ones(traced.passing.shape)
        cells = MappedCells(self.backend, screen, emitted, every, self.cells.turned)
        return cells, (x, y, passing, passing > 0)


def form_obstacle(system: System) -> str | None:
    """Return why form errors of a system are not computed, a sentence; None where they are."""
    if not (system.source.extended or system.blurred):
        return None
    return (
        "form errors are computed for sharp light, but this source is extended or its light is blurred; "
        "take a point or a parallel beam, without divergence and roughness"
    )


def form_trace(system: System, backend: Backend, counts: tuple[int, int]) -> FormTrace:
    """Return the FormTrace of (nx, ny) cells.

    The cells end at the rim of what parallel light meets, so that none is cut.  Others that a rim cuts are
    left out.

    Raises UserError : an extended source, a beam with divergence, rough surfaces.
    """
    lens = system.designed
    if obstacle := form_obstacle(system):
        raise UserError(obstacle)
    front, rear = lens.front.half_width, lens.rear.half_width
    lit = (min(front[0], rear[0]), min(front[1], rear[1])) if system.parallel else front
    return FormTrace(system, system.source.cells(counts, lit), backend)


def _picture(image: DrArray, screen: Screen) -> Floats:
    """Return the flat image of `MappedCells` as rows and columns."""
    return np.asarray(image.numpy(), dtype=np.float64).reshape(screen.shape, order="F")
