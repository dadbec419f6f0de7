"""What the objective of a stage measures."""

from math import erf, prod, sqrt

import numpy as np
import pytest

from optics.designing.optimisation import stage_objective, stages
from optics.light.engines import ExactEngine
from tests.optics.cases import coefficients, small_system


@pytest.mark.parametrize("profile", ["uniform", "gaussian"])
def test_all_light_before_a_small_rear_is_seen(tmp_path, backend, profile):
    """A beam through a plate whose rear it overfills: what arrives is 0.96^2 of the light before the rear,
    none of it beyond the rim, and sums of 1e4 numbers leave 1e-12."""
    changes = {
        "source.profile": profile,
        "lens.rear.half_width": [7.97, 6.31],
        "lens.rear.radius": np.inf,
        "lens.rear.conic": 0.0,
    }
    changes |= {"source.sigma": [0.6, 0.6]} if profile == "gaussian" else {}
    system = small_system(tmp_path, changes)
    *_, stage = stages(system, False)
    objective = stage_objective(system, stage, system.target.light, ExactEngine(backend))
    image = objective.image(coefficients(system.base))
    root = 0.6 * sqrt(2)
    within = [h / 9.5 if profile == "uniform" else erf(h / 9.5 / root) / erf(1 / root) for h in (7.97, 6.31)]
    assert stage.exact
    assert image.sum() * stage.screen.pixel_area == pytest.approx(0.96**2 * prod(within), rel=1e-12)
