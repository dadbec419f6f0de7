"""Ruled edges between rims of different size: what is accepted is closed and simple, what is refused crosses
where the sentence says."""

import re
from fractions import Fraction
from itertools import product
from operator import add, mul, sub, truediv

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st
from OCP.BOPAlgo import BOPAlgo_ArgumentAnalyzer

from tests.cases import examples
from tests.thbcad.cases import seeds, surfaces
from thbcad.cad.shapes import part_between
from thbcad.certified import MOST_BOXES, Interval, positive, range_over
from thbcad.hierarchy import THBSpace
from thbcad.lens.freeform_surface import FreeformSurface
from thbcad.lens.lens import Lens
from thbcad.lens.rims import placed_surfaces, ruled_edges
from thbcad.lens.soundness import require_sound
from thbcad.sags import Conic
from thbcad.splines import BSplineSurface, KnotVector
from thbcad.surfaces import THBSurface

SHARE = np.linspace(0, 1, 41)


def clearances(front, rear, thickness):
    """Return by name the least distances in z of a dense sample, of every pair of faces, over what they tend
    to 0 with."""
    sizes = front.half_width, rear.half_width
    found = {}
    a, b = np.minimum(*sizes)
    found["surfaces"] = (
        thickness
        + rear.grid(SHARE * 2 * a - a, SHARE * 2 * b - b)
        - front.grid(SHARE * 2 * a - a, SHARE * 2 * b - b)
    ).min()
    for base, other, name in ((0, 1, "front"), (1, 0, "rear")):
        for axis in (0, 1):
            for sign in (-1, 1):
                if sizes[base][axis] >= sizes[other][axis] and sizes[0] != sizes[1]:
                    found[name, axis, sign] = over_base((front, rear), thickness, base, axis, sign)
    return found


def at(surface, axis, along, across):
    return surface(*((along, across) if axis == 0 else (across, along)))


def over_base(pair, thickness, base, axis, sign):
    """Return the least (z of the edge - z of the base) / w towards the other surface."""
    ends = np.r_[SHARE**2, 1e-6, 1e-4]
    t, w = (
        x.ravel() for x in np.meshgrid(np.r_[ends - 1, 1 - ends], np.r_[1e-7, 1e-5, SHARE[1:] ** 2])
    )  # dense at the rim and its ends
    own, other = pair[base], pair[1 - base]
    (a, b), (c, d) = (np.roll(s.half_width, axis) if axis else s.half_width for s in (own, other))
    step = -thickness if base else thickness  # z = 0 of the other surface, seen from the base
    start, stop = (
        at(own, axis, np.full_like(t, sign * a), t * b),
        step + at(other, axis, np.full_like(t, sign * c), t * d),
    )
    x, y, z = sign * ((1 - w) * a + w * c), t * ((1 - w) * b + w * d), (1 - w) * start + w * stop
    inside = abs(y) <= b
    distance = z[inside] - at(own, axis, x[inside], y[inside])
    return ((-distance if base else distance) / w[inside]).min()


def corner(front, rear, thickness, axis, signs):
    """Return the least distance of two edges over the plan that both cover, per mm from their common corner
    line."""
    (a, c), (b, d) = ((f, r) for f, r in zip(np.roll(front.half_width, axis), np.roll(rear.half_width, axis)))
    x, y = (v.ravel() for v in np.meshgrid(a + (c - a) * SHARE, d + (b - d) * SHARE))
    w, later = (x - a) / (c - a), (b - y) / (b - d)
    keep = later > w + 1e-6
    x, y, w, later = x[keep], y[keep], w[keep], later[keep]
    heights = []
    for share, s, t in ((w, 1.0, y / (b + w * (d - b))), (later, x / (a + later * (c - a)), 1.0)):
        z = [
            at(f, axis, np.clip(signs[0] * s * h, -h, h) + 0 * w, np.clip(signs[1] * t * k, -k, k) + 0 * w)
            for f, h, k in ((front, a, b), (rear, c, d))
        ]
        heights.append((1 - share) * z[0] + share * (thickness + z[1]))
    return ((heights[1] - heights[0]) / (later - w)).min()


def least_clearance(front, rear, thickness):
    found = list(clearances(front, rear, thickness).values())
    growth = np.subtract(rear.half_width, front.half_width)
    if growth.prod() < 0:
        axis = int(growth[1] > 0)
        found += [corner(front, rear, thickness, axis, (p, q)) for p in (-1, 1) for q in (-1, 1)]
    return min(found)


