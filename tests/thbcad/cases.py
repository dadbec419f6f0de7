"""Hypothesis strategies: knot vectors, parameters, hierarchies, lenses."""

import numpy as np
import pytest
from hypothesis import reject, strategies as st
from scipy.interpolate import NdBSpline

from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens, optical_forms, require_sound
from thbcad.sags import Conic, PlacedConic
from thbcad.splines import KnotVector, NURBSSurface
from thbcad.surfaces import THBSurface

SCALES = (1.0, 1 / 7, 0.1, 25.4)  # 1 keeps all knots and their bisections exact in float64
EPS = np.finfo(float).eps
# points of an aperture of 10 mm by 8 mm, and their squared distances from the axis
X, Y = (a.ravel() for a in np.meshgrid(np.linspace(-5, 5, 21), np.linspace(-4, 4, 17)))
R2 = X * X + Y * Y
AWKWARD = np.array([-0.0, 5e-324, 1 / 3, -0.1, 2.0**-52, -np.pi, 1e-17])


@st.composite
def knot_vectors(draw, min_degree=1, max_degree=10, max_spans=5, scales=SCALES):
    """A clamped knot vector with spans of ratio up to 9 and interior multiplicities up to the degree."""
    p = draw(st.integers(min_degree, max_degree))
    gaps = draw(st.lists(st.integers(1, 9), min_size=1, max_size=max_spans))
    counts = draw(st.lists(st.integers(1, p), min_size=len(gaps) - 1, max_size=len(gaps) - 1))
    breaks = draw(st.integers(-9, 9)) + np.r_[0, np.cumsum(gaps)]
    return KnotVector(p, np.repeat(draw(st.sampled_from(scales)) * breaks, [p + 1, *counts, p + 1]))


@st.composite
def unclamped(draw, max_degree=5, shortest=-6):
    """A knot vector with knots outside the domain; its spans have ratios up to 10^-shortest, or are empty."""
    p = draw(st.integers(1, max_degree))
    spans = draw(st.integers(1, 4))
    # no knot more than twice, nor in the first and the last span
    gaps = draw(st.lists(st.floats(shortest, 0), min_size=2 * p + spans, max_size=2 * p + spans))
    empty = draw(st.sets(st.integers(p + 1, p + spans - 2))) if p > 1 and spans > 2 else set()
    widths = [0.0 if k in empty and k - 1 not in empty else 10.0**gap for k, gap in enumerate(gaps)]
    return KnotVector(p, np.r_[0.0, np.cumsum(widths)])


@st.composite
def parameters(draw, kv, size=6):
    """Parameters in the domain: fractions of it, the breaks, and the float64 neighbours of breaks."""
    shares = draw(st.lists(st.integers(0, 2**20), min_size=1, max_size=size))
    inside = kv.start + (kv.stop - kv.start) * np.array(shares) / 2**20
    marks = draw(st.lists(st.sampled_from(kv.breaks.tolist()), max_size=size))
    # the neighbour of 0 is subnormal: no relative accuracy there
    beside = [np.nextafter(b, side) for b in marks if b != 0 for side in (-np.inf, np.inf)]
    return np.clip(np.r_[inside, marks, beside], kv.start, kv.stop)


@st.composite
def insertions(draw, kv, size=6):
    """New knots, on old knots too, such that no interior knot occurs more than degree times."""
    shares = draw(st.lists(st.integers(1, 63), max_size=size))
    wanted = list(kv.start + (kv.stop - kv.start) * np.array(shares) / 64)
    if kv.spans > 1:
        wanted += draw(st.lists(st.sampled_from(kv.breaks[1:-1].tolist()), max_size=size))
    held = list(kv.knots)
    new = []
    for x in wanted:
        if held.count(x) < kv.degree:
            held.append(x)
            new.append(float(x))
    return new


def seeds():
    """Seeds of numpy's generator: hypothesis picks and shrinks one number, the generator makes a rich example
    of it."""
    return st.integers(0, 2**32 - 1).map(np.random.default_rng)


def random_knot_vector(rng, degree, max_spans, scale=1.0):
    """A knot vector with 1 to max_spans spans of ratio up to 4, one interior knot in four multiple."""
    spans = rng.integers(1, max_spans + 1)
    counts = np.where(rng.random(spans - 1) < 0.25, rng.integers(1, degree + 1, spans - 1), 1)
    breaks = rng.integers(-4, 5) + np.r_[0, np.cumsum(rng.integers(1, 5, spans))]
    return KnotVector(degree, np.repeat(scale * breaks, [degree + 1, *counts, degree + 1]))


