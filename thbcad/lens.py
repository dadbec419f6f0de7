"""Freeform surfaces (conic + spline sag) and the closed six-surface lens.

A surface is the graph z(x, y) = conic(x, y) + sag(x, y) over |x| <= half_width[0],
|y| <= half_width[1]; z = 0 is the vertex of the conic and positive radii open to +z.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thbcad.bspline import KnotVector
from thbcad.graph import conic_graph, rescaled, volume_between
from thbcad.surface import BSplineSurface, THBSurface

Coordinate = TypeVar("Coordinate", float, NDArray[np.float64])


@dataclass(frozen=True)
class Conic:
    """The conic z = c r^2 / (1 + sqrt(1 - (1 + K) c^2 r^2)), c = 1 / radius (thesis 3.2).

    radius : float, mm; inf is a plane.  constant : float, K = -1 is a paraboloid.
    """

    radius: float = np.inf
    constant: float = 0.0

    def __post_init__(self) -> None:
        if np.isnan(self.radius) or self.radius == 0:
            raise ValueError(f"radius must be a number other than 0, got {self.radius}")
        if not np.isfinite(self.constant):
            raise ValueError(f"conic constant must be finite, got {self.constant}")

    @property
    def is_plane(self) -> bool:
        return np.isinf(self.radius)

    @property
    def is_paraboloid(self) -> bool:
        """True where the conic is a polynomial of degree 2: planes and K = -1."""
        return self.is_plane or self.constant == -1.0

    def require(self, half_width: tuple[float, float]) -> None:
        """Raise ValueError unless the conic is defined on the whole rectangle."""
        reach = np.hypot(*half_width)
        if not self.is_plane and (1 + self.constant) * (reach / self.radius) ** 2 >= 1:
            limit = abs(self.radius) / np.sqrt(1 + self.constant)
            raise ValueError(
                f"the conic (radius {self.radius}, K {self.constant}) ends at r = {limit:.6g} mm, "
                f"but the corner of the aperture lies at r = {reach:.6g} mm"
            )

    def __call__(self, x: Coordinate, y: Coordinate, derivative: tuple[int, int] = (0, 0)) -> Coordinate:
        """Return z or, for derivative (1, 0) or (0, 1), its slope in x or y."""
        c = 1.0 / self.radius
        r2 = x * x + y * y
        root = np.sqrt(1 - (1 + self.constant) * c * c * r2)
        if derivative == (0, 0):
            return c * r2 / (1 + root)
        if derivative == (1, 0):
            return c * x / root + 0 * y
        if derivative == (0, 1):
            return c * y / root + 0 * x
        raise ValueError(f"conics have derivatives (0, 0), (1, 0) and (0, 1), got {derivative}")


@dataclass(frozen=True, eq=False)
class FreeformSurface:
    """The graph z(x, y) = conic + sag on a rectangle.

    half_width : (hx, hy) float, mm
    conic : Conic
    sag : THBSurface or None, scalar coefficients in mm; its parameter domain is mapped
        linearly onto the rectangle
    """

    half_width: tuple[float, float]
    conic: Conic = Conic()
    sag: THBSurface | None = None

    def __post_init__(self) -> None:
        h = tuple(float(w) for w in self.half_width)
        if len(h) != 2 or not all(np.isfinite(w) and w > 0 for w in h):
            raise ValueError(f"half_width must be two positive numbers, got {self.half_width}")
        if self.sag is not None and self.sag.coefficients.ndim != 1:
            raise ValueError("the sag must have scalar coefficients")
        object.__setattr__(self, "half_width", h)
        self.conic.require(h)

    def __call__(self, x: ArrayLike, y: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> NDArray[np.float64]:
        """Return z or a first derivative at scattered points, (n,)."""
        x, y = (np.atleast_1d(np.asarray(a, dtype=np.float64)) for a in (x, y))
        z = self.conic(x, y, derivative)
        if self.sag is not None:
            u, v = self.to_parameters(x, y)
            z = z + self.sag(u, v, derivative) * self._chain(derivative)
        return z

    def grid(self, x: ArrayLike, y: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> NDArray[np.float64]:
        """Return z or a first derivative on the grid x x y, (len(x), len(y))."""
        x, y = (np.atleast_1d(np.asarray(a, dtype=np.float64)) for a in (x, y))
        z = self.conic(x[:, None], y[None, :], derivative)
        if self.sag is not None:
            u, v = self.to_parameters(x, y)
            z = z + self.sag.grid(u, v, derivative) * self._chain(derivative)
        return z

    def with_coefficients(self, coefficients: NDArray[np.float64]) -> FreeformSurface:
        """Return the surface with other sag coefficients on the same space."""
        return FreeformSurface(self.half_width, self.conic, THBSurface(self.sag.space, coefficients))

    def to_parameters(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the spline parameters (u, v) of positions (x, y)."""
        space = self.sag.space
        return tuple(
            np.clip(kv.start + (a + h) * s, kv.start, kv.stop)
            for a, h, s, kv in zip((x, y), self.half_width, self._scale(), (space.kv_u, space.kv_v))
        )

    def graph(self, degree: int = 3) -> BSplineSurface:
        """Return the exact surface as a scalar BSplineSurface z(x, y) on x, y in mm.

        degree : of a surface without sag; with one, the sag's degree and needed knots are used.
        Paraboloids and planes are exact, other conics are interpolated to 1e-11 mm.
        """
        if self.sag is None:
            kv_x, kv_y = (KnotVector.uniform(degree, 1, -h, h) for h in self.half_width)
            return conic_graph(self.conic, kv_x, kv_y)
        sag = self.sag.to_bspline()
        kv_x, kv_y = (rescaled(kv, h) for kv, h in zip((sag.kv_u, sag.kv_v), self.half_width))
        return conic_graph(self.conic, kv_x, kv_y, sag.coefficients)

    def _scale(self) -> tuple[float, float]:
        space = self.sag.space
        return tuple((kv.stop - kv.start) / (2 * h) for kv, h in zip((space.kv_u, space.kv_v), self.half_width))

    def _chain(self, derivative: tuple[int, int]) -> float:
        su, sv = self._scale()
        return su ** derivative[0] * sv ** derivative[1]


