"""Loss landscapes of two sources, and the marked points of Figures 7.7 and 7.8."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from examples.thesis.chapter7.two_source_landscape import MARKS, disk, landscape, square, two_sources
from optics.base.workers import worker_pool
from optics.designing.etendue import Kernel, approximate


@pytest.fixture(scope="module", params=[square, disk], ids=["square", "disk"])
def case(request):
    target = request.param()
    return request.param.__name__, target, landscape(target, 6)


def test_the_targets_have_their_areas():
    assert square().sum() == 64**2
    assert_allclose(
        disk().sum() / 128**2, np.pi * 0.33**2, rtol=1e-2
    )  # pixels along the edge, 2 pi 42 of 5600, half each way


@pytest.mark.every(4)
def test_every_position_is_certified(case):
    _, _, result = case
    assert result.residual.shape == (7, 7)
    assert result.kkt.max() <= 1e-8
    assert (result.residual - result.lower_bound).max() <= 1e-8
    assert (result.lower_bound <= result.residual).all()


def test_a_landscape_has_the_symmetry_of_its_target(case):
    _, _, result = case
    assert_allclose(result.residual, result.residual.T, atol=1e-12)
    assert result.residual[0, 0] == 0


def test_a_square_is_made_where_shifts_divide_it():
    """Along the axes the analytic responses exist where 2 m divides 64; elsewhere none does, by the zeros of
    the pair."""
    target = square()
    for m in range(1, 21):
        assert (two_sources(target, m, 0).residual <= 1e-8) == (64 % (2 * m) == 0)
        assert (two_sources(target, 0, m).residual <= 1e-8) == (64 % (2 * m) == 0)


@pytest.mark.every(3)
@pytest.mark.parametrize(("shape", "m", "n"), [(shape, *mark) for shape in MARKS for mark in MARKS[shape]])
def test_the_marked_points_agree_with_the_general_solver(shape, m, n):
    target = {"square": square, "disk": disk}[shape]()[64:-64, 64:-64]
    exact = two_sources(target, m, n)
    general = approximate(Kernel.points([(0, 0), (n, m)], [1, 1]), target, 1e-5)
    assert general.lower_bound - 1e-10 <= exact.residual <= general.residual + 1e-10
    assert general.residual - exact.residual <= 1e-4


def test_a_greater_distance_is_worse_for_the_disk():
    """What Figure 7.8 shows, at its marks."""
    near, middle, far = (two_sources(disk(), *mark).residual for mark in MARKS["disk"])
    assert near < middle < far


@pytest.mark.slow
def test_a_landscape_by_workers_is_the_same():
    found = landscape(square(), 2)
    with worker_pool(2) as pool:
        by_workers = landscape(square(), 2, pool)
    for name in ("residual", "lower_bound", "kkt"):
        assert np.array_equal(getattr(by_workers, name), getattr(found, name))
