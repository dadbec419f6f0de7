"""Against exact rational arithmetic: degrees, deep levels, graded knots, offsets, and long walks of
refinement and coarsening."""

from itertools import islice

import numpy as np
import pytest
from hypothesis import given, strategies as st

from oracles.exact_splines import ExactAxis, ExactTHB, roundings
from oracles.kernel_accuracy import coarsened, deepest, measure, projection_defect, window
from oracles.spline_definitions import DefinitionTHB, boehm, gamma
from oracles.stresses import STRESSES, clamped, corner, random_breaks
from tests.cases import examples, slow_unless
from tests.thbcad.cases import coefficients, hierarchies, knot_vectors, points, seeds
from thbcad import KnotVector, THBSpace, THBSurface

# ---- the exact twin ----


@given(knot_vectors(max_degree=5, max_spans=4))
def test_the_twin_refines_as_knots_are_inserted(kv):
    """The local rows are those of Boehm's algorithm on the whole knot vector, exactly."""
    axis, finer = ExactAxis(kv), kv.bisect()
    new = kv.breaks[:-1] + np.diff(kv.breaks) / 2
    assert [axis.position(1, k) for k in range(1, 2 * kv.spans, 2)] == new.tolist()
    rows = [[axis.two_scale(1, i).get(j, 0) for j in range(kv.dim)] for i in range(finer.dim)]
    assert rows == boehm(kv.knots, kv.degree, new)


@examples(15)
@given(st.data())
def test_the_twin_is_the_spline_by_definition(data):
    space, refined = data.draw(hierarchies(max_spans=3, deepest=2))
    u, v = data.draw(points(space))
    surface = THBSurface(space, data.draw(coefficients(space.dim)))
    twin, definition = ExactTHB(surface), DefinitionTHB(space.kv_u, space.kv_v, refined)
    # 4 roundings per inserted knot in the definition, 5 per degree in its evaluation, and the kernel's own
    # count
    bound = 4 * sum(len(k) for k in definition.knots) + 5 * sum(definition.degrees) + roundings(space)
    exact = np.array([float(twin(a, b)[0]) for a, b in zip(u.tolist(), v.tolist())])
    assert abs(definition.collocation(u, v) @ surface.coefficients - exact).max() <= float(gamma(bound))


# ---- the table of `thbcad bench stability`, every 27th case; every ninth is slow ----


@pytest.mark.every(2)
@pytest.mark.parametrize(
    ("name", "cases"),
    [(name, cases) for name, cases, _ in STRESSES],
    ids=lambda x: x if isinstance(x, str) else "",
)
@pytest.mark.parametrize("every", slow_unless((27,).__contains__, [27, 9]))
def test_errors_stay_below_their_number_of_roundings(name, cases, every):
    rng = np.random.default_rng(7)
    for case in islice(cases(rng), 0, None, 2 * every + 1 if name.startswith("span") else every):
        for quantity, (error, limit) in measure(case.space, rng).items():
            assert error <= limit, (case.label, quantity, error, limit)


@pytest.mark.parametrize("depth", [0, 4, 9, 20])
def test_derivatives_in_coarse_cells_beside_deep_ones(depth):
    """At a coarse cell in the columns of deep ones; up to level 8 the tensor-product form costs a factor of 2
    for each level."""
    kv = KnotVector.uniform(3, 8)
    space = corner(kv, kv, depth, 4)
    surface = THBSurface(space, np.random.default_rng(1).uniform(-1, 1, space.dim))
    twin, u, v = ExactTHB(surface), 0.3 / 8 / 2**depth, 0.9
    exact, scale = twin(u, v, (1, 0))
    error = abs(surface([u], [v], (1, 0))[0] - float(exact))
    assert error <= float(gamma(roundings(space)) * scale) * (2**depth if depth <= 8 else 1)


