"""Paths on which light cannot go are said to be so, with the share of the light."""

import re
from dataclasses import replace

import numpy as np
import pytest

from optics.light.tracing import path_faults
from optics.scene.paths import AIR, LightPath, Medium, Surface
from optics.scene.receivers import FarField, Plane
from optics.scene.sources import Rays, collimated_beam, point_rays
from tests.optics.cases import TARGET_Z, small_lens
from thbcad import Conic, Pose
from thbcad.lens import FreeformSurface

SCREEN = Plane(Pose.at((0.0, 0.0, TARGET_Z)))
PATH = LightPath.through(small_lens(Conic(60.0)), SCREEN, 0.01)
TURNED = Pose.at(rotation_vector=(0.0, np.pi, 0.0))


def point(z):
    rays = point_rays(distance=0.0, flux=2.0, half_angle=5.0, exponent=0.0, counts=(21, 21), shift=(0.3, 0.2))
    return rays.posed(Pose.at((0.0, 0.0, z)))


def test_a_good_path_has_no_faults(backend):
    for rays in (point(-80.0), collimated_beam((9.0, 9.0), 1.0, (10.0, 10.0), (21, 21)).rays(-50.0)):
        assert path_faults(backend, PATH, rays) == []
        assert path_faults(backend, PATH.onto(FarField()), rays) == []


def test_a_source_in_the_glass_or_beyond_it_is_said(backend):
    inside, beyond = (path_faults(backend, PATH, point(z)) for z in (3.0, 30.0))
    assert inside[0].startswith("100% of the light starts behind the first surface, in the solid or beyond")
    assert beyond[0] == inside[0]


def test_surfaces_in_another_order_are_said(backend):
    front, rear = PATH.surfaces
    faults = path_faults(backend, replace(PATH, surfaces=(rear, front)), point(-80.0))
    assert re.match(r"9\d% of the light meets surface 1 before surface 0; exchange them", faults[0])


@pytest.mark.parametrize("shift", [0.0, 2.0])
def test_the_share_is_that_of_the_light(backend, shift):
    """Parallel light of which some starts behind a tilted plane: where y sin a > cos a (z - z0)."""
    rays = collimated_beam((9.0, 9.0), 1.0, (10.0, 10.0), (20, 20)).rays(shift)
    plane = Surface(FreeformSurface((40.0, 40.0)), Pose.at((0.0, 0.0, 0.0), (0.5, 0.0, 0.0)))
    path = LightPath((plane,), (AIR, Medium(1.5)), SCREEN)
    (fault,) = path_faults(backend, path, rays)
    normal = plane.pose.rotation[:, 2]
    wanted = rays.flux[normal @ rays.origin > 0].sum() / rays.total
    assert 0.3 < wanted < 0.9
    assert fault.startswith(f"{wanted:.0%} of the light starts behind the first surface")


def test_a_surface_that_looks_away_is_said(backend):
    front, rear = PATH.surfaces
    path = replace(PATH, surfaces=(front, replace(rear, pose=rear.pose @ TURNED)))
    assert any(
        "comes to surface 1 from behind; turn the surface" in f
        for f in path_faults(backend, path, point(-80.0))
    )


def test_a_receiver_from_behind_and_one_edge_on_are_said(backend):
    backward = path_faults(backend, PATH.onto(Plane(SCREEN.pose @ TURNED)), point(-80.0))
    assert len(backward) == 1
    assert "of the light comes to the receiver from behind; turn the receiver round" in backward[0]
    along = np.array([[0.0, 1.0], [0.01, 0.0], [1.0, 0.0]])
    rays = Rays(np.zeros((3, 2)), along / np.linalg.norm(along, axis=0), np.array([3.0, 1.0]))
    bare = LightPath((), (AIR,), Plane(Pose.at((20.0, 0.0, 0.0), (0.0, np.pi / 2, 0.0))))
    assert path_faults(backend, bare, rays) == [
        "75% of the light runs along the receiver, within a degree; tilt the receiver"
    ]
