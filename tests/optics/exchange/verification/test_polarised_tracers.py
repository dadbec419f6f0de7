"""Every independent tracer carries polarisation, against Mueller matrices in numpy."""

from importlib.util import find_spec

import numpy as np
import pytest

from optics.exchange.verification import FileFace, RaysBehind, occt_through, optiland_through, through_faces
from optics.exchange.verification.reference_tracer import fixed_face
from oracles.polarised_faces import SmoothFace, follow
from tests.optics.light.tracing.polarised_paths import SEQUENCES, random_path, random_rays
from thbcad.cad.shapes import lens_solid
from thbcad.lens import FreeformSurface, Lens, optical_forms
from thbcad.poses import Pose

INDEX = 1.5
PLATE = Lens(FreeformSurface((40.0, 40.0)), FreeformSurface((40.0, 40.0)), 1.0, INDEX)
ACROSS = np.array([[0.0, 0.0, 1.0]])
TURN = Pose.at(rotation_vector=(0.5, -0.7, 1.0))


def by_scipy(rays):
    front, rear = optical_forms(PLATE)
    return through_faces([FileFace(front, 1 / INDEX), FileFace(rear, INDEX)], rays)


def by_occt(rays):
    return occt_through(lens_solid(PLATE), (0, 1), rays, [(0, 1 / INDEX), (1, INDEX)])


def by_optiland(rays):
    return optiland_through(*optical_forms(PLATE), rays, INDEX)


OPTILAND = pytest.mark.skipif(find_spec("optiland") is None, reason="optiland is not installed")


@pytest.mark.parametrize("through", [by_scipy, by_occt, pytest.param(by_optiland, marks=OPTILAND)])
def test_light_through_two_plates_follows_mueller_matrices(through):
    """The second plate is turned, so that its planes of incidence are others."""
    rng = np.random.default_rng(3)
    directions = np.array([0.7, 0.5, 0.4]) + rng.uniform(-0.1, 0.1, (200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    first = through(RaysBehind(-directions, directions, np.ones(200)))
    turned = first.posed(TURN)
    second = through(RaysBehind(-turned.directions, turned.directions, turned.flux, turned.fields))
    normal = TURN.inverse().directions(ACROSS.T).T
    plates = [(ACROSS, 1.0, INDEX), (ACROSS, INDEX, 1.0), (normal, 1.0, INDEX), (normal, INDEX, 1.0)]
    followed = [follow(directions, [SmoothFace(*face) for face in plates[:k]]).stokes[:, 0] for k in (2, 4)]
    np.testing.assert_allclose(first.flux, followed[0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(second.flux, followed[1], rtol=0, atol=1e-12)
    assert (second.flux > 0.1).all()
    alone = through(RaysBehind(-turned.directions, turned.directions, np.ones(200))).flux
    assert abs(second.flux / (first.flux * alone) - 1).max() > 1e-3


@pytest.mark.parametrize("name", SEQUENCES)
def test_scipys_trace_over_faces_follows_mueller_matrices(name):
    path, faces = random_path(SEQUENCES[name], len(name))
    rays = random_rays(1)
    every = [fixed_face(path, k) for k in range(len(path.surfaces))]
    found = through_faces(every, RaysBehind(rays.origin.T, rays.direction.T, rays.flux)).flux
    np.testing.assert_allclose(found, follow(rays.direction.T, faces).stokes[:, 0], rtol=0, atol=1e-12)