# ---- enclosures ----


@given(seeds(), st.sampled_from([(0, 0), (1, 0), (0, 1)]))
def test_ranges_hold_and_are_tight(rng, orders):
    """Knots of full multiplicity too: one-sided derivatives count; small rectangles have tight bounds."""
    kv_u, kv_v = KnotVector(3, [0, 0, 0, 0, 1, 1, 1, 2, 3.5, 4, 4, 4, 4]), KnotVector.uniform(2, 5)
    surface = BSplineSurface(kv_u, kv_v, rng.uniform(-1, 1, (kv_u.dim, kv_v.dim)))
    u, v = np.sort(rng.uniform(0, 4, (2, 30)), axis=0), np.sort(rng.uniform(0, 1, (2, 30)), axis=0)
    u[1, :10], v[1, :10] = np.minimum(4, u[0, :10] + 1e-3), np.minimum(1, v[0, :10] + 1e-3)
    found = range_over(surface, Interval(*u), Interval(*v), orders)
    for k in range(30):
        z = surface.grid(np.linspace(*u[:, k], 9), np.linspace(*v[:, k], 9), orders)
        assert found.low[k] <= z.min()
        assert z.max() <= found.high[k]
        if (
            k < 10
            # bounds differ from extremes by the square of the size times second derivatives, and samples by a
            # spacing
        ):
            assert found.high[k] - found.low[k] <= 1.01 * (z.max() - z.min()) + 1e-2


@given(seeds(), st.sampled_from(["+", "-", "*", "/", "scaled"]))
def test_intervals_enclose_exact_results(rng, operation):
    """Also of numbers of very different size, and of the ends themselves; compared as Fractions."""
    ends = np.sort(rng.uniform(-1, 1, (2, 2, 50)) * 10.0 ** rng.integers(-12, 13, (2, 2, 50)), axis=1)
    if operation == "/":
        ends[1] = np.sort(abs(ends[1]), axis=0)
    a, b = Interval(*ends[0]), Interval(*ends[1])
    exact = {"+": add, "-": sub, "*": mul, "/": truediv, "scaled": mul}[operation]
    factor = b.low[0]
    found = a.scaled(factor) if operation == "scaled" else exact(a, b)
    for k in range(50):
        others = [factor] if operation == "scaled" else [b.low[k], b.high[k], b.low[k] / 2 + b.high[k] / 2]
        for x, y in product((a.low[k], a.high[k]), others):
            assert found.low[k] < exact(Fraction(x), Fraction(y)) < found.high[k]


def test_bounds_meet_with_the_square_of_the_size():
    surface = BSplineSurface(
        KnotVector.uniform(3, 1), KnotVector.uniform(3, 1), np.random.default_rng(1).uniform(-1, 1, (4, 4))
    )
    excess = []
    for size in (0.1, 0.01):
        a = np.array([0.3])
        found = range_over(surface, Interval(a, a + size), Interval(a, a + size))
        z = surface.grid(np.linspace(0.3, 0.3 + size, 101), np.linspace(0.3, 0.3 + size, 101))
        excess.append(found.high[0] - z.max() + z.min() - found.low[0])
    assert excess[1] <= excess[0] / 50 + 1e-13


def test_proof_counterexample_and_neither():
    """f = a b + c on [0, 1]^2: proven for c > 0, disproven for c < 0, and at c = 0 the corner stays open."""
    boxes = np.array([[[0.0], [0.0]], [[1.0], [1.0]]])
    for c, wanted in ((1e-3, True), (-1e-3, False)):
        proven, point = positive(lambda a, b, c=c: a.low * b.low + c, lambda a, b, c=c: a * b + c, boxes)
        assert proven is wanted
        assert wanted == (point is None)
    assert np.prod(point) <= 1e-3
    assert positive(lambda a, b: a.low * b.low, lambda a, b: a * b + 1e-300, boxes) == (False, None)
    assert MOST_BOXES >= 2**10


# ---- lenses ----


