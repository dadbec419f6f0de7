"""Light carried by a map: none is lost, none is made, and it goes where the map says."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from optics.base.runtime import load_backend
from optics.designing.transport.push_forward import push_forward
from tests.optics.cases import THREADS, on_threads

BACKEND = load_backend("double", 1)


@settings(deadline=None)
@given(st.integers(1, 30), st.integers(1, 30), st.sampled_from([0.0, 0.01, 3.0]), st.integers(0, 2**31))
def test_the_flux_is_kept_by_any_map(nx, ny, size, seed):
    """Also by one that folds, and that sends light past the border; to the rounding of the sums."""
    rng = np.random.default_rng(seed)
    light = rng.random((nx, ny)) * (rng.random((nx, ny)) > 0.5)
    arrived = push_forward(BACKEND, size * rng.normal(size=(nx, ny)), light, (0.1, 0.07))
    assert (arrived >= 0).all()
    assert arrived.sum() == pytest.approx(light.sum(), rel=1e-13)


def test_the_identity_keeps_uniform_light():
    arrived = push_forward(BACKEND, np.zeros((7, 12)), np.ones((7, 12)), (0.5, 0.25))
    np.testing.assert_allclose(arrived, 1.0, rtol=0, atol=1e-14)


@pytest.mark.parametrize("cells", [1, 3])
def test_a_slope_moves_a_spot_by_its_height(cells):
    """psi = -d x sends light from x to x + d; the bilinear shares spread it by less than a cell."""
    spacing = 0.5, 0.25
    light = np.zeros((20, 24))
    light[8, 10] = 1.0
    psi = np.repeat(-cells * spacing[0] ** 2 * np.arange(20.0)[:, None], 24, axis=1)
    arrived = push_forward(BACKEND, psi, light, spacing)
    x, y = np.nonzero(arrived)
    assert set(x) <= {7 + cells, 8 + cells, 9 + cells}
    assert set(y) <= {9, 10, 11}
    assert (arrived.sum(axis=1) * np.arange(20)).sum() == pytest.approx(8 + cells, abs=1e-13)
    assert (arrived.sum(axis=0) * np.arange(24)).sum() == pytest.approx(10, abs=1e-13)


def test_what_no_light_goes_to_stays_dark():
    """t = x / 2 + 1 / 4 fills the middle half of each direction, and nothing else but the cell beside it."""
    n = 32
    x = (np.arange(n) + 0.5) / n
    psi = ((x - 0.5) ** 2 / 4)[:, None] + ((x - 0.5) ** 2 / 4)[None, :]
    light = np.zeros((n, n))
    light[1:-1, 1:-1] = 1.0  # at the border a map keeps to the border
    arrived = push_forward(BACKEND, psi, light, (1 / n, 1 / n))
    assert not arrived[: n // 4 - 1].any()
    assert not arrived[:, : n // 4 - 1].any()
    assert arrived[n // 4 + 1 : -n // 4 - 1, n // 4 + 1 : -n // 4 - 1] == pytest.approx(4.0, rel=1e-12)


def test_any_number_of_threads_carries_the_same_light():
    rng = np.random.default_rng(4)
    psi, light = rng.normal(size=(200, 300)) * 1e-4, rng.random((200, 300))
    spacing = 0.01, 0.01
    found = [on_threads(n, lambda: push_forward(BACKEND, psi, light, spacing).tobytes()) for n in THREADS]
    assert len(set(found)) == 1
