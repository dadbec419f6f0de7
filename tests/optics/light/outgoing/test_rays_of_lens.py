"""The light behind a lens as rays: straight on they land where the lens sends them."""

import numpy as np
import pytest

import optics
from optics.base.runtime import UserError, load_backend
from optics.light.outgoing import outgoing_rays
from optics.scene.problem import Problem, load_problem
from optics.scene.system import System, pose_of
from tests.cases import ROOT
from tests.optics.cases import rough, small_problem, small_system

LAMP = {"source.kind": "lambertian", "source.half_width": [0.5, 0.5], "source.distance": 20.0}


BALL = {"target.surface": "sphere", "target.radius": 40.0, "target.tilt": [20.0, 10.0, 0.0]}


@pytest.mark.parametrize(
    "changes", [{}, BALL, pytest.param(LAMP, marks=pytest.mark.slow)], ids=["beam", "ball", "lamp"]
)
def test_rays_from_the_rear_go_straight_to_those_at_the_target(tmp_path, changes):
    system = optics.System(small_problem(tmp_path, changes))
    space = system.space()
    lens = system.lens(space, rough(space, 0.03, 0))
    backend = load_backend("double")
    rear, target = (
        outgoing_rays(system.with_lens(lens), backend, 4096, place) for place in ("rear", "target")
    )
    way = ((target.position.astype(float) - rear.position) * rear.direction).sum(axis=1)
    landed = rear.position + way[:, None] * rear.direction
    own = system.target.receiver.pose.inverse().points(target.position.T.astype(float))
    radius = changes.get("target.radius", np.inf)
    np.testing.assert_allclose((own**2).sum(axis=0) / (2 * radius), own[2], atol=2e-5)
    np.testing.assert_allclose(landed, target.position, atol=2e-4)  # single precision
    np.testing.assert_array_equal(rear.flux, target.flux)
    height = lens.rear(*rear.position[:, :2].astype(float).T) + lens.thickness
    np.testing.assert_allclose(rear.position[:, 2], height, atol=1e-5)
    metrics = system.measure(lens).metrics
    through = metrics["fates_w"]["on_target"] + metrics["fates_w"]["off_target"]
    assert rear.total == pytest.approx(through, rel=0.05)  # 600 of 4096 rays of the lamp
    assert (rear.wavelength == 550).all()


def test_light_that_a_screen_before_its_mirror_takes_is_in_no_file(backend):
    free = {"spans": (2, 2), "max_level": 0, "z_freedom": 0.1}
    face = {"half_width": (10, 10), "freeform": free}
    mirror = {"kind": "mirror", "name": "M1", "position": (0, 0, 100), "thickness": 3.0, "face": face}
    screen = {"kind": "tophat", "position": (0, 0, 20.0), "tilt": (180.0, 0, 0), "half_width": (5, 5)}
    beam = {"kind": "collimated", "half_width": (9.5, 9.5), "distance": 50.0}
    problem = Problem(source=beam, element=(mirror,), target=screen | {"pixels": (16, 16)})
    system = System(problem)
    rays = outgoing_rays(system, backend, 40_000, "rear")
    shadow = (5 / 9.5) ** 2
    assert rays.total == pytest.approx(0.9 * (1 - shadow), rel=0.01)


def test_rays_of_a_row_start_on_its_last_face(tmp_path):
    """The plane mirror z = 0 of its own frame; from there they go straight to those at the target."""
    problem = load_problem(ROOT / "examples" / "folded.toml", {"element.L1.rear.radius": 300.0})
    system = System(problem)
    mirror, target = (
        outgoing_rays(system, load_backend("double"), 1024, place) for place in ("rear", "target")
    )
    own = pose_of(problem.optics[1]).inverse().points(mirror.position.T.astype(float))
    np.testing.assert_allclose(own[2], 0, atol=2e-5)  # single precision
    way = np.linalg.norm(target.position.astype(float) - mirror.position, axis=1, keepdims=True)
    np.testing.assert_allclose(mirror.position + way * mirror.direction, target.position, atol=2e-4)
    assert len(mirror) > 900


def test_no_rays_start_in_the_far_field(tmp_path):
    far = {"target.distance": np.inf, "target.half_width": [20.0, 20.0]}
    system = optics.System(small_problem(tmp_path, far))
    with pytest.raises(UserError, match="take --light rear"):
        outgoing_rays(system, load_backend("double"), 100, "target")


def test_rays_of_a_spectrum_have_all_its_wavelengths(tmp_path, backend):
    """Each with its share of the flux, bent by its own index."""
    colours = {"lens.material": "PC", "lens.index": "auto", "source.spectrum": [[450, 1], [650, 3]]}
    system = small_system(tmp_path, colours)
    rays = outgoing_rays(system, backend, 4096, "target")
    blue, red = (rays.wavelength < 500), (rays.wavelength > 600)
    lines = {round(w.nm): w.weight for w in system.wavelengths}
    assert {round(float(nm)) for nm in np.unique(rays.wavelength)} == set(lines)
    for nm, weight in lines.items():
        share = rays.flux[np.abs(rays.wavelength - nm) < 1].sum() / rays.total
        assert share == pytest.approx(weight, rel=0.02)
    apart = [np.hypot(*rays.position[some, :2].astype(float).T).max() for some in (blue, red)]
    assert apart[0] != pytest.approx(apart[1], rel=1e-3)