def quartic(half_width, height, axis):
    """z = height 4 / 9 (x^2 - 1) (4 - x^2) of one coordinate over |x| <= 2: zero at 1 and 2, `height` at x^2
    = 5 / 2."""
    kv = KnotVector.uniform(4, 1, -2, 2)
    x = np.linspace(-2, 2, 5)
    row = np.linalg.solve(kv.collocation(x).toarray(), height * 4 / 9 * (x**2 - 1) * (4 - x**2))
    net = np.repeat(row[:, None], 5, axis=1) if axis == 0 else np.repeat(row[None, :], 5, axis=0)
    return FreeformSurface(half_width, Conic(), THBSurface(THBSpace(kv, kv), net.ravel()))


def dome(half_width, height):
    """A surface of z = 0 at its rim and of height / 4 in the middle.

    Opposite a bump it leaves the lens thinnest at two points, not along a line, which is found ten times as
    fast.
    """
    net = np.zeros((3, 3))
    net[1, 1] = height
    space = THBSpace(*(KnotVector.uniform(2, 1, -h, h) for h in half_width))
    return FreeformSurface(half_width, Conic(), THBSurface(space, net.ravel()))


FLAT = {(0, "front", 1.0), (1, "rear", 0.75)}  # with a flat small face, the others with a dome


@pytest.mark.slow
@pytest.mark.parametrize(
    ("axis", "wide", "other"), list(product((0, 1), ("front", "rear"), (1.0, 0.75, 1.25)))
)
def test_the_critical_thickness_of_a_bump(axis, wide, other):
    """Edges from x = 2, z = 0 to x = 1, z = T are tangent to the bump h at T = 16 h / 3: above they are
    accepted, below refused."""
    sizes = [(2.0, 1.0), (1.0, other)]
    big, small = (tuple(size[::-1]) if axis else size for size in sizes)
    up = 1 if wide == "front" else -1
    other_face = FreeformSurface(small) if (axis, wide, other) in FLAT else dome(small, 0.5 * up)
    surfaces_of = (quartic(big, 0.3 * up, axis), other_face)[::up]
    require_sound(Lens(*surfaces_of, 1.62, 1.5))
    crossing = (
        rf"the ruled edge at -[xy] crosses the {wide}: at .* it lies \S+ mm "
        rf"{'before' if wide == 'front' else 'behind'} it"
    )
    with pytest.raises(ValueError, match=crossing + r"; raise lens\.thickness by more than 0\.2 mm"):
        require_sound(Lens(*surfaces_of, 1.4, 1.5))
    with pytest.raises(ValueError, match=r"the ruled edge at"):
        require_sound(Lens(*surfaces_of, 1.59, 1.5))


@pytest.mark.slow
@pytest.mark.parametrize(("thickness", "crosses"), [(1.55, True), (1.7, False)])
def test_occt_finds_the_same_solids_to_meet_themselves(thickness, crosses):
    """Its self-interference test of the six faces, on both sides of the critical thickness of 1.6 mm."""
    pair = quartic((2.0, 1.0), 0.3, 0), dome((1.0, 0.75), 0.5)
    lens = Lens(*pair, thickness, 1.5)
    analyzer = BOPAlgo_ArgumentAnalyzer()
    analyzer.SetShape1(part_between(placed_surfaces(lens), ruled_edges(lens)).solid)
    analyzer.SelfInterMode = True
    analyzer.Perform()
    assert analyzer.HasFaulty() == crosses
    if crosses:
        with pytest.raises(ValueError, match="the ruled edge"):
            require_sound(lens)
    else:
        require_sound(lens)


@pytest.mark.slow
def test_a_tangent_edge_is_undecided():
    """It neither crosses nor lies over the front: at T = 16 h / 3, rounded, no bound and no point tells."""
    with pytest.raises(
        ValueError,
        match=r"undecided whether the ruled edge at -x crosses the front|the ruled edge at -x crosses the "
        r"front.* than \S+e-\d+ mm",
    ):
        require_sound(Lens(quartic((2.0, 1.0), 0.3, 0), dome((1.0, 1.0), 0.5), 1.6, 1.5))