@st.composite
def refined_spaces(draw, start, min_steps=1, max_steps=5, deepest=3):
    """(space, refined): `start` = (space, refined) after random steps; refined holds one set of cells per
    level.

    Each step refines what is left of a rectangle of cells of one level, in one case of three less a few
    cells.
    """
    space, refined = start[0], [set(cells) for cells in start[1]]
    rng, steps = draw(seeds()), draw(st.integers(min_steps, max_steps))
    for _ in range(steps):
        leaves = space.cells[space.cells[:, 0] < deepest]
        if not len(leaves):
            break
        level, i, j = leaves[rng.integers(len(leaves))]
        box = rng.integers(1, [space.kv_u.degree + 4, space.kv_v.degree + 4])
        low = (i, j) - rng.integers(0, box)
        cells = leaves[leaves[:, 0] == level, 1:]
        cells = cells[((cells >= low) & (cells < low + box)).all(axis=1)]
        cells = cells[rng.random(len(cells)) < rng.choice([1.0, 1.0, 0.8])].tolist()
        if not cells:
            continue
        space = space.refine({int(level): cells})
        if level == len(refined):
            refined.append(set())
        refined[level] |= set(map(tuple, cells))
    return space, refined


@st.composite
def tensor_spaces(draw, max_degree=3, max_spans=5, scales=(1.0,)):
    """Tensor-product spaces over random knot vectors."""
    degrees = [draw(st.integers(1, max_degree)) for _ in range(2)]
    scale, rng = draw(st.sampled_from(scales)), draw(seeds())
    return THBSpace(*(random_knot_vector(rng, p, max_spans, scale) for p in degrees))


@st.composite
def hierarchies(draw, max_degree=3, max_spans=5, max_steps=5, deepest=3, scales=(1.0,)):
    """(space, refined) over random knot vectors with one set of refined cells per level."""
    start = draw(tensor_spaces(max_degree, max_spans, scales)), []
    return draw(refined_spaces(start, 0, max_steps, deepest))


def spaces(**options):
    """Random THB spaces."""
    return hierarchies(**options).map(lambda pair: pair[0])


@st.composite
def coefficients(draw, *shape, scale=1.0):
    """Random numbers in [-scale, scale]."""
    return scale * draw(seeds()).uniform(-1, 1, shape)


@st.composite
def points(draw, space, size=6):
    """(u, v): scattered points, breaks included."""
    u, v = draw(parameters(space.kv_u, size)), draw(parameters(space.kv_v, size))
    n = min(len(u), len(v))
    return u[:n], v[:n]


@st.composite
def surfaces(draw, half_width=None, conics=True):
    """Freeform surfaces with or without a refined sag of degree 3 or 4: planes, paraboloids and, unless
    refused, other conics.

    The others are gentle and small, because their splines to 1e-11 mm have many control points.
    """
    half = half_width or tuple(draw(st.floats(0.5, 4)) for _ in range(2))
    reach = np.hypot(*half)
    general = [(-2.7, (6.1, -8.7)), (0.0, (-9.3,))] if conics else []
    constant, ratios = draw(
        st.sampled_from([(-1.0, (3.1, -4.7, 40.0)), (draw(st.floats(-4, 4)), (np.inf,)), *general])
    )
    radius = float(draw(st.sampled_from(ratios)) * reach)
    net = None
    if draw(st.booleans()):
        rng = draw(seeds())
        kvs = (
            random_knot_vector(rng, rng.integers(3, 5), 4, draw(st.sampled_from(SCALES))) for _ in range(2)
        )
        space, _ = draw(refined_spaces((THBSpace(*kvs), []), 0, 3, deepest=2))
        values = 0.02 * reach * rng.uniform(-1, 1, space.dim)
        values[: len(AWKWARD)] = AWKWARD[: space.dim]
        net = THBSurface(space, values)
    return FreeformSurface(half, Conic(radius, constant), net)


@st.composite
def lenses(draw, conics=True):
    """Valid lenses: no surface is deeper than 0.4 of its reach; sizes of front and rear may differ."""
    front, rear = draw(surfaces(conics=conics)), draw(surfaces(conics=conics))
    depth = float(sum(0.4 * np.hypot(*s.half_width) for s in (front, rear)))
    thickness, index = depth * draw(st.floats(1.01, 2.0)) + 7.0, draw(st.floats(1.01, 2.5))
    try:
        return require_sound(Lens(front, rear, thickness, index))
    except ValueError as error:  # some ruled edges between unequal rims cross a surface
        if "ruled edge" in str(error) or "front and rear" in str(error):
            reject()
        raise


