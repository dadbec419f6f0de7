"""Which cells ask for refinement: the promised decrease cell by cell, and every indicator where a target has
one local feature."""

from contextlib import suppress
from fractions import Fraction

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.designing.optimisation.indicators import LEAST, promised_decrease, refined_once
from optics.designing.optimisation.loop import shape_lens
from optics.light.engines import ExactEngine
from tests.optics.cases import small_space, small_system
from tests.optics.designing.optimisation.cases import designed
from thbcad.hierarchy import THBSpace
from thbcad.splines import KnotVector


def space_of(degrees=(3, 3), spans=(4, 5), half_width=(10.0, 7.0), fine=True):
    """Return a space of up to three levels."""
    space = THBSpace(*(KnotVector.uniform(p, n, -h, h) for p, n, h in zip(degrees, spans, half_width)))
    if not fine:
        return space
    return space.refine({0: [(i, j) for i in range(1, 4) for j in range(3)]}).refine(
        {1: [(2, 1), (3, 1), (2, 2), (3, 2), (7, 0)]}
    )


SPACES = {
    "uniform": space_of(fine=False),
    "cubic": space_of(),
    "quadratic": space_of((2, 2)),
    "mixed": space_of((2, 3), (5, 4), (3.0, 10.0)),
    "no symmetry": small_space((10.0, 8.0)),
}
EACH = pytest.mark.parametrize("space", SPACES.values(), ids=SPACES.keys())


def boxes(space):
    """Return every leaf cell as shares of the rectangle, Fractions (x0, x1, y0, y1)."""
    counts = space.kv_u.spans, space.kv_v.spans
    return [
        tuple(Fraction(k + side, n << level) for k, n in zip((i, j), counts) for side in (0, 1))
        for level, i, j in space.cells.tolist()
    ]


def middle(space, function):
    """Return the middle of a B-spline on knots that go on evenly beyond the rectangle, moved onto it, as
    shares."""
    level, *place = function
    shares = []
    for i, kv in zip(place, (space.kv_u, space.kv_v)):
        centre = Fraction(2 * i + 1 - kv.degree, 2 * (kv.spans << level))  # of the spans i - p to i
        shares.append(min(max(centre, Fraction(0)), Fraction(1)))
    return shares


@EACH
@pytest.mark.parametrize("max_level", [0, 1, 2, 5])
def test_refined_once_cuts_every_cell_below_a_level(space, max_level):
    finer = refined_once(space, max_level)
    expected = set()
    for level, i, j in space.cells.tolist():
        if level < max_level:
            expected |= {(level + 1, 2 * i + a, 2 * j + b) for a in (0, 1) for b in (0, 1)}
        else:
            expected.add((level, i, j))
    assert {tuple(c) for c in finer.cells.tolist()} == expected
    c = np.random.default_rng(2).standard_normal(space.dim)
    assert (space.prolongation(finer) @ c).shape == (finer.dim,)


@pytest.mark.every(3)
@EACH
def test_the_promise_of_a_new_function_goes_to_the_cell_around_its_middle(space):
    """One function's gradient at a time: g^2 / (4 mean(probes^2)), all of it to cells that touch the middle;
    none for old functions."""
    finer = refined_once(space, 4)
    rng = np.random.default_rng(3)
    probes = rng.uniform(0.5, 2, (6, finer.dim)) * rng.choice((-1, 1), (6, finer.dim))
    half, g = np.mean(probes**2, axis=0), rng.standard_normal(finer.dim)
    old, cells = {tuple(f) for f in space.functions.tolist()}, boxes(space)
    total = np.zeros(len(cells))
    for k, function in enumerate(map(tuple, finer.functions.tolist())):
        found = promised_decrease(space, finer, np.where(np.arange(finer.dim) == k, g, 0.0), list(probes))
        total += found
        if function in old:
            assert not found.any()
            continue
        assert found.sum() == pytest.approx(g[k] ** 2 / (4 * half[k]), rel=1e-13)
        s, t = middle(space, function)
        for cell in np.flatnonzero(found):
            x0, x1, y0, y1 = cells[cell]
            assert x0 <= s <= x1
            assert y0 <= t <= y1
    np.testing.assert_allclose(
        promised_decrease(space, finer, g, list(probes)), total, rtol=1e-12, atol=1e-300
    )


def test_small_entries_of_the_diagonal_count_as_a_thousandth_of_the_mean():
    space = SPACES["uniform"]
    finer = refined_once(space, 4)
    probes = np.full((2, finer.dim), 2.0)
    probes[:, 10] = 1e-9
    half = np.maximum(np.mean(probes**2, axis=0), LEAST * np.mean(probes**2))
    found = promised_decrease(space, finer, np.ones(finer.dim), list(probes))
    assert half[10] == pytest.approx(4e-3 * (1 - 1 / finer.dim))
    assert found.sum() == pytest.approx((1 / (4 * half)).sum(), rel=1e-12)


def test_nothing_is_promised_without_new_functions():
    space = SPACES["cubic"]
    assert not promised_decrease(
        space, refined_once(space, 0), np.ones(space.dim), [np.ones(space.dim)]
    ).any()