@pytest.mark.parametrize("ratio", [1e-2, 1e-4, 1e-8])
@pytest.mark.parametrize("degree", [3, 5, 7])
def test_restriction_on_graded_knots(degree, ratio):
    """Whole supports are refined: their functionals stay small for any knots."""
    kv = clamped(degree, np.r_[0, np.cumsum([1, ratio, ratio, ratio, ratio, 1])])
    space = THBSpace(kv, KnotVector.uniform(1, 1))
    defect, norm = projection_defect(space, space.refine({0: space.cells[:, 1:]}))
    assert norm < 12
    assert defect < 1e-14


def test_what_cannot_be_restored_is_named():
    """Two cells of 1e-7 are all that is whole, far from where the longest spans of the support lie."""
    kv = clamped(5, np.r_[0, np.cumsum([1e-4, 1e-7, 1e-7, 1e-7, 1e-7, 1e-2, 1e-3, 1e-2])])
    space = THBSpace(kv, KnotVector.uniform(1, 1))
    coarser = space.refine({0: [(i, 0) for i in range(8) if i not in (2, 3)]})
    finer = coarser.refine({0: [(2, 0), (3, 0)]})
    with pytest.raises(
        ValueError,
        match=r"function \(8, 0\) of level 0 cannot be restored in float64: .* make more cells whole",
    ):
        finer.restriction(coarser)
    assert projection_defect(space, finer)[0] < 1e-14


@pytest.mark.parametrize("degree", range(1, 11))
def test_restriction_inverts_prolongation(degree):
    """To the row sums of |Q|, on spans of ratios up to 4: `thbcad bench stability` shows what steeper grading
    does from degree 4 on."""
    rng = np.random.default_rng(degree)
    space = THBSpace(*(clamped(degree, random_breaks(rng, degree + 3)) for _ in range(2)))
    finer = space.refine({0: np.argwhere(np.ones((degree + 2, degree + 2)))})
    assert finer.dim > space.dim
    defect, norm = projection_defect(space, finer)
    assert defect <= float(gamma(roundings(finer))) * norm


# ---- walks ----


@pytest.mark.slow
@examples(80)
@given(st.integers(1, 3), st.integers(1, 3), seeds())
def test_short_walks(p, q, rng):
    """Refine keeps the surface; coarsen then gives back space and coefficients; functions are non-negative
    and sum to one."""
    space = THBSpace(clamped(p, random_breaks(rng, p + 2)), clamped(q, random_breaks(rng, q + 2)))
    surface = THBSurface(space, rng.uniform(-1, 1, space.dim))
    for _ in range(2):
        cells = window(surface.space, rng)
        finer = surface.refine(cells)
        u, v = (kv.start + (kv.stop - kv.start) * rng.random(8) for kv in (space.kv_u, space.kv_v))
        weights, limit = finer.space.collocation(u, v), float(gamma(3 * roundings(finer.space)))
        assert weights.data.min() >= 0
        assert abs(weights.sum(axis=1) - 1).max() <= limit
        assert abs(finer(u, v) - surface(u, v)).max() <= limit
        back = finer.space.coarsen(cells)
        assert np.array_equal(back.functions, surface.space.functions)
        restriction = finer.space.restriction(back)
        error = abs(restriction @ finer.coefficients - surface.coefficients).max()
        assert error <= limit * abs(restriction).sum(axis=1).max()
        assert error <= 1e-13
        surface = finer