def corner_sag(degree=(3, 3), steps=2, amplitude=0.1, right=False, low=-0.0):
    """A sag over 4 x 4 spans, refined `steps` times in one corner."""
    space = THBSpace(*(KnotVector.uniform(p, 4) for p in degree))
    for level in range(steps):
        n = (4 << level) - 4 if right else 0
        space = space.refine({level: [(n + i, n + j) for i in range(4) for j in range(4)]})
    return THBSurface(space, low + amplitude * np.sin(np.arange(space.dim)))


LENSES = {
    "plano": Lens(FreeformSurface((10, 8)), FreeformSurface((10, 8), Conic(-80.0, -1.0)), 5.0, 1.5),
    "freeform": Lens(
        FreeformSurface((10, 8)), FreeformSurface((10, 8), Conic(150.0, -1.0), corner_sag()), 5.0, 1.5
    ),
    "paraboloids": Lens(
        FreeformSurface((9, 9), Conic(60.0, -1.0)),
        FreeformSurface((9, 9), Conic(-70.0, -1.0), corner_sag()),
        6.0,
        1.5,
    ),
    "sphere": Lens(
        FreeformSurface((5, 4), Conic(-40.0, 0.0)), FreeformSurface((5, 4), Conic(-60.0, -2.5)), 4.0, 1.5
    ),
    "table63": Lens(
        FreeformSurface((5, 5), Conic(-5.0, -1.0)), FreeformSurface((8, 8), Conic(-10.0, -1.0)), 5.0, 1.5
    ),
    "ruled": Lens(
        FreeformSurface((5, 4), Conic(-90.0, -1.0)),
        FreeformSurface((4, 8), Conic(50.0, -1.0), corner_sag((4, 4))),
        6.0,
        1.5,
    ),
    "wider": Lens(FreeformSurface((5, 4), Conic(-30.0, 0.0)), FreeformSurface((6, 4)), 3.0, 1.5),
    "deeper": Lens(FreeformSurface((5, 4), Conic(40.0, -1.0)), FreeformSurface((5, 7)), 3.0, 1.5),
    "awkward": Lens(
        FreeformSurface((10.988357457165069, 1 / 3), Conic(), corner_sag(amplitude=0.01)),
        FreeformSurface((11 + 1 / 7, 0.36), Conic(33.0, -1.0), corner_sag(amplitude=0.01)),
        np.pi,
        1.5,
    ),
}


def bits(array):
    return np.ascontiguousarray(array, dtype=np.float64).tobytes()


def assert_same_surface(a, b):
    """Splines, or conics with the numbers that files hold of them."""
    if isinstance(b, PlacedConic):
        assert bits(a.numbers + 0.0) == bits(b.numbers + 0.0)
        # BREP holds vertices to 15 digits
        assert a.half_width == pytest.approx(b.half_width, rel=1e-14)
        return
    assert (a.kv_u.degree, a.kv_v.degree) == (b.kv_u.degree, b.kv_v.degree)
    assert bits(a.kv_u.knots + 0.0) == bits(b.kv_u.knots + 0.0)
    assert bits(a.kv_v.knots + 0.0) == bits(b.kv_v.knots + 0.0)
    assert a.coefficients.shape == b.coefficients.shape
    # 0.0 and -0.0 are the same place
    assert bits(a.coefficients + 0.0) == bits(b.coefficients + 0.0)


def assert_holds(read, lens):
    """A file of a solid holds every number of front and rear."""
    for face, own in zip((read.front, read.rear), optical_forms(lens), strict=True):
        assert_same_surface(face, own)


@st.composite
def nurbs_surfaces(draw, max_degree=4, max_spans=3):
    kv_u, kv_v = (draw(knot_vectors(max_degree=max_degree, max_spans=max_spans)) for _ in range(2))
    rng, shape = draw(seeds()), (kv_u.dim, kv_v.dim)
    return NURBSSurface(kv_u, kv_v, rng.uniform(-1, 1, (*shape, 3)), 10 ** rng.uniform(-1, 1, shape))


def scipy_twin(surface):
    """The same polynomial surface, by scipy alone."""
    kv_u, kv_v = surface.knot_vectors
    return NdBSpline((kv_u.knots, kv_v.knots), surface.coefficients, (kv_u.degree, kv_v.degree))
