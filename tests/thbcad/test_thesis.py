"""The numbers of chapter 3 of the thesis (A. N. M. Heemels, Composing Light, TU Delft), corrected where the
print errs.

Its example knot vector {0, 0, 0, 0.25, 0.5, 0.75, 1, 1, 1} has degree 2 (printed: 3).
"""

import re
import subprocess
import sys
from fractions import Fraction
from functools import reduce
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, strategies as st

from oracles.spline_definitions import cox_de_boor, gamma
from tests.cases import ROOT
from thbcad import BSplineSurface, KnotVector, THBSpace

KNOTS = KnotVector.uniform(2, 4)
SQUARE = THBSpace(KNOTS, KNOTS)
CELLS = [(0, 0), (1, 2)]  # [0, 0.25] x [0, 0.25] and [0.25, 0.5] x [0.5, 0.75]


def strips(*refined):
    """A one-dimensional space: strips of the square over one span in v; for each level the spans in u that
    are cut."""
    space = THBSpace(KNOTS, KnotVector.uniform(1, 1))
    for level, spans in enumerate(refined):
        space = space.refine({level: [(i, j) for i in spans for j in range(2**level)]})
    return space


def over_v(space):
    """(dim, functions of u): sums over the functions (level, i, j) with the same level and i; and these
    (level, i)."""
    pairs, group = np.unique(space.functions[:, :2], axis=0, return_inverse=True)
    return 1.0 * (group.ravel()[:, None] == np.arange(len(pairs))), pairs.tolist()


def level_1_weights(space, basis):
    """(10, functions of u): a basis of strips in terms of the functions of level 1."""
    p = space.prolongation(strips(range(4))) @ basis @ over_v(space)[0]
    weights = p.reshape(10, 3, -1)
    assert (weights == weights[:, :1]).all()  # constant in v
    return weights[:, 0]


# 3.2: the basis


@pytest.mark.parametrize("degree", [1, 2])
def test_figure_3_3(degree):
    """On {0, 0.1, 0.2, 0.3} the functions are those of the clamped vector that reach no repeated knot."""
    breaks = [0, 0.1, 0.2, 0.3]
    kv, u = KnotVector(degree, np.pad(breaks, degree, mode="edge")), np.linspace(0, 0.3, 31)[:-1]
    got = kv.collocation(u).toarray()[:, degree:3]
    for row, x in zip(got, u):
        values, sizes = cox_de_boor(breaks, degree, x)
        assert len(row) == len(values) == 3 - degree
        assert all(
            abs(Fraction(a) - b) <= gamma(5 * degree) * s for a, b, s in zip(row.tolist(), values, sizes)
        )


@given(st.integers(1, 6), st.integers(1, 20))
def test_counts_of_functions_and_spans(degree, spans):
    """Knots u_0 ... u_m carry N = m - p functions, and a uniform vector has the spacing 1 / (N - p) (the
    print: one less)."""
    kv = KnotVector.uniform(degree, spans)
    assert kv.dim == (len(kv.knots) - 1) - degree
    assert np.diff(kv.breaks) == pytest.approx(1 / (kv.dim - degree))


# 3.3.1: knot insertion


def test_alpha_and_beta_3_24():
    """The entries of R = P.T against (3.20) in exact arithmetic of the same float64 knots."""
    finer = KNOTS.insert(0.4)
    r = KNOTS.prolongation(finer).T.toarray()
    t, x = [Fraction(k) for k in finer.knots.tolist()], Fraction(0.4)
    wanted = np.zeros((6, 7), dtype=object)
    wanted[0, 0] = wanted[4, 5] = wanted[5, 6] = Fraction(1)
    for i in (1, 2, 3):
        wanted[i, i] = (x - t[i]) / (t[i + 3] - t[i])
        wanted[i, i + 1] = (t[i + 4] - x) / (t[i + 4] - t[i + 1])
    assert all(abs(Fraction(a) - b) <= gamma(10) * b for a, b in zip(r.ravel().tolist(), wanted.ravel()))
    assert [r[i, i] for i in (1, 2, 3)] == pytest.approx([1, 0.8, 0.3])
    assert [r[i, i + 1] for i in (1, 2, 3)] == pytest.approx([0.2, 0.7, 1])


