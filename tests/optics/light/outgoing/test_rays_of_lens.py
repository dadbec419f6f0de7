"""The light behind a lens as rays: straight on they land where the lens sends them."""

import numpy as np
import pytest

import optics
from optics.base.runtime import UserError, load_backend
from optics.light.outgoing import outgoing_rays
from optics.scene.problem import load_problem
from tests.optics.cases import rough, write_problem

LAMP = {"source.kind": "lambertian", "source.half_width": [0.5, 0.5], "source.distance": 20.0}


@pytest.mark.parametrize("changes", [{}, pytest.param(LAMP, marks=pytest.mark.slow)], ids=["beam", "lamp"])
def test_rays_from_the_rear_go_straight_to_those_at_the_target(tmp_path, changes):
    system = optics.System(load_problem(write_problem(tmp_path, changes)))
    space = system.space()
    lens = system.lens(space, rough(space, 0.03, 0))
    backend = load_backend("double")
    rear, target = (outgoing_rays(system.optical, lens, backend, 4096, place) for place in ("rear", "target"))
    z = system.optical.target.z
    way = (z - rear.position[:, 2].astype(float)) / rear.direction[:, 2]
    landed = rear.position + way[:, None] * rear.direction
    np.testing.assert_allclose(landed, target.position, atol=2e-4)  # single precision
    np.testing.assert_array_equal(rear.flux, target.flux)
    height = lens.rear(*rear.position[:, :2].astype(float).T) + lens.thickness
    np.testing.assert_allclose(rear.position[:, 2], height, atol=1e-5)
    metrics = system.measure(lens).metrics
    through = metrics["fates_w"]["on_target"] + metrics["fates_w"]["off_target"]
    assert rear.total == pytest.approx(through, rel=0.05)  # 600 of 4096 rays of the lamp
    assert (rear.wavelength == 550).all()


def test_no_rays_start_in_the_far_field(tmp_path):
    far = {"target.distance": np.inf, "target.half_width": [20.0, 20.0]}
    system = optics.System(load_problem(write_problem(tmp_path, far)))
    with pytest.raises(UserError, match="take --light rear"):
        outgoing_rays(system.optical, system.optical.lens, load_backend("double"), 100, "target")
