"""Verbs that curves and surfaces, polynomial and rational, share; most are linear maps along a direction.

    C' = A C along u or v,  with A of knot insertion, a piece, degree elevation or clamping.

The net C of a polynomial spline holds its coefficients, that of a rational one the homogeneous ones
(w_i P_i, w_i).  A verb takes one argument for each direction.

Source: L. Piegl and W. Tiller, The NURBS Book, chapters 4 to 6.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, replace
from typing import Any, ClassVar, Self, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from thbcad.checks import Floats, floats, read_only, require_degree, require_number, require_order
from thbcad.splines.closest_points import ClosestPoints, closest_points
from thbcad.splines.knot_removal import thinned
from thbcad.splines.knot_vector import KnotVector
from thbcad.splines.region_quadrature import area, length
from thbcad.splines.sparse_operators import apply_along
from thbcad.values import Value

Given = TypeVar("Given")
Map = tuple[KnotVector, csr_array[np.float64]]  # knots, and the operator to the coefficients on them


class AnySpline(Value, ABC):
    """A spline of points or of numbers."""

    coefficients: Floats
    rational: ClassVar[bool] = False
    _axes: ClassVar[int] = 1  # of a net of numbers

    @property
    def is_scalar(self) -> bool:
        """Whether the coefficients are numbers, not points."""
        return self.coefficients.ndim == self._axes

    @abstractmethod
    def _cells(self) -> tuple[Floats, Floats]:
        """Return the Bezier cells and their ends, as `closest_points` takes them, homogeneous if rational."""

    @abstractmethod
    def _at(self, parameters: Floats, orders: tuple[int, ...]) -> Floats:
        """Return derivatives at parameters, (n, k)."""

    def transform(self, matrix: ArrayLike, offset: ArrayLike = 0.0) -> Self:
        """Return the affine image A x + b of all points x, exactly.

        matrix : (e, d) float, so that (3, 2) puts a plane curve into space; a `Pose` has rotation and shift.
        offset : (e,) float or one number.
        """
        matrix, offset = (floats(x) for x in (matrix, offset))
        if self.is_scalar:
            raise ValueError("an affine image needs points (..., d), got scalar coefficients")
        d = self.coefficients.shape[-1]
        if matrix.ndim != 2 or matrix.shape[1] != d:
            raise ValueError(
                f"matrix must have {d} columns, one for each component of the points, got shape "
                f"{matrix.shape}"
            )
        if offset.shape not in ((), matrix.shape[:1]):
            raise ValueError(
                f"offset must be one number or have shape {matrix.shape[:1]}, got {offset.shape}"
            )
        image: Self = replace(cast(Any, self), coefficients=self.coefficients @ matrix.T + offset)
        return image

    def closest_point(self, points: ArrayLike, tolerance: float | None = None) -> ClosestPoints:
        """Return the points of the spline that are closest to given ones, (d,) or (n, d).

        tolerance : of the distances, in units of the coefficients; None is 1e-9 of their greatest extent
        """
        if self.is_scalar:
            raise ValueError("a closest point needs a spline of points, got scalar coefficients")
        nets, ends = self._cells()
        if not self.rational:
            nets = np.concatenate([nets, np.ones_like(nets[..., :1])], axis=-1)
        found = closest_points(self._at, nets, ends, np.atleast_2d(floats(points)), tolerance)
        return found if np.ndim(points) > 1 else ClosestPoints(*(rows[0] for rows in astuple(found)))


class AnySurface(AnySpline):
    """A surface S(u, v), or the graph of z(u, v)."""

    @abstractmethod
    def __call__(self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Floats:
        """Return values or derivatives at parameters that broadcast."""

    def _at(self, parameters: Floats, orders: tuple[int, ...]) -> Floats:
        return self(parameters[:, 0], parameters[:, 1], (orders[0], orders[1]))

    def normal(self, u: ArrayLike, v: ArrayLike) -> Floats:
        """Return the unit normals along S_u x S_v at parameters that broadcast, (..., 3); NaN where it is 0.

        Raises ValueError : points that do not have three components; parameters as a call refuses them.
        """
        s_u, s_v = self(u, v, (1, 0)), self(u, v, (0, 1))
        if self.is_scalar:
            normal = np.stack([-s_u, -s_v, np.ones_like(s_u)], axis=-1)
        elif s_u.shape[-1] == 3:
            normal = np.cross(s_u, s_v)
        else:
            raise ValueError(f"a normal needs points with 3 components, got {s_u.shape[-1]}")
        size = np.linalg.norm(normal, axis=-1, keepdims=True)
        unit: Floats = np.divide(normal, size, out=np.full_like(normal, np.nan), where=size > 0)
        return unit


class Spline(AnySpline):
    """A spline over one or two knot vectors."""

    @property
    @abstractmethod
    def knot_vectors(self) -> tuple[KnotVector, ...]:
        """The knots of every direction."""

    @property
    def net(self) -> Floats:
        """The coefficients on which linear maps act: those of a rational spline are (w_i P_i, w_i)."""
        return self.coefficients

    @classmethod
    def _made(cls, knot_vectors: Sequence[KnotVector], *values: Floats) -> Self:
        """Return the spline of this class with these knots and what its constructor takes after them."""
        make: Any = cls
        spline: Self = make(*knot_vectors, *values)
        return spline

    def _with(self, knot_vectors: Sequence[KnotVector], net: Floats) -> Self:
        """Return the spline of this class with other knots and net."""
        return self._made(knot_vectors, net)

    def _mapped(self, *maps: Map) -> Self:
        """Return the spline after a linear map in every direction."""
        net = self.net
        for direction, (_, operator) in enumerate(maps):
            net = apply_along(direction, operator, net)
        return self._with([kv for kv, _ in maps], net)

    def _repeated(self, step: Callable[[KnotVector], Map], counts: Sequence[int]) -> Self:
        """Return the spline after so many linear maps in every direction."""
        vectors, net = list(self.knot_vectors), self.net
        for direction, count in enumerate(counts):
            for _ in range(count):
                vectors[direction], operator = step(vectors[direction])
                net = apply_along(direction, operator, net)
        return self._with(vectors, net)

    def _each(self, arguments: Sequence[Given]) -> Iterator[tuple[KnotVector, Given]]:
        """Return the knots and the argument of every direction."""
        if len(arguments) != len(self.knot_vectors):
            raise ValueError(
                f"a direction takes one argument: {len(self.knot_vectors)}, got {len(arguments)}"
            )
        return zip(self.knot_vectors, arguments)

    def insert(self, *knots: ArrayLike) -> Self:
        """Return the same spline with knots inserted in u, or u and v; ValueError as `KnotVector.insert`."""
        rest = [()] * (len(self.knot_vectors) - len(knots))
        finer = [(kv, kv.insert(new)) for kv, new in self._each((*knots, *rest))]
        return self._mapped(*((new, kv.prolongation(new)) for kv, new in finer))

    def segment(self, *ends: tuple[float, float]) -> Self:
        """Return the piece between the ends (start, stop) of every direction; ValueError as
        `KnotVector.segment`."""
        return self._mapped(*(kv.segment(*pair) for kv, pair in self._each(ends)))

    def elevate(self, *degrees: int) -> Self:
        """Return the same spline with (at least) these degrees; ValueError above 10."""
        for degree in degrees:
            require_degree(degree)
        more = [max(degree - kv.degree, 0) for kv, degree in self._each(degrees)]
        return self._repeated(lambda kv: (kv.elevate(), kv.elevation()), more)

    def reverse(self, *directions: int) -> Self:
        """Return the spline that runs backwards, C(start + stop - u), in directions 0, 1 or both."""
        chosen = directions or (0,)
        if not set(chosen) <= set(range(len(self.knot_vectors))):
            raise ValueError(f"directions must be from 0 to {len(self.knot_vectors) - 1}, got {directions}")
        vectors = [kv.reverse() if k in chosen else kv for k, kv in enumerate(self.knot_vectors)]
        return self._with(vectors, np.flip(self.net, chosen))

    def clamp(self) -> Self:
        """Return the same spline on clamped knots, which begin and end with p + 1 equal ones."""
        if all(kv.is_clamped for kv in self.knot_vectors):
            return self
        return self._mapped(*(kv.clamp() for kv in self.knot_vectors))

    def remove_knots(self, tolerance: float) -> Self:
        """Return a spline on as few of the knots as the search finds, nowhere farther away than a tolerance.

        The distance is bounded by that of coefficients on equal knots, certified but for rounding.  Of a
        curve, no single knot more can go; of a surface, removal in u uses up to half of the tolerance.
        """
        require_number("tolerance", tolerance, least=0)
        return self._with(*thinned(self.knot_vectors, self.net, tolerance))

    def _cells(self) -> tuple[Floats, Floats]:
        net = self.net
        for direction, kv in enumerate(self.knot_vectors):
            net = apply_along(direction, kv.bezier(), net)
        (m, p), (n, q) = [*((kv.spans, kv.degree + 1) for kv in self.knot_vectors), (1, 1)][:2]
        cells = np.moveaxis(net.reshape(m, p, n, q, *net.shape[len(self.knot_vectors) :]), 2, 1)
        lines = [np.stack([kv.breaks[:-1], kv.breaks[1:]]) for kv in self.knot_vectors]
        ends = [np.stack(np.meshgrid(*side, indexing="ij"), axis=-1) for side in zip(*lines)]
        return cells.reshape(m * n, p, q, *cells.shape[4:]), np.stack(ends, axis=-2).reshape(m * n, 2, -1)


class Polynomial(Spline):
    """A spline whose derivatives are splines."""

    def derivative(self, *orders: int) -> Self:
        """Return the spline that is a derivative, of less degree; one order for each direction."""
        for _, order in self._each(orders):
            require_order(order)
        return self._repeated(KnotVector.derivative, orders)


class Curve(Spline):
    """A spline with the knots `kv`."""

    kv: KnotVector

    @abstractmethod
    def __call__(self, u: ArrayLike, derivative: int = 0) -> Floats:
        """Return values or derivatives at parameters of any shape."""

    @property
    def knot_vectors(self) -> tuple[KnotVector]:
        """The knots, in a tuple of one."""
        return (self.kv,)

    def _at(self, parameters: Floats, orders: tuple[int, ...]) -> Floats:
        return self(parameters[:, 0], orders[0])

    def arc_length(self) -> tuple[float, float]:
        """Return the length, of numbers that of the graph, and an estimate of its error.

        Gauss quadrature with p + 1 points on every span, at least 32; the estimate is the change from p.
        """
        return length(lambda u: self(u, 1), self.kv)


class Surface(Spline, AnySurface):
    """A spline with the knots `kv_u` and `kv_v`."""

    kv_u: KnotVector
    kv_v: KnotVector
    _axes: ClassVar[int] = 2

    @abstractmethod
    def grid(self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Floats:
        """Return values or derivatives on the grid u x v."""

    @property
    def knot_vectors(self) -> tuple[KnotVector, KnotVector]:
        """The knots in u and in v."""
        return self.kv_u, self.kv_v

    def on_domain(self, u: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Return parameters, those that rounding put beside the domain moved onto its rim."""
        return np.clip(u, *self.kv_u.domain), np.clip(v, *self.kv_v.domain)

    def area(self) -> tuple[float, float]:
        """Return the area, of numbers that of the graph, and an estimate of its error, as `arc_length`."""
        return area(self.grid, self.kv_u, self.kv_v)


def checked_net(coefficients: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Return the coefficients of a polynomial spline, of a shape or (*shape, d), as a read-only array."""
    c = read_only(coefficients)
    if c.shape[: len(shape)] != shape or c.ndim > len(shape) + 1 or c.size == 0:
        raise ValueError(f"coefficients must have shape {shape} or {(*shape, 'd')}, got {c.shape}")
    if not np.isfinite(c).all():
        raise ValueError("coefficients must be finite")
    return c
