"""Polarisation from face to face, against Mueller matrices in numpy."""

from functools import partial

import numpy as np
import pytest

from optics.light.tracing import TargetArea, Tracer, polarising, trace_nonsequential, transmittances
from optics.scene.paths import AIR, LightPath, Medium, Surface
from optics.scene.receivers import FarField, receiver_at
from optics.scene.sources import Rays, point_rays
from oracles.polarised_faces import SmoothFace, follow
from tests.optics.cases import TARGET_Z, hollow_lens, rough
from tests.optics.light.tracing.polarised_paths import (
    APART,
    SEQUENCES,
    SHEET,
    frame,
    random_path,
    random_rays,
)
from thbcad import Pose
from thbcad.lens import FreeformSurface, Lens


@pytest.mark.parametrize("name", SEQUENCES)
def test_light_through_faces_follows_mueller_matrices(backend, name):
    steps = SEQUENCES[name]
    path, faces = random_path(steps, len(name))
    rays = random_rays(1)
    wanted = follow(rays.direction.T, faces).stokes[:, 0]
    flux = Tracer(backend, path, rays).landed().flux.numpy()
    assert wanted.min() > 0
    np.testing.assert_allclose(flux, wanted, rtol=0, atol=1e-12)
    mean = Tracer(backend, path, rays, polarised=False).landed().flux.numpy()
    assert abs(mean / wanted - 1).max() > 1e-4


def known(angles, turns, indices):
    """Return the path over faces of a middle ray that meets them at angles of incidence in degrees.

    turns : of the planes of incidence, in degrees.  indices : before, between and behind the faces.
    """
    direction, point, across = np.array([0.0, 0.0, 1.0]), np.zeros(3), np.array([0.0, 1.0, 0.0])
    surfaces = []
    for angle, turn, before, behind in zip(angles, turns, indices, indices[1:]):
        point = point + APART * direction
        a, b = np.radians(angle), np.radians(turn)
        across = np.cos(b) * across + np.sin(b) * np.cross(direction, across)
        normal = np.cos(a) * direction + np.sin(a) * np.cross(direction, across)
        surfaces.append(Surface(SHEET, Pose(frame(normal), point)))
        face = SmoothFace(normal[None, :], before, behind)
        direction = follow(direction[None, :], [face]).direction[0]
    media = tuple(Medium(index) if index > 1 else AIR for index in indices)
    return LightPath(tuple(surfaces), media, FarField(Pose(frame(direction), point)))


def passing(backend, path, **settings):
    """Return the share of one ray along z that comes through."""
    ray = Rays(np.zeros((3, 1)), np.array([[0.0], [0.0], [1.0]]), np.ones(1))
    return Tracer(backend, path, ray, **settings).landed().flux.numpy()[0]


def test_three_faces_whose_planes_of_incidence_are_turned(backend):
    """65, 38 and 65 degrees, each turned by 45 degrees: 0.6537.

    The means of s and p pass 0.6635, and so do s and p without U, which is what the second face turns.
    """
    path = known((65.0, 38.0, 65.0), (0.0, 45.0, 45.0), (1.0, 1.5, 1.0, 1.5))
    assert passing(backend, path) == pytest.approx(0.6537, abs=5e-5)
    assert passing(backend, path, polarised=False) == pytest.approx(0.6635, abs=5e-5)


@pytest.mark.parametrize(("angle", "more"), [(56, 0.006), (65, 0.015), (70, 0.024), (75, 0.038)])
def test_means_of_s_and_p_lose_light_at_two_faces_in_one_plane(backend, angle, more):
    """The second face is parallel to the first: ((T_s)^2 + (T_p)^2) / 2 for ((T_s + T_p) / 2)^2."""
    inside = np.degrees(np.arcsin(np.sin(np.radians(angle)) / 1.5))
    path = known((angle, inside), (0.0, 0.0), (1.0, 1.5, 1.0))
    t_s, t_p = transmittances(1.0, 1.5, np.radians(angle))
    assert passing(backend, path) == pytest.approx((t_s[0] ** 2 + t_p[0] ** 2) / 2, abs=1e-14)
    mean = passing(backend, path, polarised=False)
    assert passing(backend, path) / mean - 1 == pytest.approx(more, abs=5e-4)


def test_a_tilted_plate_and_its_ghost(backend):
    """N-BK7, 10 mm, 30 degrees: 0.914078 goes straight through, 0.001993 by two reflections, 6.0355 mm aside.

    Means of s and p at every face would give 0.913788 and 0.001775.
    """
    index, angle, thickness = 1.5195, np.radians(30.0), 10.0
    sheet = FreeformSurface((1e3, 1e3))
    ray = Rays(
        np.array([[0.0], [0.0], [-1.0]]), np.array([[np.sin(angle)], [0.0], [np.cos(angle)]]), np.ones(1)
    )
    area = TargetArea(receiver_at(20.0), (1e3, 1e3))
    plate = Lens(sheet, sheet, thickness, index)
    found = trace_nonsequential(backend, plate, ray, area, threshold=1e-7).landings
    assert found.flux[:2] == pytest.approx([0.914078, 0.001993], abs=5e-7)
    aside = np.cos(angle) * (found.x[1] - found.x[0])
    assert aside == pytest.approx(6.0355, abs=5e-5)
    assert Tracer(backend, LightPath.through(plate, area.receiver, 0.0), ray).landed().flux.numpy() == (
        pytest.approx([0.914078], abs=5e-7)
    )


def test_derivatives_of_the_flux_follow_the_polarisation(backend):
    """Of two rough faces that rays meet obliquely, against central differences."""
    rng = np.random.default_rng(2)
    lens = hollow_lens(partial(rough, height=0.5), partial(rough, height=0.5, seed=6))
    path = LightPath.through(lens, receiver_at(TARGET_Z), 0.0)
    rays = point_rays(
        distance=2.0, flux=1.0, half_angle=30.0, exponent=0.0, counts=(21, 21), shift=(0.3, 0.2)
    )
    assert polarising(path, rays)
    tracer, at = Tracer(backend, path, rays), [sag.coefficients for sag in path.sags]
    directions = [rng.standard_normal(c.size) for c in at]

    def flux(step):
        landing = tracer.trace([c + step * d for c, d in zip(at, directions)])[1]
        return backend.dr.sum(landing.flux).numpy()[0]

    hits, landing = tracer.trace(at)
    backend.dr.backward(backend.dr.sum(landing.flux))
    found = sum(d @ g for d, g in zip(directions, tracer.pull_back(hits)))
    step = 1e-5
    assert found == pytest.approx((flux(step) - flux(-step)) / (2 * step), rel=1e-6)
