"""c-transforms: the definition, and what follows from it."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from optics.base.runtime import load_backend
from optics.designing.transport.c_transform import ROOM, c_transform

BACKEND = load_backend("double", 1)
TINY = 1e-13  # rounding of a few sums, for potentials and squared distances of the order of 1


def by_definition(phi, spacing):
    """Return min_y |x - y|^2 / 2 - phi(y) for all x, one after the other."""
    places = [h * np.arange(n) for n, h in zip(phi.shape, spacing)]
    x, y = np.meshgrid(*places, indexing="ij")
    return np.array(
        [[((a - x) ** 2 / 2 + (b - y) ** 2 / 2 - phi).min() for b in places[1]] for a in places[0]]
    )


@st.composite
def potentials(draw):
    shape = draw(st.tuples(st.integers(1, 12), st.integers(1, 12)))
    spacing = [draw(st.sampled_from([0.01, 0.3, 1.0])) for _ in shape]
    size = draw(st.sampled_from([1e-4, 0.05, 1.0]))
    # few different values make many parabolas meet in one point
    values = draw(st.lists(st.integers(-4, 4), min_size=shape[0] * shape[1], max_size=shape[0] * shape[1]))
    return size * np.reshape(values, shape).astype(float), spacing


@settings(deadline=None)
@given(potentials())
def test_it_is_the_least_difference_of_cost_and_potential(case):
    phi, spacing = case
    np.testing.assert_allclose(
        c_transform(BACKEND, phi, spacing), by_definition(phi, spacing), rtol=0, atol=TINY * 144
    )


@settings(deadline=None)
@given(potentials())
def test_a_third_transform_gives_the_first(case):
    """phi^cc >= phi, and phi^ccc = phi^c."""
    phi, spacing = case
    once = c_transform(BACKEND, phi, spacing)
    twice = c_transform(BACKEND, once, spacing)
    assert (twice >= phi - TINY * 144).all()
    np.testing.assert_allclose(c_transform(BACKEND, twice, spacing), once, rtol=0, atol=TINY * 144)


@pytest.mark.parametrize("shape", [(ROOM, 2), (2, ROOM + 88)])
def test_rows_may_be_longer_than_the_room_of_a_kernel(shape):
    phi = np.random.default_rng(5).normal(size=shape)
    spacing = 0.1, 0.1
    np.testing.assert_allclose(
        c_transform(BACKEND, phi, spacing), by_definition(phi, spacing), rtol=0, atol=TINY * 60**2
    )
