"""Light laid on a surface: where all of it has one direction that is known, and else the mean of its rays."""

import numpy as np
import pytest

from optics.designing.starts import path_light
from optics.designing.starts.path_light import light_on
from tests.optics.cases import example_system


@pytest.mark.parametrize("example", ["mirror", "two_elements"])
def test_one_direction_is_that_of_the_light_laid_down(backend, monkeypatch, example):
    """Of a beam before a turned mirror; behind a lens that spreads it nothing changes."""
    face = {"element.M1.face.radius": 800.0, "element.M1.face.freeform.z_freedom": 1.0}
    system = example_system(example, face)
    path, number = system.path, system.path.shaped
    found = light_on(backend, path, number, system.source, (32, 32))
    monkeypatch.setattr(path_light, "ALIKE", -1.0)
    laid = light_on(backend, path, number, system.source, (32, 32))
    for mine, theirs in zip(found.direction, laid.direction, strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-12)
    assert (np.ptp(found.direction[1]) == 0) == (example == "mirror")
