"""Random errors: even over their tolerances, the same for the same seed, refused where they cannot be."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.base.runtime import UserError
from optics.scene.problem import load_problem
from optics.scene.system import OpticalSystem
from optics.tolerancing.monte_carlo_samples import FormTolerance
from optics.tolerancing.monte_carlo_samples.random_errors import REPLICATES, draws
from tests.optics.cases import write_problem


@given(st.integers(0, 40), st.integers(1, 6), st.integers(0, 2**32))
def test_every_set_fills_its_cube_evenly(tolerances, power, seed):
    """2^m Sobol points have one coordinate in each of 2^m equal parts of an axis."""
    each = 2**power
    sets = draws(tolerances, REPLICATES * each, seed)
    assert len(sets) == REPLICATES
    for lenses in sets:
        amounts = np.array([draw.amounts for draw in lenses]).reshape(each, tolerances)
        parts = np.floor((amounts + 1) / 2 * each)
        np.testing.assert_array_equal(np.sort(parts, axis=0), np.tile(np.arange(each)[:, None], tolerances))
    assert len({draw.seed for lenses in sets for draw in lenses}) == REPLICATES * each
    assert draws(tolerances, REPLICATES * each, seed) == sets


def test_sets_are_scrambled_apart():
    sets = draws(3, 16 * REPLICATES, 1)
    assert len({lenses[0].amounts for lenses in sets}) == REPLICATES


@pytest.mark.parametrize("samples", [0, 8, 100, 513, -16, 2.0, True, 1 << 40])
def test_other_numbers_of_samples_are_refused(samples):
    with pytest.raises(UserError, match="number of samples must be"):
        draws(2, samples, 0)


@pytest.mark.parametrize(
    ("surface", "rms", "words"),
    [("side", 1e-5, "front"), ("rear", -1.0, "rms"), ("rear", np.nan, "rms"), ("rear", "much", "rms")],
)
def test_bad_forms_are_refused(tmp_path, surface, rms, words):
    system = OpticalSystem(load_problem(write_problem(tmp_path)))
    with pytest.raises(UserError, match=words):
        FormTolerance(surface, rms, (1.0, 5.0)).drawn(system, system.lens, 0)


def test_a_form_lies_on_its_surface_alone(tmp_path):
    system = OpticalSystem(load_problem(write_problem(tmp_path, {"lens.front.half_width": [6.0, 4.0]})))
    drawn = FormTolerance("front", 1e-5, (2.0, 8.0)).drawn(system, system.lens, 3)
    assert drawn.rear_error is None
    x, y = np.meshgrid(np.linspace(-6, 6, 101), np.linspace(-4, 4, 101))
    assert drawn.front_error.jet(x.ravel(), y.ravel())[0].std() == pytest.approx(1e-5, rel=0.05)
