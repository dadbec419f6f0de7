"""Continuations beside an outline against dense linear algebra and sampled supports."""

import numpy as np
import pytest

from thbcad.fitting import Continuation
from thbcad.fitting.normal_equations import thin_plate
from thbcad.hierarchy import THBSpace
from thbcad.outlines import Outline
from thbcad.splines import KnotVector

OUTLINES = {"disk": (1.0, 1.0), "ellipse of another box": (3.0, 0.5), "rounded": (2.0, 2.0)}


def space_of(degree):
    """A rectangle beside the origin, refined at one side and at two levels."""
    knots = (KnotVector.uniform(degree, n, *ends) for n, ends in ((6, (1.0, 4.0)), (5, (-2.0, 0.5))))
    space = THBSpace(*knots).refine({0: [(i, j) for i in range(3) for j in range(5)]})
    return space.refine({1: [(i, j) for i in range(3) for j in range(3, 8)]})


@pytest.fixture(params=[2, 3])
def space(request):
    return space_of(request.param)


@pytest.fixture(params=OUTLINES)
def outline(request):
    corners = OUTLINES[request.param]
    return Outline((2.5, 3.0), corners) if request.param == "rounded" else Outline(corners, corners)


def test_functions_are_free_with_a_quarter_of_their_support_inside(space, outline):
    """By 300 x 300 points: those whose share is within 2 % of a quarter are left out."""
    beside = Continuation(space, outline)
    u, v = (kv.start + (kv.stop - kv.start) * (np.arange(300) + 0.5) / 300 for kv in (space.kv_u, space.kv_v))
    x, y = (h * (2 * np.arange(300) + 1 - 300) / 300 for h in outline.half_width)
    inside = outline.contains(x[:, None], y).ravel()
    acts = (space.collocation(np.repeat(u, 300), np.tile(v, 300)) != 0).astype(float)
    share = (acts.T @ inside) / acts.sum(axis=0)
    certain = abs(share - 0.25) > 0.02
    assert (beside.free == (share >= 0.25))[certain].all()
    assert 0.5 < beside.free.mean() < 1


def test_no_other_continuation_has_less_energy(space, outline):
    """The gradient of c^T E c by the coefficients that follow vanishes, to the rounding of E's solution."""
    beside = Continuation(space, outline)
    c = np.random.default_rng(1).standard_normal(space.dim)
    found, energy = beside(c), thin_plate(space).toarray()
    assert (found == c)[beside.free].all()
    follows = ~beside.free
    wanted = np.linalg.solve(
        energy[np.ix_(follows, follows)], -energy[np.ix_(follows, beside.free)] @ c[beside.free]
    )
    assert np.allclose(found[follows], wanted, rtol=0, atol=1e-9)
    assert np.allclose(beside(found), found, rtol=0, atol=1e-12)


def test_a_plane_is_continued_as_a_plane(space, outline):
    u, v = space.greville().T
    plane = 1 + 2 * u - 3 * v
    assert np.allclose(Continuation(space, outline)(plane), plane, rtol=0, atol=1e-9)


def test_the_adjoint_is_the_transpose(space, outline):
    beside = Continuation(space, outline)
    a, b = np.random.default_rng(2).standard_normal((2, space.dim))
    assert beside(a) @ b == pytest.approx(a @ beside.adjoint(b), rel=1e-9)


def test_a_rectangle_changes_nothing(space):
    beside = Continuation(space, Outline((1.0, 2.0)))
    c = np.random.default_rng(3).standard_normal(space.dim)
    assert beside.free.all()
    assert beside(c) is c
    assert beside.adjoint(c) is c
