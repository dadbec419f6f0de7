"""Proof that the ruled edges of a lens cross neither its surfaces nor each other, where front and rear differ
in size.

An edge joins points of equal relative position of the two rims.  Seen from the rim of one surface G, its
base, at x = A, with the other rim at x = A - d, the half-width B in y, e more in the other rim, and the
distance gap(t) of the rims in z, it lies

    g(t, w) = G(A, t B) + w gap(t) - G(A - w d, t (B + w e)),    -1 <= t <= 1, 0 <= w <= 1,

above the base (G is the front, or the rear turned over).  It meets the base at its rim alone where g / w > 0,
at w = 0 in the limit,

    g / w = gap(t) + mean over 0..w of d G_x - t e G_y.

This is asked where d > 0, and at w = 0 where d = 0: such an edge lies in a plane, and its Jacobian, B g_w at
either rim, is linear in w, so that the ruling folds nowhere if it does not at the two rims.  Where d < 0 the
edge lies beside the base.

Two edges that meet at a corner lie in one plan only where the front is the larger surface in one direction
and the rear in the other: else a half-width determines w.  There, with half-widths a(w) that grow and b(w)
that fall, the points of equal (x, y) are

    (s a(w'), b(w')) at w' and (a(w), t b(w)) at w < w',    s = a(w) / a(w'), t = b(w') / b(w),

and the second must lie below the first.  Front and rear, compared at equal (x, y), complete the proof.

Boxes of (t, w) or (w, w') are quartered until a bound proves each, a point in one disproves it, or the budget
is spent.

Source: R. E. Moore, R. B. Kearfott, M. J. Cloud, Introduction to Interval Analysis, chapters 5 and 6 (mean
value form).
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from thbcad.certified import Interval, minimum, positive, range_over, rounding
from thbcad.checks import EPS, Bools, Floats
from thbcad.lens.graph_pieces import oriented, segment, steepest
from thbcad.outlines import Outline
from thbcad.sags import gap_graph
from thbcad.splines import BSplineSurface

SAMPLES = np.linspace(0, 1, 65) ** 2  # where the worst point of a crossing is looked for: dense at the rim
SLACK = 1e-9  # of the slopes: covers the rounding of differences and of few products

Pair = tuple[BSplineSurface, BSplineSurface]


def require_simple_edges(graphs: Pair, thickness: float, least: float) -> None:
    """Raise ValueError unless the ruled edges are proven to cross neither front nor rear nor each other.

    graphs : front and rear, splines z(x, y) over their rectangles, mm
    thickness : of the rear's z = 0 over the front's, mm
    least : mm, a positive lower bound of the distance in z between points of equal relative position
    """
    growth = [getattr(graphs[1], kv).stop - getattr(graphs[0], kv).stop for kv in ("kv_u", "kv_v")]
    if gap_suffices(graphs, growth, least):
        return  # every condition holds then
    half = [min(getattr(g, kv).stop for g in graphs) for kv in ("kv_u", "kv_v")]
    require_order(graphs, thickness, Outline((half[0], half[1])))
    gap = gap_graph(*graphs, thickness)
    for base, axis, sign in product((0, 1), (0, 1), (-1, 1)):
        _require_edge(graphs, gap, (base, axis, sign))
    if growth[0] * growth[1] < 0:
        for signs in product((-1, 1), (-1, 1)):
            _require_corner(graphs, gap, int(growth[1] > 0), signs)


def gap_suffices(graphs: Pair, growth: list[float], least: float) -> bool:
    """Return whether the gap exceeds what front and rear rise or fall where their rims lie apart.

    growth : of the rear's half-widths over the front's, mm
    """
    return least > (1 + SLACK) * sum(
        abs(step) * max(steepest(g, axis) for g in graphs) for axis, step in enumerate(growth) if step
    )


def require_order(graphs: Pair, thickness: float, outline: Outline) -> None:
    """Raise ValueError where front and rear cross at equal (x, y) inside an outline, mm."""
    front, rear = (segment(g, list(outline.half_width)) for g in graphs)
    least = minimum(gap_graph(front, rear, thickness), tolerance=1e-12, outline=outline)
    if least.lower <= 0:
        amount = abs(min(least.value, 0.0))
        raise ValueError(
            f"front and rear {'cross' if amount else 'touch'}: at x = {least.u:.6g}, y = {least.v:.6g} mm "
            f"the rear lies {amount:.6g} mm "
            f"before the front; raise lens.thickness by more than {amount:.6g} mm or change the radii"
        )


@dataclass(frozen=True, eq=False)
class _EdgeOverBase:
    """g(t, w) of the module: an edge over its base at high x."""

    base: BSplineSurface
    gap: BSplineSurface
    d: float
    e: float

    def __call__(self, t: Floats, w: Floats) -> Floats:
        """Return g / w, its limit at w = 0, and inf beside the base."""
        a, b = self.base.kv_u.stop, self.base.kv_v.stop
        x, y = self.position(t, w)
        rim = np.full_like(t, a)
        lift = self.gap(np.full_like(t, self.gap.kv_u.stop), t * self.gap.kv_v.stop)
        y = np.clip(y, -b, b)
        mean = (self.base(rim, t * b) - self.base(x, y)) / np.where(w > 0, w, 1.0)
        if not w.all():
            limit = self.d * self.base(rim, t * b, (1, 0)) - t * self.e * self.base(rim, t * b, (0, 1))
            mean = np.where(w > 0, mean, limit)
        return np.where(self._inside(t, w), lift + mean, np.inf)

    def position(self, t: Floats, w: Floats) -> tuple[Floats, Floats]:
        """Return x and y of points of the edge."""
        return self.base.kv_u.stop - w * self.d, t * (self.base.kv_v.stop + w * self.e)

    def lower(self, t: Interval, w: Interval) -> Floats:
        """Return bounds of g / w on boxes that touch w = 0, of g on others, and inf on those beside the base;
        t keeps its sign in a box."""
        base, gap, b = self.base, self.gap, self.base.kv_v.stop
        rim, side, end = (Interval.at(np.full_like(t.low, x)) for x in (base.kv_u.stop, b, gap.kv_u.stop))
        d, e = (Interval.rounded(x, t.low) for x in (self.d, self.e))
        width = side + w * e
        x, y = rim - w * d, (t * width).clipped(-b, b)
        in_x, in_y = range_over(base, x, y, (1, 0)), range_over(base, x, y, (0, 1))
        along = t.scaled(gap.kv_v.stop)
        by_w = range_over(gap, end, along) + in_x * d - t * in_y * e
        at_rim = range_over(base, rim, t.scaled(b), (0, 1)).scaled(b)
        by_lift = range_over(gap, end, along, (0, 1)).scaled(gap.kv_v.stop)
        by_t = at_rim + w * by_lift - width * in_y
        near = np.where(abs(t.low) < abs(t.high), t.low, t.high)
        centre = (t.low + t.high) / 2, (w.low + w.high) / 2
        # else from the corner that lies over the base if any point of the box does
        whole = self._inside(*centre)
        at = np.where(whole, centre[0], near), np.where(whole, centre[1], w.low)
        reach = [Interval.at(np.where(whole, 0.5, 1.0) * (box.high - box.low)) for box in (t, w)]
        change = Interval.at(by_t.magnitude) * reach[0] + Interval.at(by_w.magnitude) * reach[1]
        value = np.where(self._inside(*at), self(*at) * at[1], np.inf)
        # positions are rounded a few times, values and their sum as `count` says
        slip = in_x.magnitude * base.kv_u.stop + in_y.magnitude * b + at_rim.magnitude + by_lift.magnitude
        count = 8 * (base.kv_u.degree + base.kv_v.degree + 4)
        error = rounding(count, abs(base.coefficients).max() + abs(gap.coefficients).max()) + 8 * EPS * slip
        value = (Interval.at(value) - change - Interval.at(error)).low
        return np.where(w.low > 0, value, np.where(self._inside(near, w.low), by_w.low, np.inf))

    def _inside(self, t: Floats, w: Floats) -> Bools:
        b = self.base.kv_v.stop
        return abs(t) * (b + w * self.e) <= b * (1 + 4 * EPS)


@dataclass(frozen=True, eq=False)
class _Corner:
    """The distance in z of two edges at a corner at high x and y, where a(w) grows by `da` and b(w) falls by
    `db`."""

    front: BSplineSurface
    gap: BSplineSurface
    da: float
    db: float

    def __call__(self, w: Floats, later: Floats) -> Floats:
        """Return the distance over later - w, and inf where w >= later."""
        (a, b), (c, d) = self._ends(self.front, w), self._ends(self.gap, w)
        s = np.minimum(1, (a + w * self.da) / (a + later * self.da))
        t = np.minimum(1, (b - later * self.db) / (b - w * self.db))
        low = self.front(a, t * b) + w * self.gap(c, t * d)
        high = self.front(s * a, b) + later * self.gap(s * c, d)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(w < later, (high - low) / (later - w), np.inf)

    def position(self, w: Floats, later: Floats) -> tuple[Floats, Floats]:
        """Return x and y of the points that are compared."""
        return self.front.kv_u.stop + w * self.da, self.front.kv_v.stop - later * self.db

    def lower(self, w: Interval, later: Interval) -> Floats:
        """Return bounds that are positive only where the distance is, or the distance over later - w; inf on
        boxes with w >= later."""
        (a, b), (c, d) = ([Interval.at(x) for x in self._ends(g, w.low)] for g in (self.front, self.gap))
        ones = np.ones_like(w.low)
        da, db = (Interval.rounded(x, w.low) for x in (self.da, self.db))
        s = ((a + w * da) / (a + later * da)).clipped(0, 1)
        t = ((b - later * db) / (b - w * db)).clipped(0, 1)
        high = range_over(self.front, s * a, b) + later * range_over(self.gap, s * c, d)
        low = range_over(self.front, a, t * b) + w * range_over(self.gap, c, t * d)
        s, t = Interval(s.low, ones), Interval(t.low, ones)  # from the corner on
        by_s = (
            range_over(self.front, s * a, b, (1, 0)) * a + later * range_over(self.gap, s * c, d, (1, 0)) * c
        )
        by_t = range_over(self.front, a, t * b, (0, 1)) * b + w * range_over(self.gap, c, t * d, (0, 1)) * d
        x, y = a + later * da, b - w * db
        ratio = range_over(self.gap, c, d) - by_s * (da / x) + by_t * (db / y)
        return np.where(w.low < later.high, np.maximum((high - low).low, ratio.low), np.inf)

    @staticmethod
    def _ends(graph: BSplineSurface, like: Floats) -> tuple[Floats, Floats]:
        return np.full_like(like, graph.kv_u.stop), np.full_like(like, graph.kv_v.stop)


def _require_edge(graphs: Pair, gap: BSplineSurface, side: tuple[int, int, int]) -> None:
    """Raise ValueError unless the edge on a side, (base, axis, sign), is proven to lie over its base."""
    base, axis, sign = side
    front, rear = (oriented(g, axis, (sign, 1)) for g in graphs)
    own, other = (rear, front) if base else (front, rear)
    d, e = own.kv_u.stop - other.kv_u.stop, other.kv_v.stop - own.kv_v.stop
    if d < 0 or d == e == 0:
        return
    if base:
        own = BSplineSurface(own.kv_u, own.kv_v, -own.coefficients)
    edge = _EdgeOverBase(own, oriented(gap, axis, (sign, 1)), d, e)
    boxes = np.array([[[-1.0, 0.0], [0.0, 0.0]], [[0.0, 1.0], [float(d > 0)] * 2]])
    proven, point = positive(edge.lower, edge, boxes)
    if proven:
        return
    name = f"{'-+'[sign > 0]}{'xy'[axis]}"
    surface = ("front", "rear")[base]
    if point is None:
        raise ValueError(_undecided(f"the ruled edge at {name} crosses the {surface}"))
    t, w = (
        np.append(a.ravel(), x) for a, x in zip(np.meshgrid(np.r_[SAMPLES - 1, 1 - SAMPLES], SAMPLES), point)
    )
    height = edge(t, w)
    raised, height = -height.min(), height * w
    k = int(np.argmin(np.where(np.isfinite(height), height, np.inf)))
    raise ValueError(
        f"the ruled edge at {name} crosses the {surface}: at "
        f"{_where(edge.position(t[k], w[k]), axis, (sign, 1))} it lies "
        f"{max(0.0, -height[k]):.6g} mm {('before', 'behind')[base]} it; {_remedy(raised)}"
    )


def _require_corner(graphs: Pair, gap: BSplineSurface, axis: int, signs: tuple[int, int]) -> None:
    """Raise ValueError unless two edges that meet at a corner are proven not to cross; `axis` is the one in
    which the rear is larger."""
    front, rear = (oriented(g, axis, signs) for g in graphs)
    corner = _Corner(
        front, oriented(gap, axis, signs), rear.kv_u.stop - front.kv_u.stop, front.kv_v.stop - rear.kv_v.stop
    )
    proven, point = positive(corner.lower, corner, np.array([[[0.0], [0.0]], [[1.0], [1.0]]]))
    if proven:
        return
    names = " and ".join(f"{'-+'[sign > 0]}{'xy'[k]}" for sign, k in zip(signs, (axis, 1 - axis)))
    if point is None:
        raise ValueError(_undecided(f"the ruled edges at {names} cross each other"))
    w, later = (np.append(a.ravel(), x) for a, x in zip(np.meshgrid(SAMPLES, SAMPLES), point))
    height = corner(w, later)
    k = int(np.argmin(height))
    raise ValueError(
        f"the ruled edges at {names} cross at {_where(corner.position(w[k], later[k]), axis, signs)}; "
        f"{_remedy(-height[k])}"
    )


def _remedy(amount: float) -> str:
    return (
        f"raise lens.thickness by more than {max(0.0, amount):.6g} mm or make front and rear more alike "
        "in size"
    )


def _undecided(what: str) -> str:
    return (
        f"it is undecided whether {what}: they come too close for a proof; raise lens.thickness or make "
        "front and rear more alike in size"
    )


def _where(position: tuple[Floats, Floats], axis: int, signs: tuple[int, int]) -> str:
    """Return the position in x and y of a point given in oriented coordinates."""
    x, y = (sign * float(a) + 0.0 for a, sign in zip(position, signs))
    return f"x = {(x, y)[axis]:.6g}, y = {(y, x)[axis]:.6g} mm"