@pytest.mark.parametrize("degree", [2, 3, 4])
@pytest.mark.parametrize("axis", [0, 1])
def test_the_promise_of_mirror_images_is_the_mirror_image(degree, axis):
    """Whatever lies on the line between two cells may favour neither."""
    space = space_of((degree, degree), (4, 4), (8.0, 8.0), fine=False)
    finer = refined_once(space, 1)
    # level 1 is uniform: its functions are a grid
    net = np.random.default_rng(4).uniform(0, 1, (8 + degree, 8 + degree))
    ones = [np.ones(finer.dim)]
    one, other = (
        promised_decrease(space, finer, g.ravel(), ones).reshape(4, 4) for g in (net, np.flip(net, axis))
    )
    np.testing.assert_allclose(other, np.flip(one, axis), rtol=1e-12)


# Designs


def blob(x, y, size=0.15, rows=48):
    """Return an even picture with one bright spot at (x, y), from -1 to 1, +y up."""
    t = (2 * np.arange(rows) + 1) / rows - 1
    light = 1 + 3 * np.exp(-((t[None, :] - x) ** 2 + (-t[:, None] - y) ** 2) / (2 * size**2))
    return np.round(255 * light / light.max()).astype(np.uint8)


PLATE = {  # every ray lands where it left the lens, so that the spot has its place there
    "lens.rear.radius": np.inf,
    "lens.rear.conic": 0.0,
    "target.half_width": [9.5, 9.5],
    "target.encoding": "linear",
    "optimizer.iterations": [4],
}
FREE = {"spans": [4, 4], "max_level": 1, "z_freedom": 0.4}
FREE_FRONT = {"lens.front.freeform": FREE}
ROOMY = {"lens.rear.freeform.z_freedom": 4.0, "lens.thickness": 10.0}
LEFT, RIGHT = (-0.45, 0.55), (0.55, -0.45)


def refined(folder, backend, start, indicator, place, more):
    """Return the first meshes that marking made, front first, and the finest cells' boxes in each."""
    changes = {
        "optimizer.start": start,
        "lens.rear.freeform.max_level": 2 if start == "transport" else 1,  # transport starts on level 1 here
        "refinement.indicator": indicator,
        "refinement.alpha": [1.25 if indicator == "slope" else 1.0],  # slopes differ a little everywhere
    }
    system = small_system(folder, PLATE | changes | more, image=blob(*place))
    first = designed(system, backend).checkpoints[0]
    return [sag.space.boxes[sag.space.cells[:, 0] == sag.space.levels - 1] for sag in first.sags]


RULES = [
    ("flat", "vertex", {}),
    ("flat", "decrease", {}),
    ("flat", "vertex", FREE_FRONT),
    ("flat", "decrease", FREE_FRONT),
    ("transport", "vertex", {}),
    ("transport", "decrease", {}),
    ("transport", "slope", {}),
]
# a rule that knows one corner alone fails at half of them
OFTEN = LEFT, RIGHT, RIGHT, LEFT, LEFT, RIGHT, LEFT


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("start", "indicator", "more", "place"),
    [
        pytest.param(*rule, place, marks=() if place is often else pytest.mark.slow)
        for rule, often in zip(RULES, OFTEN, strict=True)
        for place in (LEFT, RIGHT)
    ],
)
def test_cells_are_refined_around_the_feature(tmp_path, backend, start, indicator, place, more):
    """Within 2.5 mm of the spot, not so near the place opposite to it; less than a third of the lens, centred
    around the spot."""
    found = refined(tmp_path, backend, start, indicator, place, more)
    assert len(found) == 1 + bool(more)
    for boxes_of_one in found:
        x0, x1, y0, y1 = boxes_of_one.T
        area = (x1 - x0) * (y1 - y0)
        assert 0 < area.sum() < 400 / 3
        spot = 9.5 * np.array(place)
        for there, (x, y) in ((True, spot), (False, -spot)):
            near = (x0 - 2.5 <= x) & (x <= x1 + 2.5) & (y0 - 2.5 <= y) & (y <= y1 + 2.5)
            assert near.any() == there
        centre = [(area * (a + b) / 2).sum() / area.sum() for a, b in ((x0, x1), (y0, y1))]
        assert np.hypot(*(centre - spot)) < 5


@pytest.mark.every(2)
@pytest.mark.parametrize(
    "more",
    [
        {"optimizer.start": "flat"},
        {"optimizer.start": "flat"} | FREE_FRONT,
        ROOMY | FREE_FRONT,
        ROOMY | {"lens.front.freeform": FREE | {"spans": [3, 5]}},
        {"lens.front.radius": 60.0, "lens.rear.freeform.z_freedom": 0.02},
    ],
    ids=["flat", "flat, free front", "free front", "free front of other spans", "map beyond the bounds"],
)
def test_slopes_without_a_transport_start_or_with_a_free_front(tmp_path, backend, more):
    """The design refines the rear, or one sentence says why not."""
    system = small_system(tmp_path, {"refinement.indicator": "slope", "target.pixels": [32, 32]} | more)
    with suppress(UserError):
        shaped, _ = shape_lens(system, backend, ExactEngine(backend))
        lens = shaped.designed
        assert len(lens.rear.sag.space.cells) > 16