@pytest.mark.slow
@pytest.mark.parametrize("degree", slow_unless((2,).__contains__, [1, 2, 3, 5]))
def test_a_long_walk_changes_the_surface_only_where_cells_are_made_whole(degree):
    """Thirty steps with new detail in each.  Refining changes it nowhere; coarsening only where one space has
    a function that the other lacks."""
    rng = np.random.default_rng(degree)
    kvs = [clamped(degree, random_breaks(rng, degree + 4)) for _ in range(2)]
    surface = THBSurface(space := THBSpace(*kvs), rng.uniform(-1, 1, space.dim))
    u, v = (kv.start + (kv.stop - kv.start) * rng.random(60) for kv in kvs)
    kept = changed = 0
    for _ in range(30):
        before = surface(u, v)
        surface = surface.refine(window(surface.space, rng))
        limit = float(gamma(3 * roundings(surface.space)))
        assert abs(surface(u, v) - before).max() <= limit * abs(surface.coefficients).max()
        surface = THBSurface(surface.space, rng.uniform(-1, 1, surface.space.dim))
        coarse = coarsened(surface, int(rng.integers(surface.space.levels - 1)), rng)
        same = ~(touched(surface.space, coarse.space, u, v) | touched(coarse.space, surface.space, u, v))
        difference = abs(coarse(u, v) - surface(u, v))
        assert (difference[same] <= limit * max(1.0, abs(coarse.coefficients).max())).all()
        kept, changed = kept + same.sum(), changed + (difference > 1e-3).sum()
        surface = coarse if rng.random() < 0.5 else surface
    assert kept > 50
    assert changed > 50


def touched(space, other, u, v):
    """Return where a function acts that the other space lacks."""
    known = set(map(tuple, other.functions.tolist()))
    lacking = [k for k, f in enumerate(map(tuple, space.functions.tolist())) if f not in known]
    return space.collocation(u, v)[:, lacking].sum(axis=1) > 0


# ---- where input is refused ----


@pytest.mark.every(2)
@pytest.mark.parametrize(
    ("kv", "level", "sentence"),
    [
        (
            KnotVector.uniform(3, 1, 1e6, 1e6 + 1e-3),
            23,
            "level 24 is too deep: neighbouring knots coincide in float64",
        ),
        (
            KnotVector.uniform(3, 8, 1e6, 1e6 + 1e-6),
            10,
            "level 11 is too deep: neighbouring knots coincide in float64",
        ),
        (KnotVector.uniform(3, 8), 24, "level must be an integer from 0 to 23, got 24"),
        (KnotVector.uniform(1, 256), 23, "cells cannot be counted in 64 bits"),
    ],
    ids=["offset", "small-and-offset", "most-levels", "64-bit"],
)
def test_the_deepest_level(kv, level, sentence):
    """A span s at an offset x can be halved while s / 2^level is at least the spacing of float64 at x."""
    reached, refused = deepest(kv, min(kv.spans, 4))
    assert reached == level
    assert sentence in refused


def test_children_that_64_bits_cannot_count_are_refused():
    """215^2 4^23 cells of level 23 are less than 2^62, their children more than 2^63."""
    space = THBSpace(KnotVector.uniform(1, 215), KnotVector.uniform(1, 215))
    for level in range(23):
        space = space.refine({level: [((215 << level) - 1, (215 << level) - 1)]})
    assert space.cells[-1].tolist() == [23, (215 << 23) - 1, (215 << 23) - 1]
    with pytest.raises(ValueError, match=r"level 24 is too deep: its .* cells cannot be counted in 64 bits"):
        space.refine({23: [((215 << 23) - 1, (215 << 23) - 1)]})


@pytest.mark.slow
def test_restriction_over_many_levels_is_exact_or_refused():
    """Degree 10: every level more costs a factor of 14 to 20."""
    kv = KnotVector.uniform(10, 12)
    space = base = THBSpace(kv, kv)
    block = [(i, j) for i in range(5) for j in range(5)]
    for level in range(11):
        space = space.refine({level: block})
        if level % 3 == 2:
            q = space.restriction(base)
            assert (
                abs(q @ base.prolongation(space) - np.eye(base.dim)).max()
                <= 10 * np.finfo(float).eps * abs(q).sum(axis=1).max()
            )
    with pytest.raises(
        ValueError, match=r"cannot be restored at once in float64: the operator has norm .*e.12"
    ):
        space.restriction(base)
