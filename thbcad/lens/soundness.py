"""The proof that a lens is a body that CAD files can hold: its surfaces and its ruled wall do not cross.

Where corners are cut off and front and rear differ in size, the wall of a lens must cross neither its
surfaces nor itself.  It joins points e of the unit outline, of half-widths 1.  At w it lies at
X(w) = ((1 - w) h + w h') e, from the rim of one surface G of half-widths h, its base, to that of the other,
of half-widths h'.  It lies

    w (gap(e) - mean over 0..w of sum_i (h'_i - h_i) e_i dG/dx_i(X))

above its base (G is the front, or the rear turned over).  That is positive where

    gap(e) > sum_i (h'_i - h_i) e_i dG/dx_i(X(w))    on the part of the wall over the base.

Where one surface is the larger in both directions, lines of equal w do not meet in plan, so that the wall
does not cross itself, and it lies over the larger surface alone.  Where the half-widths in one direction are
equal, its straight sides across it are plane, and this is asked of both bases at their rims, see
`edge_proof`.  Front and rear, compared at equal (x, y), complete the proof.

Where the front is the larger surface in one direction and the rear in the other, the points of equal (x, y)
on lines of equal w are in order if gap > sum_i |h'_i - h_i| times the greatest slopes of both surfaces in i.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from thbcad.certified import Enclosure, Interval, minimum, positive, range_over
from thbcad.checks import EPS, Floats, require_type
from thbcad.lens.edge_proof import Pair, gap_suffices, require_order, require_simple_edges
from thbcad.lens.graph_pieces import oriented
from thbcad.lens.lens import Lens
from thbcad.outlines import LEAST_SIZE, Outline
from thbcad.sags import gap_graph
from thbcad.splines import BSplineSurface

SAMPLES = np.linspace(0, 1, 65)  # each way on a part of the wall, for the amount that is missing
# of the unit outline where x and y are positive: a corner and two halves of sides
PARTS = ("corner", "x", "y")


def require_simple_wall(graphs: Pair, thickness: float, least: float, outline: Outline) -> None:
    """Raise ValueError unless the wall is proven to cross neither front nor rear nor itself.

    graphs, thickness, least : as of `require_simple_edges`
    outline : of the rear, not a rectangle
    """
    growth = [getattr(graphs[1], kv).stop - getattr(graphs[0], kv).stop for kv in ("kv_u", "kv_v")]
    if gap_suffices(graphs, growth, least):
        return
    if growth[0] * growth[1] < 0:
        raise ValueError(
            "it is undecided whether the wall between the rims crosses itself: front and rear are each the "
            "larger in one direction; raise lens.thickness or make one of them the larger in both"
        )
    half = [min(getattr(g, kv).stop for g in graphs) for kv in ("kv_u", "kv_v")]
    require_order(graphs, thickness, outline.scaled(half))
    gap = gap_graph(*graphs, thickness)
    for base, signs in product((0, 1), product((-1, 1), (-1, 1))):
        steps = [-step if base else step for step in growth]
        graph = graphs[base]
        turned = BSplineSurface(graph.kv_u, graph.kv_v, -graph.coefficients) if base else graph
        for part in PARTS[:1] if outline.is_ellipse else PARTS:
            flat = part != "corner" and steps["xy".index(part)] == 0
            if flat or max(steps) <= 0:
                own, lift = oriented(turned, 0, signs), oriented(gap, 0, signs)
                wall = _Wall(own, lift, (steps[0], steps[1]), outline.relative_corners, part)
                _require_part(wall, 0.0 if flat else 1.0, ("front", "rear")[base], signs)


@dataclass(frozen=True, eq=False)
class _Wall:
    """What must be positive on a part of the wall where x and y are, by t and w from 0 to 1."""

    base: BSplineSurface
    gap: BSplineSurface
    steps: tuple[float, float]
    corners: tuple[float, float]
    part: str

    def __call__(self, t: Floats, w: Floats) -> Floats:
        return self.lower(Interval.at(t), Interval.at(w))

    def position(self, t: float, w: float) -> list[float]:
        """Return x and y of a point of the wall."""
        e = self._relative(Interval.at(np.array([t])))
        half = self.base.kv_u.stop, self.base.kv_v.stop
        return [float((h + w * step) * x.low[0]) for h, step, x in zip(half, self.steps, e)]

    def lower(self, t: Interval, w: Interval) -> Floats:
        """Return bounds on boxes."""
        e = self._relative(t)
        half = self.base.kv_u.stop, self.base.kv_v.stop
        rim, wide = (
            [Interval.at(np.full_like(t.low, h)) for h in pair]
            for pair in ((self.gap.kv_u.stop, self.gap.kv_v.stop), half)
        )
        grown = [Interval.rounded(step, t.low) for step in self.steps]
        x, y = (((h + w * g) * a).clipped(0.0, b) for h, g, a, b in zip(wide, grown, e, half))
        slopes = range_over(self.base, x, y, (1, 0)), range_over(self.base, x, y, (0, 1))
        lift = range_over(self.gap, e[0] * rim[0], e[1] * rim[1])
        for g, a, slope in zip(grown, e, slopes):
            lift = lift - g * a * slope
        return lift.low

    def _relative(self, t: Interval) -> list[Interval]:
        """Return enclosures of the points e, which do not leave the unit square."""
        ones = np.ones_like(t.low)
        if self.part == "corner":
            turn = Interval(np.pi / 2 * t.high, np.pi / 2 * t.low), t.scaled(np.pi / 2)
            ratios = [Interval(f(a.low), f(a.high)) for f, a in zip((np.cos, np.sin), turn)]
            ends = [(1 - c, c) for c in self.corners]
        else:
            ratios = [Interval.at(ones) if self.part == name else t for name in "xy"]
            ends = [(0.0, 1.0) if self.part == name else (0.0, 1 - c) for name, c in zip("xy", self.corners)]
        slack = Interval(-8 * EPS * ones, 8 * EPS * ones)  # of turns, cosines and sums
        return [
            (r.scaled(c) + Interval.at(a * ones) + slack).clipped(0.0, 1.0) for r, (a, c) in zip(ratios, ends)
        ]


def _require_part(wall: _Wall, last: float, surface: str, signs: tuple[int, int]) -> None:
    """Raise ValueError unless a part of the wall is proven to lie over its base, up to w = last."""
    proven, point = positive(wall.lower, wall, np.array([[[0.0], [0.0]], [[1.0], [last]]]))
    if proven:
        return
    t, w = (a.ravel() for a in np.meshgrid(SAMPLES, last * SAMPLES))
    if point is not None:
        t, w = np.append(t, point[0]), np.append(w, point[1])
    missing = wall(t, w)
    k = int(np.argmin(missing))
    amount = f" by more than {-missing[k]:.6g} mm" if missing[k] < 0 else ""
    x, y = (sign * a + 0.0 for sign, a in zip(signs, wall.position(t[k], w[k])))
    raise ValueError(
        f"the wall between the rims crosses the {surface} or is too close to it for a proof, at x = {x:.6g}, "
        f"y = {y:.6g} mm; raise lens.thickness{amount} or make front and rear more alike in size"
    )


def require_sound(lens: Lens) -> Lens:
    """Return the lens, proven to be at least 1e-6 mm thick everywhere, with edges that cross neither surfaces
    nor each other.

    It is asked for where a lens comes from a problem or a file, and where it becomes a file, a solid or a
    mesh.

    Raises ValueError : no Lens; surfaces that touch or cross, a lens below 1e-6 mm in thickness or width, or
        ruled edges that cross a surface or each other (with the position and the amount); an edge that comes
        too close for a proof; as `Lens.graphs`.
    """
    require_type("lens", lens, Lens)
    _prove(lens)
    return lens


@lru_cache(maxsize=4)
def _prove(lens: Lens) -> None:
    """A lens that is read, held against its problem and written is proven once."""
    _require(lens.graphs(), lens.thickness, lens.least_thickness(), lens.rear.outline)


def require_sound_graphs(front: BSplineSurface, rear: BSplineSurface, outline: Outline | None = None) -> None:
    """Raise ValueError as `require_sound` of the body between two graphs z(x, y).

    front, rear : scalar, of the same degrees, over rectangles around x = y = 0, mm.
    outline : of the rear, None for its rectangle; the front's is in proportion.
    """
    outline = outline or Outline((rear.kv_u.stop, rear.kv_v.stop))
    least = minimum(gap_graph(front, rear, 0.0), tolerance=1e-12, outline=outline)
    _require((front, rear), 0.0, least, outline)


def _require(
    graphs: tuple[BSplineSurface, BSplineSurface], thickness: float, least: Enclosure, outline: Outline
) -> None:
    half_widths = [(graph.kv_u.stop, graph.kv_v.stop) for graph in graphs]
    if least.lower <= 0:
        raise ValueError(_touching(outline, least))
    if least.lower < LEAST_SIZE:
        raise ValueError(
            f"at x = {least.u:.6g}, y = {least.v:.6g} mm the lens is {least.value:.3g} mm thick, less than "
            f"the {LEAST_SIZE:g} mm that CAD files can hold; raise lens.thickness"
        )
    width = 2 * min(min(pair) for pair in half_widths)
    if width < LEAST_SIZE:
        raise ValueError(
            f"the lens is {width:.3g} mm wide, less than the {LEAST_SIZE:g} mm that CAD files can hold; "
            "raise half_width"
        )
    if outline.is_rectangle:
        require_simple_edges(graphs, thickness, least.lower)
    else:
        require_simple_wall(graphs, thickness, least.lower, outline)


def _touching(outline: Outline, least: Enclosure) -> str:
    """Return what is wrong with surfaces of no thickness, and where; the outline is that of the rear."""
    amount = abs(min(least.value, 0.0))
    ends = zip((least.u, least.v), outline.half_width, "xy")
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
