"""Slopes that send light where it is wanted, against surfaces that are known to."""

import numpy as np
import pytest
from scipy.optimize import brentq

from optics.light.refraction import ShapedSurface
from optics.scene.paths import AIR, LightPath, Medium, Surface
from optics.scene.receivers import FarField, Plane
from thbcad.lens import FreeformSurface
from thbcad.poses import Pose

POSE = Pose.at((3.0, -2.0, 5.0), rotation_vector=(0.2, 0.5, -0.3))  # of the surface in the scene
X, Y = (a.ravel() for a in np.meshgrid(np.linspace(-6, 6, 7), np.linspace(-5, 5, 6), indexing="ij"))
STEP = 1e-4  # mm: differences of central order have errors of 1e-9 with the heights' 1e-13


def shaped(kind, media, receiver):
    """Return the surface of a path; the receiver is given in the surface's frame."""
    surface = Surface(FreeformSurface((8.0, 8.0)), POSE, kind)
    return ShapedSurface.of(LightPath((surface,), media, receiver.moved(POSE)), 0)


def level_set(length, near=0.0):
    """Return the heights z(x, y) at which a path length is that at the vertex, and their slopes."""

    def height(x, y):
        wanted = length(np.array([0.0, 0.0, near]))
        return brentq(lambda z: length(np.array([x, y, z])) - wanted, near - 9.0, near + 9.0, xtol=1e-14)

    z = np.array([height(x, y) for x, y in zip(X, Y)])
    slopes = [
        np.array([height(x + i, y + j) - height(x - i, y - j) for x, y in zip(X, Y)]) / (2 * STEP)
        for i, j in ((STEP, 0.0), (0.0, STEP))
    ]
    return np.array([X, Y, z]), slopes


def distance(a, b):
    return np.linalg.norm(np.asarray(a) - b)


LAMP, SPOT = np.array([-20.0, 5.0, -40.0]), np.array([25.0, 4.0, -30.0])
GLASS = Medium(1.5)
TO_SPOT = Plane(Pose.at(SPOT, rotation_vector=(0.0, np.pi, 0.0)))  # light goes to -z of the mirror


@pytest.mark.parametrize("far", [False, True])
def test_a_mirror_from_a_point_to_a_point_is_an_ellipsoid_and_to_the_far_field_a_paraboloid(far):
    """|P - A| + |P - B| = const; with B infinitely far along d it is |P - A| - d . P."""
    along = (SPOT - 0.0) / np.linalg.norm(SPOT)
    if far:
        turn = np.cross([0.0, 0.0, 1.0], along)
        angle = np.arccos(along[2]) / np.linalg.norm(turn)
        receiver = FarField(Pose.at(rotation_vector=angle * turn))
        points, slopes = level_set(lambda p: distance(p, LAMP) - along @ p)
    else:
        receiver = TO_SPOT
        points, slopes = level_set(lambda p: distance(p, LAMP) + distance(p, SPOT))
    incoming = points - LAMP[:, None]
    incoming /= np.linalg.norm(incoming, axis=0)
    mirror = shaped("reflect", (AIR, AIR), receiver)
    found, possible = mirror.slopes(points, incoming, np.zeros((2, X.size)))
    assert possible.all()
    np.testing.assert_allclose(found, slopes, rtol=0, atol=1e-8)
    np.testing.assert_allclose(mirror.landing(points, incoming, found), 0.0, rtol=0, atol=1e-10)


@pytest.mark.parametrize("media", [(GLASS, AIR), (AIR, GLASS)], ids=["leaving", "entering"])
def test_a_surface_that_refracts_from_a_point_to_a_point_is_a_cartesian_oval(media):
    """n |P - A| + n' |P - B| = const."""
    lamp, spot = np.array([4.0, -3.0, -50.0]), np.array([-5.0, 6.0, 60.0])
    before, behind = (m.index for m in media)
    points, slopes = level_set(lambda p: before * distance(p, lamp) + behind * distance(p, spot))
    incoming = points - lamp[:, None]
    incoming /= np.linalg.norm(incoming, axis=0)
    receiver = Plane(Pose.at(spot, rotation_vector=(0.1, -0.2, 0.0)))
    path = LightPath(
        (Surface(FreeformSurface((8.0, 8.0)), POSE),),
        (media[0], Medium(behind)),
        receiver.moved(POSE),
    )
    surface = ShapedSurface.of(path, 0)
    found, possible = surface.slopes(points, incoming, np.zeros((2, X.size)))
    assert possible.all()
    np.testing.assert_allclose(found, slopes, rtol=0, atol=1e-8)
    np.testing.assert_allclose(surface.landing(points, incoming, found), 0.0, rtol=0, atol=1e-10)


@pytest.mark.parametrize("index", [1.0, 1.33, 1.5, 1.8])
def test_slopes_send_light_in_the_directions_that_were_asked_for(index):
    """Out of glass, or by a mirror (index 1), to the far field: in degrees, 1e-13 in radians."""
    rng = np.random.default_rng(3)
    mirror = index == 1
    along, leaving = (np.append(rng.uniform(-s, s, (2, 500)), np.ones((1, 500)), 0) for s in (0.2, 0.3))
    along /= np.linalg.norm(along, axis=0)
    wanted = np.degrees(np.arctan(leaving[:2]))
    if mirror:
        surface = shaped("reflect", (AIR, AIR), FarField(Pose.at(rotation_vector=(0.0, np.pi, 0.0))))
    else:
        surface = shaped("refract", (Medium(index), AIR), FarField())
    found, possible = surface.slopes(np.zeros((3, 500)), along, wanted)
    assert possible.mean() > 0.5
    landed = np.array(surface.landing(np.zeros((3, 500)), along, found))
    np.testing.assert_allclose(landed[:, possible], wanted[:, possible], rtol=0, atol=np.degrees(2e-13))


def test_light_that_cannot_be_sent_there_is_told():
    """Glass turns light by less than 48.2 degrees, and a receiver takes none from behind."""
    along = np.array([0.0, 0.0, 1.0])
    screen = Plane(Pose.at((0.0, 0.0, 10.0)))
    rear = shaped("refract", (GLASS, AIR), screen)
    for beside, possible in ((11.0, True), (11.4, False)):  # 10 tan(48.2 degrees) = 11.2
        assert rear.slopes(np.zeros(3), along, (beside, 0.0))[1] == possible
    turned = Plane(Pose.at((0.0, 0.0, 10.0), rotation_vector=(0.0, np.pi, 0.0)))
    assert not shaped("refract", (GLASS, AIR), turned).slopes(np.zeros(3), along, (1.0, 0.0))[1]