@dataclass(frozen=True, eq=False)
class Lens:
    """A closed lens: front at z = 0, rear at z = thickness, four ruled edges between the rims.

    Raises
    ------
    ValueError : index at most 1 or not finite, thickness not positive, surfaces that touch or
        cross (with the place and the amount).
    """

    front: FreeformSurface
    rear: FreeformSurface
    thickness: float
    index: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.index) and self.index > 1):
            raise ValueError(f"index must be a number greater than 1, got {self.index}")
        if not (np.isfinite(self.thickness) and self.thickness > 0):
            raise ValueError(f"thickness must be a positive number of mm, got {self.thickness}")
        least, (x, y) = self.least_thickness()
        if least <= 0:
            raise ValueError(
                f"the surfaces cross: at x = {x:.6g}, y = {y:.6g} mm the rear lies {-least:.6g} mm before the front; "
                f"raise lens.thickness by more than {-least:.6g} mm or change the radii"
            )

    def least_thickness(self) -> tuple[float, tuple[float, float]]:
        """Return (mm, (x, y)): the least distance in z, sampled four times per knot span.

        Surfaces of different size are compared between points of equal relative position, as
        the ruled edges join them.
        """
        samples = [_samples(graph) for graph in self.graphs()]
        s, t = (np.union1d(a, b) for a, b in zip(*samples))
        front, rear = (f.grid(s * f.half_width[0], t * f.half_width[1]) for f in (self.front, self.rear))
        gap = self.thickness + rear - front
        i, j = np.unravel_index(np.argmin(gap), gap.shape)
        return float(gap[i, j]), (float(s[i] * self.rear.half_width[0]), float(t[j] * self.rear.half_width[1]))

    def graphs(self) -> tuple[BSplineSurface, BSplineSurface]:
        """Return front and rear as exact scalar BSplineSurfaces of one degree."""
        sags = [f.sag.space.kv_u.degree for f in (self.front, self.rear) if f.sag is not None]
        degree = max(sags, default=3)
        return self.front.graph(degree), self.rear.graph(degree)

    def volume(self) -> float:
        """Return the volume in mm^3, by Gauss quadrature that is exact for the splines."""
        return volume_between(*self.graphs(), self.thickness)

    def with_rear(self, rear: FreeformSurface) -> Lens:
        """Return the lens with another rear surface."""
        return Lens(self.front, rear, self.thickness, self.index)


def _samples(graph: BSplineSurface) -> list[NDArray[np.float64]]:
    """Return relative positions in x and y, four per knot span, both ends included."""
    rows = []
    for kv in (graph.kv_u, graph.kv_v):
        b = kv.breaks / kv.stop
        rows.append(np.unique(np.concatenate([b[:-1] + f * np.diff(b) for f in (0, 0.25, 0.5, 0.75)] + [b[-1:]])))
    return rows
