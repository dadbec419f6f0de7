"""Phase space of the source, as `thbcad trace` draws it."""

import numpy as np
import pytest

from optics.light.analysis import sections
from tests.optics.cases import small_system

SUN = 0.2665  # degrees, half of its disk


@pytest.mark.parametrize(
    ("changes", "angle"),
    [
        ({}, 0.0),
        ({"source.divergence_profile": "sun"}, SUN),
        ({"source.divergence": 3.0}, 3.0),
        ({"source.kind": "point", "source.distance": 25.0, "source.half_angle": 14.0}, 14.0),
        ({"source.kind": "lambertian", "source.distance": 25.0, "source.half_angle": 20.0}, 20.0),
    ],
    ids=["parallel", "sun", "beam", "point", "lamp"],
)
def test_phase_space_at_the_source_reaches_as_far_as_its_light(tmp_path, backend, changes, angle):
    system = small_system(tmp_path, changes)
    points = sections(system, system.lens, backend)["source"][0].points
    assert np.abs(points[3]).max() == pytest.approx(0.98 * np.sin(np.radians(angle)), rel=1e-3)
    assert points[3].min() == -points[3].max()
