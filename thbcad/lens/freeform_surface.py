"""Freeform surfaces (conic + spline sag) and the closed six-surface lens.

A surface is the graph z(x, y) = conic(x, y) + sag(x, y) over |x| <= half_width[0],
|y| <= half_width[1]; z = 0 is the vertex of the conic and positive radii open to +z.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thbcad.certified import Enclosure, minimum
from thbcad.checks import half_widths, require_number, require_orders, require_type
from thbcad.lens.edge_proof import require_simple_edges
from thbcad.sags import Conic, conic_graph, gap_graph, volume_between
from thbcad.splines import BSplineSurface, KnotVector
from thbcad.surfaces import THBSurface

RIM = 1e-12  # of the half-width: rounding of positions on the rim


@dataclass(frozen=True, eq=False)
class FreeformSurface:
    """The graph z(x, y) = conic + sag on a rectangle.

    half_width : (hx, hy) float, mm
    conic : Conic
    sag : THBSurface or None, scalar coefficients in mm; its parameter domain is mapped
        linearly onto the rectangle

    Raises
    ------
    ValueError : half-widths that are not positive, a sag that is not scalar, a conic that ends within the
        rectangle.
    """

    half_width: tuple[float, float]
    conic: Conic = Conic()
    sag: THBSurface | None = None

    def __post_init__(self) -> None:
        h = half_widths(self.half_width)
        require_type("conic", self.conic, Conic)
        require_type("sag", self.sag, THBSurface, type(None))
        if self.sag is not None and self.sag.coefficients.ndim != 1:
            raise ValueError("the sag must have scalar coefficients")
        object.__setattr__(self, "half_width", h)
        self.conic.require(h)

    @property
    def is_plane(self) -> bool:
        """Whether it is the plane z = 0: without sag, over a plane conic."""
        return self.sag is None and self.conic.is_plane

    def __call__(
        self, x: ArrayLike, y: ArrayLike, derivative: tuple[int, int] = (0, 0)
    ) -> NDArray[np.float64]:
        """Return z or a partial derivative at scattered points, (n,).

        Raises
        ------
        ValueError : points outside the rectangle or NaN, an order that is not a non-negative integer.
        """
        x, y = self._inside(x, y)
        derivative = require_orders(derivative)
        z = self.conic(x, y, derivative)
        if self.sag is not None:
            u, v = self.to_parameters(x, y)
            z = z + self.sag(u, v, derivative) * self._chain(derivative)
        return z

    def grid(self, x: ArrayLike, y: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> NDArray[np.float64]:
        """Return z or a partial derivative on the grid x x y, (len(x), len(y)).

        Raises
        ------
        ValueError : positions outside the rectangle or NaN, an order that is not a non-negative integer.
        """
        x, y = self._inside(x, y)
        derivative = require_orders(derivative)
        z = self.conic(x[:, None], y[None, :], derivative)
        if self.sag is not None:
            u, v = self.to_parameters(x, y)
            z = z + self.sag.grid(u, v, derivative) * self._chain(derivative)
        return z

    def with_sag(self, sag: THBSurface) -> FreeformSurface:
        """Return the surface with another sag on the same conic."""
        return FreeformSurface(self.half_width, self.conic, sag)

    def _inside(self, x: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return positions as rows, on the rim those that rounding put beside it; refuse others."""
        rows = []
        for name, a, h in zip("xy", (x, y), self.half_width):
            a = np.atleast_1d(np.asarray(a, dtype=np.float64))
            bad = ~(np.abs(a) <= h * (1 + RIM))
            if bad.any():
                raise ValueError(
                    f"{name} = {a[bad].flat[0]} mm lies outside the surface, whose half-width is {h} mm"
                )
            rows.append(np.clip(a, -h, h))
        return rows[0], rows[1]

    def to_parameters(
        self, x: NDArray[np.float64], y: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the spline parameters (u, v) of positions (x, y).

        Raises
        ------
        ValueError : a surface without sag.
        """
        if self.sag is None:
            raise ValueError("a surface without sag has no spline parameters")
        space = self.sag.space
        return tuple(
            np.clip(kv.start + (a + h) * s, kv.start, kv.stop)
            for a, h, s, kv in zip((x, y), self.half_width, self._scale(), (space.kv_u, space.kv_v))
        )

    def graph(self, degrees: tuple[int, int] = (3, 3)) -> BSplineSurface:
        """Return the surface as a scalar BSplineSurface z(x, y) on x, y in mm.

        degrees : in x and y, of a surface without sag; with one, the sag's degree and needed knots are used.
        Paraboloids, planes and sags are exact but for rounding, other conics are within a proven 1e-11 mm.
        """
        if self.sag is None:
            kv_x, kv_y = (KnotVector.uniform(p, 1, -h, h) for p, h in zip(degrees, self.half_width))
            return conic_graph(self.conic, kv_x, kv_y)
        sag = self.sag.to_bspline()
        kv_x, kv_y = (kv.rescaled(-h, h) for kv, h in zip((sag.kv_u, sag.kv_v), self.half_width))
        return conic_graph(self.conic, kv_x, kv_y, sag.coefficients)

    def _scale(self) -> tuple[float, float]:
        space = self.sag.space
        return tuple(
            (kv.stop - kv.start) / (2 * h) for kv, h in zip((space.kv_u, space.kv_v), self.half_width)
        )

    def _chain(self, derivative: tuple[int, int]) -> float:
        su, sv = self._scale()
        return su ** derivative[0] * sv ** derivative[1]


@dataclass(frozen=True, eq=False)
class Lens:
    """A closed lens: front at z = 0, rear at z = thickness, four ruled edges between the rims.

    Raises
    ------
    ValueError : index at most 1 or not finite, thickness not positive, surfaces that touch or
        cross, or ruled edges that cross a surface or each other (with the place and the amount).
    """

    front: FreeformSurface
    rear: FreeformSurface
    thickness: float
    index: float

    def __post_init__(self) -> None:
        for name in ("front", "rear"):
            require_type(name, getattr(self, name), FreeformSurface)
        for name, above in (("thickness", 0), ("index", 1)):
            require_number(name, getattr(self, name), above=above, finite=True)
            object.__setattr__(self, name, float(getattr(self, name)))
        least = self.least_thickness()
        if least.lower <= 0:
            raise ValueError(self._touching(least))
        require_simple_edges(self.graphs(), self.thickness, least.lower)

    def _touching(self, least: Enclosure) -> str:
        """Return what is wrong with surfaces of no thickness, and where."""
        amount = abs(min(least.value, 0.0))
        ends = zip((least.u, least.v), self.rear.half_width, "xy")
        rims = " and ".join(f"{'-+'[end > 0]}{axis}" for end, half, axis in ends if abs(end) == half)
        remedy = f"raise lens.thickness by more than {amount:.6g} mm or change the radii"
        if rims and not amount:
            return (
                f"the rims touch: at x = {least.u:.6g}, y = {least.v:.6g} mm the lens has no thickness "
                f"at its edges {rims}; {remedy}"
            )
        return (
            f"the surfaces {'cross' if amount else 'touch'}: at x = {least.u:.6g}, y = {least.v:.6g} mm"
            f" the rear lies {amount:.6g} mm before the front{f', at the edges {rims}' if rims else ''}; "
            f"{remedy}"
        )

    def least_thickness(self) -> Enclosure:
        """Return certified bounds of the least distance in z, mm, and its place on the rear.

        Surfaces of different size are compared between points of equal relative position, as
        the ruled edges join them.
        """
        return minimum(gap_graph(*self.graphs(), self.thickness), tolerance=1e-12)

    def graphs(self) -> tuple[BSplineSurface, BSplineSurface]:
        """Return front and rear as scalar BSplineSurfaces of the same degrees (elevated where needed).

        Paraboloids, planes and sags are exact but for rounding, other conics are within a proven 1e-11 mm.

        Raises
        ------
        ValueError : degree 1, or a conic that needs more than 2000 control points per direction.
        """
        return self._graphs

    @cached_property
    def _graphs(self) -> tuple[BSplineSurface, BSplineSurface]:
        spaces = [f.sag.space for f in (self.front, self.rear) if f.sag is not None]
        default = (
            3 if all(f.conic.is_paraboloid for f in (self.front, self.rear)) else 5
        )  # other conics need fewer knots then
        common = tuple(
            max((kv.degree for kv in row), default=default)
            for row in ([s.kv_u for s in spaces], [s.kv_v for s in spaces])
        )
        graphs = self.front.graph(common), self.rear.graph(common)
        return graphs[0].elevated(common), graphs[1].elevated(common)

    def volume(self) -> float:
        """Return the volume in mm^3, by Gauss quadrature that is exact for the splines."""
        return volume_between(*self.graphs(), self.thickness)

    def with_rear(self, rear: FreeformSurface) -> Lens:
        """Return the lens with another rear surface."""
        return Lens(self.front, rear, self.thickness, self.index)

    @property
    def sags(self) -> tuple[THBSurface, ...]:
        """The sags of the surfaces that have one, front first."""
        return tuple(s.sag for s in (self.front, self.rear) if s.sag is not None)

    def with_sags(self, sags: Sequence[THBSurface]) -> Lens:
        """Return the lens with other sags on the surfaces that have one, front first.

        Raises
        ------
        ValueError : too few or too many sags, or surfaces that touch or cross then.
        """
        if len(sags) != len(self.sags):
            raise ValueError(f"sags must be {len(self.sags)} surfaces, got {len(sags)}")
        rest = iter(sags)
        front, rear = (s if s.sag is None else s.with_sag(next(rest)) for s in (self.front, self.rear))
        return Lens(front, rear, self.thickness, self.index)
