"""Stops beside a lens that is not where it should be."""

import numpy as np
import pytest

from optics.scene.problem import Problem
from optics.scene.system import solvable_system
from optics.tolerancing.perturbations import Perturbation, PerturbedLight

BORDER_CELLS = 2000  # of the finest cells across the source


def test_a_stop_stands_still_when_the_lens_moves():
    """A flat lens moves nothing, wherever it is: the shadow stays to the last rays."""
    bar = {"shape": "rectangle", "half_width": (2.3, 4.1), "position": (0.7, -1.2, 30), "hole": False}
    size = {"half_width": (10, 10)}
    problem = Problem(
        source={"kind": "collimated", "half_width": (8, 8)},
        lens={"index": 1.5, "thickness": 6, "front": size, "rear": size},
        target={"kind": "tophat", "distance": 60, "half_width": (12, 12), "pixels": (16, 16)},
        stop=[bar],
    )
    scene = solvable_system(problem)
    moved = Perturbation(lens_shift=(0.4, -0.3, 1.0))
    traced = PerturbedLight(scene, scene.lens, scene.backend)
    (image, fates), (other, other_fates) = traced(), traced(moved)
    corner = (2 * 8 / BORDER_CELLS) ** 2  # mm^2, of the finest cells: chords cut it
    np.testing.assert_allclose(image, other, atol=image.max() * corner / 1.5**2)
    assert fates.blocked == pytest.approx(other_fates.blocked, abs=4 * corner / 16**2)