def test_edges_that_cross_each_other_alone():
    """Front and rear are each the larger in one direction; every edge lies over its bases, but two meet
    between the rims."""
    kv = KnotVector(2, [-1, -1, -1, -0.8, 0.8, 1, 1, 1])
    pair = []
    for half_width, corner_net in (((1.0, 2.0), [[2, 3], [4, 2]]), ((2.0, 1.0), [[6, -2], [0, 2]])):
        net = np.zeros((5, 5))
        net[3:, 3:] = np.array(corner_net) / 10
        pair.append(FreeformSurface(half_width, Conic(), THBSurface(THBSpace(kv, kv), net.ravel())))
    with pytest.raises(
        ValueError,
        match=r"ruled edges at \+x and \+y cross at x = 1\.4\d*, y = 1\.4\d* mm; raise .* more than "
        r"0\.033\d* mm",
    ):
        require_sound(Lens(*pair, 1.0, 1.5))
    assert corner(*pair, 1.0, 0, (1, 1)) == pytest.approx(-0.0337, abs=0.002)
    assert min(clearances(*pair, 1.0).values()) > 0
    assert require_sound(Lens(*pair, 1.5, 1.5)).thickness == 1.5


def test_surfaces_that_cross_at_equal_places_alone():
    """Front 2 mm, rear 4 mm wide each way: a bump of the front at x = 1 meets a dent of the rear there, at
    other relative places."""
    kv = KnotVector.uniform(3, 48, -1, 1)
    space, pair = THBSpace(kv, kv), []
    for half_width, height in ((2.0, 1.0), (4.0, -1.0)):
        net = height * np.exp(
            -(((half_width * kv.greville()[:, None] - 1) / 0.3) ** 2)
            - (half_width * kv.greville() / 0.3) ** 2
        )
        pair.append(FreeformSurface((half_width, half_width), Conic(), THBSurface(space, net.ravel())))
    with pytest.raises(
        ValueError,
        match=r"front and rear cross: at x = \S+, y = \S+ mm the rear lies \S+ mm before the front; raise",
    ):
        require_sound(Lens(*pair, 1.2, 1.5))
    assert require_sound(Lens(*pair, 2.1, 1.5)).least_thickness().lower > 0


@pytest.mark.slow
@examples(40)
@given(st.data())
def test_random_lenses(data):
    """What is accepted is clear in a dense sample; what is refused crosses where the sentence says."""
    rng = data.draw(seeds())
    halves = rng.choice([1.0, 1.5, 2.0, 3.0], (2, 2))
    assume((halves[0] != halves[1]).any())
    pair = [data.draw(surfaces(half_width=tuple(h.tolist()), conics=False)) for h in halves]
    s = 2 * SHARE - 1
    relative = (
        pair[0].grid(s * halves[0, 0], s * halves[0, 1]) - pair[1].grid(s * halves[1, 0], s * halves[1, 1])
    ).max()
    thickness = max(0.0, relative) + 10 ** rng.uniform(-1.5, 0.5)
    try:
        require_sound(Lens(*pair, thickness, 1.5))
        sentence = ""
    except ValueError as error:
        sentence = str(error)
    if not sentence:
        assert least_clearance(*pair, thickness) > 0
    elif found := re.search(
        r"edge at (.)(.) crosses the (\w+): at x = (\S+), y = (\S+) mm it lies (\S+) mm", sentence
    ):
        sign, letter, base = (
            (-1 if found[1] == "-" else 1),
            "xy".index(found[2]),
            ["front", "rear"].index(found[3]),
        )
        sizes = [np.roll(f.half_width, letter) for f in (pair[base], pair[1 - base])]
        if sizes[0][0] > sizes[1][0]:  # else the place does not tell w
            assert depth_at(
                pair, thickness, (base, letter, sign), sizes, [float(found[k]) for k in (4, 5)]
            ) == pytest.approx(float(found[6]), abs=1e-3 * thickness)
    else:
        assert re.search("undecided|cross|touch", sentence)


def depth_at(pair, thickness, side, sizes, place):
    """Return how far an edge lies on the wrong side of its base at (x, y)."""
    base, axis, sign = side
    (a, b), (c, d) = sizes
    x, y = np.roll(place, axis)
    w = (a - sign * x) / (a - c)
    t = np.clip(y / (b + w * (d - b)), -1, 1)
    step = -thickness if base else thickness
    one = np.ones(1)
    z = (1 - w) * at(pair[base], axis, sign * a * one, t * b * one) + w * (
        step + at(pair[1 - base], axis, sign * c * one, t * d * one)
    )
    depth = at(pair[base], axis, x * one, y * one) - z
    return float(-depth[0] if base else depth[0])
