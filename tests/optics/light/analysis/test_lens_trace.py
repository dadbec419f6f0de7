"""Phase space of the source and fans of rays, as `thbcad trace` draws them."""

import numpy as np
import pytest

from optics.light.analysis import sections
from optics.light.analysis.lens_trace import FAN, WIDEST, fans
from optics.light.tracing import FATES
from optics.scene.sources import Rays
from tests.optics.cases import DOME, rough, small_system, target_z, tracer_to
from thbcad.surfaces import THBSurface

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
    points = sections(system, backend)["source"][0].points
    assert np.abs(points[3]).max() == pytest.approx(0.98 * np.sin(np.radians(angle)), rel=1e-3)
    assert points[3].min() == -points[3].max()


# Fans

POINT = {"source.kind": "point", "source.half_angle": 60.0, "source.exponent": 2.0}


def loaded(folder, changes, sag=None):
    """Return the system with a sag, a function of the space."""
    system = small_system(folder, DOME | changes)
    if sag is None:
        return system
    space = system.base.rear.sag.space
    return system.with_sags([THBSurface(space, sag(space))])


@pytest.mark.parametrize("half_angle", [90.0, 20.0])
def test_fans_start_from_the_sources_middle_in_the_plane_of_y_and_z(tmp_path, backend, half_angle):
    """A lens that is its own mirror image in x keeps every path in the plane; first segments show the
    directions."""
    found = fans(loaded(tmp_path, {"source.half_angle": half_angle}), backend)
    assert sorted(found) == ["equal angles", "equal steps of the sine"]
    widest = WIDEST * half_angle
    for name, paths in found.items():
        assert len(paths) == FAN == 8
        for path in paths:
            assert path.fate in FATES
            np.testing.assert_array_equal(path.points[0], [0, 0, -2])
            np.testing.assert_allclose(path.points[:, 0], 0, atol=1e-9)
        first = np.array([path.points[1] - path.points[0] for path in paths])
        angle = np.degrees(np.arctan2(first[:, 1], first[:, 2]))
        assert angle[[0, -1]] == pytest.approx([-widest, widest], rel=1e-9)
        steps = np.diff(angle if name == "equal angles" else np.sin(np.radians(angle)))
        np.testing.assert_allclose(steps, steps[0], rtol=1e-9)


def even(space):
    """Return coefficients that are even in y and not in x."""
    net = np.random.default_rng(2).uniform(-0.5, 0.5, (space.kv_u.dim, space.kv_v.dim))
    return (net + net[:, ::-1]).ravel() / 2


@pytest.mark.parametrize("changes", [{}, {"source.half_angle": 50.0}, POINT], ids=["wide", "narrow", "point"])
@pytest.mark.parametrize("sag", [None, even], ids=["conic", "even in y"])
def test_a_lens_that_is_even_in_y_has_even_fans(tmp_path, backend, sag, changes):
    for paths in fans(loaded(tmp_path, changes, sag), backend).values():
        assert [p.fate for p in paths] == [p.fate for p in paths[::-1]]
        for one, other in zip(paths, paths[::-1]):
            np.testing.assert_allclose(other.points * [1, -1, 1], one.points, rtol=1e-9, atol=1e-8)


def test_a_rays_landing_point_is_that_of_the_sequential_trace(tmp_path, backend):
    """Paths of four points went front, rear, target; the middle rays of a narrow fan all do."""
    system = loaded(tmp_path, {"source.half_angle": 40.0}, lambda space: rough(space, 0.3))
    for paths in fans(system, backend).values():
        first = np.array([p.points[1] - p.points[0] for p in paths])
        direction = first / np.linalg.norm(first, axis=1, keepdims=True)
        rays = Rays(np.array([p.points[0] for p in paths]).T, direction.T, np.ones(len(paths)))
        landing = tracer_to(backend, system.designed, rays, target_z(system.problem)).landed()
        assert [len(p.points) for p in paths] == [4] * FAN
        expected = np.stack([landing.x.numpy(), landing.y.numpy()], axis=1)
        np.testing.assert_allclose([p.points[-1][:2] for p in paths], expected, rtol=0, atol=1e-6)