def test_new_control_points_3_23():
    """C~ = R.T C: every component of a surface, and the surface stays."""
    net = np.random.default_rng(1).uniform(-1, 1, (6, 6, 3))
    surface, r = BSplineSurface(KNOTS, KNOTS, net), KNOTS.prolongation(KNOTS.insert(0.4)).T.toarray()
    finer, u = surface.insert([0.4]), np.linspace(0, 1, 23)
    assert finer.coefficients.shape == (7, 6, 3)
    assert abs(finer.coefficients - np.einsum("ij,ikd->jkd", r, net)).max() <= float(
        2 * gamma(2)
    )  # the same two products and sum
    # convex combinations: 5 p roundings per direction, 3 products and sums each; on both sides, and those of
    # R
    assert abs(finer.grid(u, u) - surface.grid(u, u)).max() <= float(gamma(2 * (2 * 10 + 6) + 12))


# 3.3.2: over-refinement


def test_over_refinement_of_figure_3_6():
    """36, 42 and 49 functions; to cut two cells, knots cut seven."""
    spaces = [THBSpace(KNOTS.insert(u), KNOTS.insert(v)) for u, v in (([], []), ([0.4], []), ([0.4], [0.1]))]
    assert [s.dim for s in spaces] == [36, 42, 49]
    assert [len(s.cells) for s in spaces] == [16, 20, 25]
    u0, u1, v0, v1 = spaces[2].boxes.T
    small = (u1 - u0) * (v1 - v0) < 1 / 16
    assert len({(int(2 * (a + b)), int(2 * (c + d))) for a, b, c, d in spaces[2].boxes[small].tolist()}) == 7


def test_cells_alone_of_figure_3_6():
    """The corner cell brings 4 functions for 1; the inner cell none until it is cut twice or joined by its
    neighbours."""
    both = SQUARE.refine({0: CELLS})
    assert (len(both.cells), both.dim) == (16 + 6, 36 + 3)
    assert both.dim == SQUARE.refine({0: CELLS[:1]}).dim
    assert both.refine({1: [(i, j) for i in (2, 3) for j in (4, 5)]}).dim == 39 + 4
    assert SQUARE.refine({0: [(i, j) for i in (1, 2) for j in (1, 2)]}).dim == 36 + 4


@pytest.mark.parametrize(("degree", "gain"), [(1, 1), (2, 0), (3, 0), (4, 0), (5, 0)])
def test_a_lone_inner_cell_adds_nothing_from_degree_2_on(degree, gain):
    kv = KnotVector.uniform(degree, 5)
    space = THBSpace(kv, kv)
    assert space.refine({0: [(2, 2)]}).dim - space.dim == gain


@st.composite
def intervals(draw, spans):
    start = draw(st.integers(0, spans - 1))
    return start, draw(st.integers(start + 1, spans))


@given(
    st.integers(1, 4), st.integers(1, 7).flatmap(lambda n: st.tuples(st.just(n), intervals(n), intervals(n)))
)
def test_functions_that_a_block_of_cells_adds(degree, case):
    """A block of a x b cells holds f(a) f(b) functions, f(k) = max(0, k - p + p e) with e ends of the domain;
    bisection doubles k."""
    spans, *sides = case
    kv = KnotVector.uniform(degree, spans)
    space = THBSpace(kv, kv)
    ends = [degree * ((start == 0) + (stop == spans)) for start, stop in sides]
    fine, coarse = (
        [max(0, k * (stop - start) - degree + e) for (start, stop), e in zip(sides, ends)] for k in (2, 1)
    )
    finer = space.refine({0: [(i, j) for i in range(*sides[0]) for j in range(*sides[1])]})
    assert finer.dim - space.dim == fine[0] * fine[1] - coarse[0] * coarse[1]


