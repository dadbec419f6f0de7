"""Certified bounds of a graph z(x, y) and its derivatives from Bernstein coefficients.

On a cell a vector of polynomials is a convex combination of its Bernstein coefficients.  A convex
function of the vector is therefore nowhere greater than its greatest value at the coefficients,
and at the four corners it takes its value there.  Both bounds meet with the square of the cell
size: branch and bound drops the cells that cannot hold the greatest value and quarters the others.

The bounds hold in floating point: what rounding does to the coefficients comes with them, see
`bernstein_cells`.

Source: G. Farin, Curves and Surfaces for CAGD, chapters 5 and 14.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from thbcad.certified.bernstein_cells import Graph, Orders, bernstein, cell_bounds
from thbcad.certified.parts_inside import Region
from thbcad.certified.polynomial_cells import Cells, confined, within
from thbcad.checks import Floats, require_number
from thbcad.outlines import Outline
from thbcad.splines import BSplineSurface

MOST_COEFFICIENTS = 2**25  # 256 MiB; about a second of work
MOST_STEPS = 50  # then a cell is as small as the spacing of the numbers
AT_RIM = 1e-7  # least tolerance over an outline: a sphere reaches its greatest height on all of its rim

Best = tuple[float, float, float, float]


@dataclass(frozen=True)
class Enclosure:
    """lower <= true extreme value <= upper; `value` is the greatest or least value met, taken at (u, v).

    On the rim of an outline with corners that are cut off, points are taken just inside.
    Where a derivative jumps, `value` is that of one of the cells that meet at (u, v).

    >>> sag = FreeformSurface((5.0, 5.0), Conic(50.0, -1.0)).graph()
    >>> least, most = value_range(sag)
    >>> (most.lower <= 0.5 <= most.upper, most.upper - most.lower < 1e-9, abs(most.u), abs(most.v))
    (True, True, 5.0, 5.0)
    """

    lower: float
    upper: float
    value: float
    u: float
    v: float


@dataclass(frozen=True, eq=False)
class Assessment:
    """What is known of a function on n cells.

    corners : (4, n) float, values at the corners (0, 0), (0, 1), (1, 0), (1, 1)
    error : float, the rounding error of these values is at most this
    upper : (n,) float, the function is at most this on the cells, rounding included
    scale : float, what a relative tolerance refers to
    """

    corners: Floats
    error: float
    upper: Floats
    scale: float


def minimum(
    graph: Graph, derivative: Orders = (0, 0), tolerance: float = 1e-9, outline: Outline | None = None
) -> Enclosure:
    """Return certified bounds of the least value of d^(a+b) z / dx^a dy^b.

    graph : a scalar BSplineSurface or THBSurface, or patches of one surface
    derivative : (a, b)
    outline : Outline or None, only points inside count; None is the whole graph

    The search ends when the bounds differ by `tolerance` times the greatest coefficient, over an outline that
    is no rectangle by 1e-7 times at least.  Where the least value is taken along a whole curve it can end
    earlier, with wider bounds that hold too.

    Raises ValueError : a graph that is not scalar, a negative order, derivatives above 1e40.
    """
    cells = within(bernstein(graph, (derivative,)), outline)
    return _least(cells, tolerance)


def minimum_on_rim(graph: BSplineSurface, outline: Outline, tolerance: float = 1e-9) -> Enclosure:
    """Return certified bounds of the least value of z on the rim of the corners of an outline that is no
    rectangle.

    The search ends as in `minimum`.

    Raises ValueError : as `minimum`.
    """
    region = Region(outline, rim=True)
    steepest = cell_bounds(graph, ((1, 0), (0, 1))).max(axis=(1, 2))
    slip = float(steepest @ outline.corners) * 4 * region.slack  # values are met this near to the rim
    return _least(confined(bernstein(graph, ((0, 0),)), region, slip), tolerance)


def value_range(
    graph: Graph, derivative: Orders = (0, 0), tolerance: float = 1e-9, outline: Outline | None = None
) -> tuple[Enclosure, Enclosure]:
    """Return certified bounds of the least and of the greatest value of d^(a+b) z / dx^a dy^b.

    The search ends as in `minimum`.  A derivative that jumps at a knot counts with both its values.

    Raises ValueError : a graph that is not scalar, a negative order, derivatives above 1e40.
    """
    least, most = both_ends(within(bernstein(graph, (derivative,)), outline), _value, tolerance)
    return _turned(least), most


def greatest(
    pieces: Iterable[Cells], assess: Callable[[Cells, float], Assessment], tolerance: float
) -> Enclosure:
    """Return bounds of the greatest value of a function of the vectors, by branch and bound.

    assess : (cells, best value so far) -> Assessment

    The bounds differ by at most tolerance * scale, of at least 1e-7 where cells have a region, and some
    rounding, unless that needs more than 2^25 coefficients besides those given.
    """
    search = _Search(assess, tolerance)
    for cells in pieces:
        search.add(cells)
    return search.found()


def both_ends(
    pieces: Iterable[Cells], assess: Callable[[Cells, float], Assessment], tolerance: float
) -> tuple[Enclosure, Enclosure]:
    """Return `greatest` of the negated vectors and of the vectors, whose cells are made once."""
    turned, plain = _Search(assess, tolerance), _Search(assess, tolerance)
    for cells in pieces:
        turned.add(cells.negated())
        plain.add(cells)
    return turned.found(), plain.found()


class _Search:
    """The search for the greatest value: the cells that may hold it, of those that were added."""

    def __init__(self, assess: Callable[[Cells, float], Assessment], tolerance: float) -> None:
        require_number("tolerance", tolerance, least=0)
        self._assess, self._tolerance = assess, tolerance
        self._best: Best = (-np.inf, -np.inf, 0.0, 0.0)
        self._closed = self._least = -np.inf
        self._kept: list[tuple[Cells, Floats]] = []

    def add(self, piece: Cells) -> None:
        """Look at cells, and keep those that may hold a greater value than is met."""
        cells = piece.inside()
        if not cells.box.size:
            return
        assessment = self._assess(cells, self._best[0])
        near = self._tolerance if cells.region is None else max(self._tolerance, AT_RIM)
        self._best = _better(self._best, cells, assessment)
        self._least = max(self._least, self._best[0] + near * assessment.scale + 2 * assessment.error)
        chosen = assessment.upper > self._least
        self._close(assessment.upper[~chosen])
        self._kept.append((cells.take(chosen), assessment.upper[chosen]))

    def found(self) -> Enclosure:
        """Quarter the cells that are left until the bounds are near, and return them."""
        work, left = 0, self._left()
        for _ in range(MOST_STEPS - 1):
            work += 4 * (0 if left is None else left.coefficients.size)
            if left is None or work > MOST_COEFFICIENTS:
                break
            self._kept, self._least = [], -np.inf
            self.add(left.quartered())
            left = self._left()
        value, lower, u, v = self._best
        upper = max((float(upper.max(initial=value)) for _, upper in self._kept), default=value)
        return Enclosure(lower, max(self._closed, upper), value, u, v)

    def _left(self) -> Cells | None:
        """Return the cells that may still hold a greater value, if any."""
        if not self._kept:
            return None
        coefficients, box = (
            np.concatenate([getattr(cells, name) for cells, _ in self._kept], axis=-1)
            for name in ("coefficients", "box")
        )
        cells = replace(self._kept[0][0], coefficients=coefficients, box=box)
        upper = np.concatenate([upper for _, upper in self._kept])
        chosen = upper > self._least
        self._close(upper[~chosen])
        self._kept = [(cells.take(chosen), upper[chosen])]
        return self._kept[0][0] if chosen.any() else None

    def _close(self, upper: Floats) -> None:
        self._closed = max(self._closed, float(upper.max(initial=-np.inf)))


def _least(pieces: Iterable[Cells], tolerance: float) -> Enclosure:
    return _turned(greatest((cells.negated() for cells in pieces), _value, tolerance))


def _turned(found: Enclosure) -> Enclosure:
    """Return the enclosure of -x from that of x."""
    # 0.0 - x is never -0.0
    return replace(found, lower=0.0 - found.upper, upper=0.0 - found.lower, value=0.0 - found.value)


def _value(cells: Cells, best: float) -> Assessment:
    (values,), counts = cells.met()
    error = float(cells.error[0])
    return Assessment(
        np.where(counts, values, -np.inf),
        error,
        cells.most(cells.coefficients[0]) + error,
        float(cells.magnitude[0]),
    )


def _better(best: Best, cells: Cells, assessment: Assessment) -> Best:
    """Return (value, lower bound of the value, u, v) of the best corner, or what is better."""
    corner, k = np.unravel_index(int(np.argmax(assessment.corners)), assessment.corners.shape)
    value = float(assessment.corners[corner, k])
    if value < best[0]:
        return best
    return max(best, (value, value - assessment.error, *cells.position(int(corner), int(k))))


def reciprocal(found: Enclosure) -> Enclosure:
    """Return the enclosure of 1 / k from that of k, infinite for k <= 0; the quotients round once."""
    lower, upper, value = (1 / k if k > 0 else np.inf for k in (found.upper, found.lower, found.value))
    if found.upper > 0:
        lower = float(np.nextafter(lower, 0))
    return Enclosure(lower, float(np.nextafter(upper, np.inf)), value, found.u, found.v)
