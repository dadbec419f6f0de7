"""The problem file of the fixed nets is what the corrected table 5.1 says."""

import numpy as np
import pytest

import optics
from tests.cases import EXAMPLES


def test_the_flat_lens_lights_a_square_of_71_mm():
    """The half-width 47.5 mm grows by the factor 1 + (n - 1) d2 / R = 1.5, but for spherical aberration."""
    problem = optics.load_problem(EXAMPLES / "thesis" / "fixed_nets.toml")
    system = optics.System(problem.with_(**{"target.pixels": (150, 150)}))
    image = system.model(system.space(), (257, 257), "cells")(np.zeros(system.space().dim))
    assert system.space().dim == 50**2
    (row,) = np.nonzero(image[75] > image[75, 75] / 2)  # pixels of 1 mm
    assert np.ptp(row) + 1 == pytest.approx(2 * 47.5 * 1.5, abs=1.5)
    assert image.sum() == pytest.approx(0.96**2, rel=1e-3)  # 4 % are lost at each face
