"""The small figures of chapter 2: filters of a pixel, and plates in a row."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from examples.thesis.small_figures import CUT, PIXELS, POSITIONS, SIGMA, box, gaussian, plates, weights
from optics.scene.receivers import GaussianWindow
from tests.cases import EXAMPLES

LONGEST = 60  # lines of a script


@given(st.integers(1, 6), st.floats(0, 0.5))
def test_plates_pass_the_sum_of_all_reflections(count, reflectance):
    """Stokes: 2 N faces pass (1 - R) / (1 + (2 N - 1) R), more than (2.13) says."""
    passed = plates(count, reflectance)
    assert passed == pytest.approx((1 - reflectance) / (1 + (2 * count - 1) * reflectance), rel=1e-13)
    assert passed >= (1 - reflectance) ** (2 * count) * (1 - 1e-13)


def test_boxes_count_every_ray_once():
    counts, _ = np.histogram(POSITIONS, np.arange(PIXELS + 1))
    assert weights(box).sum(axis=1).tolist() == counts.tolist()


def test_the_gaussian_is_that_of_the_project_but_for_its_unit_integral():
    window = GaussianWindow(SIGMA, CUT)
    for t in (0.0, 0.3, 0.9):
        here = gaussian(t + np.arange(window.taps // 2 - 1, -window.taps // 2 - 1, -1))
        there = np.array(window.weights(t, np.exp))
        assert here == pytest.approx(there * here.sum() / there.sum(), abs=1e-15)


def test_the_gaussian_is_continuous_at_its_cut():
    edge = CUT * SIGMA
    assert gaussian(np.array([edge, edge + 1])).tolist() == [0.0, 0.0]
    assert 0 < gaussian(np.array([edge - 1e-6]))[0] < 1e-8


@pytest.mark.parametrize("path", sorted((EXAMPLES / "thesis").glob("*.py")), ids=lambda path: path.stem)
def test_a_script_of_the_studies_is_short(path):
    assert len(path.read_text("utf-8").splitlines()) <= LONGEST
