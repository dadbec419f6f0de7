"""The optimiser's variables: where they start, that they keep the bounds, and their adjoint."""

import numpy as np
import pytest

from optics.designing.optimisation.bounded_variables import BoundedVariables
from tests.optics.cases import rough, small_space
from tests.optics.designing.optimisation.cases import check_adjoint
from thbcad.surfaces import THBSurface

BOUND = 0.7
BOUNDS = 0.7, 0.02


def variables(height=0.3):
    space = small_space()
    sag = THBSurface(space, rough(space, height))
    return BoundedVariables([sag], [BOUND]), sag


def pair():
    """Return the variables of two sags with bounds of their own."""
    spaces = small_space(), small_space((6.0, 8.0), refined=False)
    sags = [
        THBSurface(space, rough(space, 0.9 * bound, seed))
        for seed, (space, bound) in enumerate(zip(spaces, BOUNDS))
    ]
    return BoundedVariables(sags, BOUNDS), sags


@pytest.mark.parametrize("height", [0.0, 0.3, 0.98 * BOUND])
def test_zero_weights_are_the_start(height):
    found, sag = variables(height)
    # at 0.98 of the bound the squashing is steep: its inverse has slope 1 / (1 - 0.98^8) = 7
    np.testing.assert_allclose(
        found.coefficients(found.zeros())[0][0], sag.coefficients, rtol=0, atol=1e-15 * BOUND * 10
    )


@pytest.mark.parametrize("outside", [BOUND, 1.5 * BOUND])
def test_a_start_on_the_bound_is_moved_inside(outside):
    space = small_space()
    found = BoundedVariables([THBSurface(space, np.full(space.dim, -outside))], [BOUND])
    (c,), _ = found.coefficients(found.zeros())
    assert (c > -BOUND).all()
    np.testing.assert_allclose(c, -BOUND, rtol=0.011)


@pytest.mark.parametrize("size", [1.0, 1e2, 1e4, 1e8])
def test_coefficients_never_pass_the_bound(size):
    found, _ = pair()
    rng = np.random.default_rng(1)
    for _ in range(20):
        made, _ = found.coefficients(rng.standard_normal(len(found.zeros())) * size)
        for c, bound in zip(made, BOUNDS, strict=True):
            assert np.isfinite(c).all()
            assert np.abs(c).max() <= bound * (1 + 1e-15)  # rounding of the last product


@pytest.mark.parametrize("size", [0.0, 1.0, 30.0])
@pytest.mark.parametrize("made", [variables, pair], ids=["one sag", "two sags"])
def test_the_gradient_is_that_of_the_map(made, size):
    """The squashing is smooth: h^2 c''' is below 1e-8 of the slope."""
    found, _ = made()
    check_adjoint(found, size, 1e-7)


def test_every_sag_has_weights_of_its_own():
    """Two sags together are each one alone, one after the other."""
    together, sags = pair()
    alone = [BoundedVariables([sag], [bound]) for sag, bound in zip(sags, BOUNDS)]
    rng = np.random.default_rng(3)
    weights = [rng.standard_normal(len(v.zeros())) for v in alone]
    expected = [v.coefficients(w) for v, w in zip(alone, weights)]
    found, slopes = together.coefficients(np.concatenate(weights))
    g = [rng.standard_normal(sag.space.dim) for sag in sags]
    for a, ((b,), _) in zip(found, expected, strict=True):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(
        together.gradient(g, slopes),
        np.concatenate([v.gradient([h], own) for v, h, (_, own) in zip(alone, g, expected)]),
    )


def test_mirror_images_of_coefficients_stay_equal_bit_for_bit():
    """Weights without symmetry give symmetric coefficients; the gradient is the adjoint of that too."""
    space = small_space(refined=False).refine({0: [(0, 0), (0, 3), (3, 0), (3, 3)]})
    sag, rng = THBSurface(space, np.zeros(space.dim)), np.random.default_rng(4)
    found = BoundedVariables([sag], [BOUND], (0, 1))
    (c,), _ = found.coefficients(rng.standard_normal(len(found.zeros())))
    by_name = dict(zip(map(tuple, space.functions.tolist()), c))
    assert np.ptp(c) > 0.01
    for (level, i, j), value in by_name.items():
        last = (4 << level) + 2
        assert by_name[level, last - i, j] == by_name[level, i, last - j] == value
    check_adjoint(found, 1.0, 1e-7)