# 3.3.3: the truncated hierarchical basis


def test_two_levels_3_25_to_3_28():
    """Bisection of the non-empty spans, and its matrix as a product of single insertions; all numbers are
    dyadic, so all is exact."""
    finer = KNOTS.bisect()
    assert finer.knots.tolist() == [0, 0, 0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1, 1, 1]
    assert (KNOTS.dim, finer.dim) == (6, 10)
    chain = reduce(lambda kvs, u: [*kvs, kvs[-1].insert(u)], (0.125, 0.375, 0.625, 0.875), [KNOTS])
    r = reduce(np.matmul, [a.prolongation(b).T.toarray() for a, b in pairwise(chain)])
    assert (r == KNOTS.prolongation(finer).T.toarray()).all()


@given(st.integers(1, 6), st.integers(1, 12))
def test_size_of_the_refinement_matrix_3_35(degree, spans):
    """From N functions to 2 (N - p) + p (printed: from 2^l N to 2^(l+1) N)."""
    kv = KnotVector.uniform(degree, spans)
    assert kv.prolongation(kv.bisect()).T.shape == (kv.dim, 2 * (kv.dim - degree) + degree)


def test_decomposition_3_29_to_3_31():
    """The last weight of N_1 is 1/4 (printed: 1/2)."""
    r = KNOTS.prolongation(KNOTS.bisect()).T.toarray()
    assert r[0].tolist() == [1, 1 / 2, 0, 0, 0, 0, 0, 0, 0, 0]
    assert r[1].tolist() == [0, 1 / 2, 3 / 4, 1 / 4, 0, 0, 0, 0, 0, 0]
    assert r[2].tolist() == [0, 0, 1 / 4, 3 / 4, 3 / 4, 1 / 4, 0, 0, 0, 0]
    assert (r.sum(axis=0) == 1).all()  # with the printed 1/2 the functions would not sum to one


def test_the_bases_on_half_the_domain():
    """The functions N_0^1 ... N_3^1, N_2^0 ... N_5^0 of the sets H and T."""
    assert over_v(strips([0, 1]))[1] == [[0, 2], [0, 3], [0, 4], [0, 5], [1, 0], [1, 1], [1, 2], [1, 3]]


def test_truncation_3_32():
    """N_2^0 keeps 3/4 N_4^1 + 1/4 N_5^1, the others keep everything."""
    space = strips([0, 1])
    truncated = level_1_weights(space, np.eye(space.dim))
    hierarchical = level_1_weights(space, space.hierarchical().toarray())
    assert truncated[:, 0].tolist() == [0, 0, 0, 0, 3 / 4, 1 / 4, 0, 0, 0, 0]
    assert hierarchical[:, 0].tolist() == [0, 0, 1 / 4, 3 / 4, 3 / 4, 1 / 4, 0, 0, 0, 0]
    assert (truncated[:, 1:] == hierarchical[:, 1:]).all()
    assert (truncated.sum(axis=1) == 1).all()
    assert hierarchical.sum(axis=1).tolist() == [1, 1, 5 / 4, 7 / 4, 1, 1, 1, 1, 1, 1]


def test_the_hierarchical_basis_exceeds_one():
    """Its sum is 1 + N_2^1 / 4 + 3 N_3^1 / 4, at most 8/5 (at u = 3/10); the truncated basis sums to one."""
    space, u = strips([0, 1]), np.r_[np.linspace(0, 1, 1001), 0.3]
    values = space.collocation(u, np.full_like(u, 0.4)).toarray()
    hierarchical = (values @ space.hierarchical().toarray()).sum(axis=1)
    # 5 p roundings in each univariate value, their product, exact weights, and sums of 20 functions and 6
    # B-splines; sums are below 2
    tolerance = float(2 * gamma(10 + 5 + 1 + 20 + 6))
    assert abs(values.sum(axis=1) - 1).max() <= tolerance
    assert hierarchical[-1] == pytest.approx(1.6, abs=tolerance)
    assert hierarchical.max() <= 1.6 + tolerance
    assert abs(hierarchical[u >= 0.5] - 1).max() <= tolerance
    assert (hierarchical[(u > 0) & (u < 0.5)] > 1).all()


