"""Rays through a lens with height errors: met where the surface with its error lies, never refitted.

A ray meets z + dh where the ray that is lowered by dh meets z.  The height dh is that at the meeting point,
which moves by dh times the tangent of the ray's angle: it is looked for in ROUNDS steps, each of which leaves
the product of that tangent and the error's slope of the error before it.  Light along z keeps its point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import isinf
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.runtime import UserError
from optics.sources import RayGrid, single_rays
from optics.target import MappedCells
from optics.tracing import KnownHits, SearchedHits, refract

if TYPE_CHECKING:
    from optics.form_errors.height_errors import HeightError
    from optics.runtime import Backend, DrArray
    from optics.sources import SourceCells
    from optics.system import OpticalSystem
    from optics.target import Screen
    from thbcad.lens import FreeformSurface, Lens
    from thbcad.splines import KnotVector

Floats = NDArray[np.float64]
Vector = tuple["DrArray", "DrArray", "DrArray"]

ROUNDS = 2  # 1e-3 of slopes, twice: 1e-6 of the error


@dataclass(frozen=True, eq=False)
class Constant:
    """A height and slopes that are the same everywhere: by which landing points are differentiated."""

    values: tuple[float, float, float]

    def jet(self, x: Floats, y: Floats) -> Floats:
        """Return the values, (3, n)."""
        return np.repeat(np.reshape(self.values, (3, 1)), len(x), axis=1)


@dataclass(frozen=True, eq=False)
class Traced:
    """Corners of cells on their way: where they meet front and rear and land, (2, nx + 1, ny + 1).

    front, rear : x and y, mm.  landing : mm, or degrees in the far field.  passing : the fraction of their
    flux that arrives, (nx + 1, ny + 1); 0 where nothing does.
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

    system: OpticalSystem
    lens: Lens
    cells: SourceCells
    backend: Backend

    def traced(self, front: HeightError | None = None, rear: HeightError | None = None) -> Traced:
        """Return where the corners go with height errors of front and rear."""
        dr, backend = self.backend.dr, self.backend
        with dr.suspend_grad():
            at_front, behind, entering = self._through_front(front)
            parallel = self._parallel and front is None
            hits = self._known_rear(rear) if parallel else self._met(1, *behind, rear)
            x, y, z, zx, zy, hit = hits
            (dx, dy, dz), share, passes = refract(dr, behind[1], (zx, zy), backend.Float(self.lens.index))
            arrives = hit & passes & (dz > 0)
            dz = dr.select(arrives, dz, 1)
            path = (z - behind[0][2]) / behind[1][2]
            left = dr.exp(-self.system.absorption * dr.select(arrives, path, 0))
            landing = self._landing(x, y, z, dx / dz, dy / dz)
            passing = dr.select(arrives, entering * share * left, 0)
        return Traced(
            self._grids(*at_front), self._grids(x, y), self._grids(*landing), self._grids(passing)[0]
        )

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

    def _on_pixels(
        self, traced: Traced, screen: Screen, emitted: Floats
    ) -> tuple[MappedCells, tuple[DrArray, ...]]:
        """Return the map of cells to pixels, and what it is called with."""
        x, y, passing = (self.backend.array(a.ravel()) for a in (*traced.landing, traced.passing))
        cells = MappedCells(self.backend, screen, emitted, np.ones(traced.passing.shape))
        return cells, (x, y, passing, passing > 0)

    def moved(self, by_s: float, by_t: float) -> FormTrace:
        """Return the trace of corners whose parameters are shifted."""
        return replace(self, cells=replace(self.cells, s=self.cells.s + by_s, t=self.cells.t + by_t))

    @property
    def _shape(self) -> tuple[int, int]:
        return len(self.cells.s), len(self.cells.t)

    @property
    def _parallel(self) -> bool:
        """Whether light is parallel to z up to a rear that carries a sag."""
        return self.cells.parallel and self.lens.front.is_plane and self.lens.rear.sag is not None

    @cached_property
    def _rays(self) -> tuple[Vector, Vector]:
        """Origins and directions of all corners on the device."""
        rays = single_rays(self.cells.rays(), self.lens)
        origin, direction = (
            tuple(self.backend.array(row) for row in v) for v in (rays.origin, rays.direction)
        )
        return origin, direction

    def _through_front(
        self, error: HeightError | None
    ) -> tuple[tuple[DrArray, DrArray], tuple[Vector, Vector], DrArray]:
        """Return x and y at the front, the rays behind it in the rear's frame, and what passes of them."""
        Float = self.backend.Float
        if self._parallel and error is None:
            x, y = (
                self.backend.array(a.ravel()) for a in np.meshgrid(self.cells.s, self.cells.t, indexing="ij")
            )
            direction, share, _ = refract(
                self.backend.dr,
                (Float(0), Float(0), Float(1)),
                (Float(0), Float(0)),
                Float(1 / self.lens.index),
            )
            return (x, y), ((x, y, Float(-self.lens.thickness)), direction), share
        origin, direction = self._rays
        x, y, z, zx, zy, hit = self._met(0, origin, direction, error)
        direction, share, passes = refract(self.backend.dr, direction, (zx, zy), Float(1 / self.lens.index))
        share = self.backend.dr.select(hit & passes, share, 0)
        return (x, y), ((x, y, z - self.lens.thickness), direction), share

    def _known_rear(self, error: HeightError | None) -> tuple[DrArray, ...]:
        """Return what `_met` does of light along z."""
        rear, rays = self.lens.rear, self.cells.rays()
        if not isinstance(rays, RayGrid):
            raise TypeError("parallel light must be a grid of rays")
        knots, net = _knots(rear), _net(rear)
        if knots is None or net is None:
            raise ValueError("a rear without a sag has no net")
        hits = KnownHits(self.backend, rays, rear.conic, rear.half_width, knots).meet(net)
        return self._added((hits.x, hits.y, hits.z, hits.zx, hits.zy, hits.hit), error)

    def _met(
        self, side: int, origin: Vector, direction: Vector, error: HeightError | None
    ) -> tuple[DrArray, ...]:
        """Return x, y, z, both slopes and the mask of rays where they meet a surface with its error."""
        surface = (self.lens.front, self.lens.rear)[side]
        search = SearchedHits(self.backend, surface.conic, surface.half_width, _knots(surface), sure=False)
        net, (ox, oy, oz) = _net(surface), origin
        hits = search.meet(origin, direction, net)
        if error is not None:
            for _ in range(ROUNDS):
                x, y = (self._numbers(a) for a in (hits.x, hits.y))
                lowered = oz - self.backend.array(error.jet(x, y)[0])
                hits = search.meet((ox, oy, lowered), direction, net)
        return self._added((hits.x, hits.y, hits.z, hits.zx, hits.zy, hits.hit), error)

    def _added(self, hits: tuple[DrArray, ...], error: HeightError | None) -> tuple[DrArray, ...]:
        """Return meeting points with the error's height and slopes added."""
        if error is None:
            return hits
        x, y, z, zx, zy, hit = hits
        dh, by_x, by_y = (self.backend.array(a) for a in error.jet(self._numbers(x), self._numbers(y)))
        return x, y, z + dh, zx + by_x, zy + by_y, hit

    def _landing(
        self, x: DrArray, y: DrArray, z: DrArray, tx: DrArray, ty: DrArray
    ) -> tuple[DrArray, DrArray]:
        """Return where light lands that leaves (x, y, z) with the tangents tx and ty."""
        dr, target = self.backend.dr, self.system.target.z
        if isinf(target):
            return 180 / np.pi * dr.atan(tx), 180 / np.pi * dr.atan(ty)
        down = (target - self.lens.thickness) - z
        return x + down * tx, y + down * ty

    def _numbers(self, values: DrArray) -> Floats:
        every = values + self.backend.dr.zeros(self.backend.Float, self._shape[0] * self._shape[1])
        return np.asarray(every.numpy(), dtype=np.float64)

    def _grids(self, *values: DrArray) -> Floats:
        return np.stack([self._numbers(v).reshape(self._shape) for v in values])