def test_refinement_without_new_functions():
    """[0.25, 0.5] alone: nothing new at level 1, two functions at level 2 (its note in 3.3.3)."""
    counts = [len(over_v(strips(*refined))[1]) for refined in ([], [[1]], [[1], [2, 3]])]
    assert counts == [6, 6, 8]


def test_masks_are_two_dimensional_3_37_to_3_39():
    """On [0, 0.5] x [0, 0.5] the printed one-dimensional masks lose the ones of a net of ones; entry by entry
    they stay."""
    r = KNOTS.prolongation(KNOTS.bisect()).toarray()
    x = np.arange(10) < 4  # the functions of level 1 with support in [0, 0.5]
    refined, ones = r @ np.ones((6, 6)) @ r.T, np.ones((10, 10))
    inside = np.outer(x, x)
    assert (np.where(inside, ones, refined) == 1).all()
    printed = np.outer(~x, ~x) * refined + inside * ones
    assert printed.sum() == 100 - 2 * 4 * 6
    half = SQUARE.refine({0: [(i, j) for i in (0, 1) for j in (0, 1)]})
    full = SQUARE.refine({0: [(i, j) for i in range(4) for j in range(4)]})
    rng = np.random.default_rng(2)
    coarse, fine = rng.uniform(-1, 1, (2, 10, 10))
    active = ~np.outer(np.arange(6) < 2, np.arange(6) < 2)
    net = np.where(inside, fine, r @ np.where(active, coarse[:6, :6], 0) @ r.T)
    got = half.prolongation(full) @ np.r_[coarse[:6, :6][active], fine[inside]]
    assert abs(got.reshape(10, 10) - net).max() <= float(gamma(16))  # at most 9 products of exact weights


def test_uniform_degrees_of_freedom():
    """(7 * 2^l + 3)^2 for degree 3 and 7 spans, counted over cells that are all cut."""
    kv = KnotVector.uniform(3, 7)
    space, counts = THBSpace(kv, kv), []
    for level in range(6):
        assert space.dim == kv.dim**2 == (7 * 2**level + 3) ** 2
        counts.append(space.dim)
        space, kv = space.refine({level: space.cells[:, 1:]}), kv.bisect()
    assert counts == [100, 289, 961, 3481, 13225, 51529]


# the documented example


@pytest.mark.slow
def test_the_example_draws_and_counts(tmp_path):
    done = subprocess.run(
        [sys.executable, ROOT / "examples/splines.py", tmp_path / "new"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.splitlines() == [
        "functions: 36 42 49 39 43 43",
        "largest sum: truncated basis 1.000000, hierarchical basis 1.600000",
    ]
    pictures = sorted((tmp_path / "new").iterdir())
    assert [p.name for p in pictures] == [
        "basis.png",
        "insertion.png",
        "refinement.png",
        "surface.png",
        "truncation.png",
    ]
    assert all(p.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n" and p.stat().st_size > 10_000 for p in pictures)


def test_the_pictures_of_the_page_are_those_of_the_example():
    shown = re.findall(r"\]\((\S+\.png)\)", (ROOT / "docs/thesis/chapter3.md").read_text("utf-8"))
    assert {(ROOT / "docs/thesis" / link).resolve() for link in shown} == {
        p.resolve() for p in (ROOT / "examples/splines").glob("*.png")
    }
    assert len(shown) == 5