def form_trace(system: OpticalSystem, lens: Lens, backend: Backend, counts: tuple[int, int]) -> FormTrace:
    """Return the FormTrace of (nx, ny) cells.

    The cells end at the rim of what parallel light meets, so that none is cut.

    Raises
    ------
    UserError : an extended source, or a beam with divergence.
    """
    if system.source.extended or system.blurred:
        raise UserError(
            "form errors are computed for sharp light, but this source is extended or its light is blurred; "
            "take a point or a parallel beam, without divergence and roughness"
        )
    front, rear = lens.front.half_width, lens.rear.half_width
    lit = (min(front[0], rear[0]), min(front[1], rear[1])) if system.path.parallel else front
    return FormTrace(system, lens, system.source.cells(counts, lit), backend)


def _knots(surface: FreeformSurface) -> tuple[KnotVector, KnotVector] | None:
    """Return the knots in mm of a sag's tensor-product form."""
    if surface.sag is None:
        return None
    embedding, (hx, hy) = surface.sag.space.embedding, surface.half_width
    return embedding.kv_u.rescaled(-hx, hx), embedding.kv_v.rescaled(-hy, hy)


def _net(surface: FreeformSurface) -> Floats | None:
    """Return the net of a sag's tensor-product form."""
    return None if surface.sag is None else surface.sag.space.embedding.coefficients(surface.sag.coefficients)


def _picture(image: DrArray, screen: Screen) -> Floats:
    """Return the flat image of `MappedCells` as rows and columns."""
    return np.asarray(image.numpy(), dtype=np.float64).reshape(screen.shape, order="F")
