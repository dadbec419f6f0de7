"""The picture like a photograph: light where it was measured, lens beside its screen, glass that refracts."""

import io

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import map_coordinates

from optics.light.tracing import seen_branches
from optics.reporting.view import elements_sight, photo_caption, photograph
from optics.reporting.view.photo_light import interpolated
from optics.reporting.view.photo_room import PIXELS, WHOLE, PhotoRoom, photo_room
from optics.scene.problem import Problem
from optics.scene.sources import Rays
from optics.scene.system import System
from oracles.light_formulas import fresnel_parts
from thbcad.lens import FreeformSurface, Lens

PLATE = Lens(FreeformSurface((10.0, 10.0)), FreeformSurface((10.0, 10.0)), thickness=6.0, index=1.5)


def seen(room, point):
    """Return column and row of the pixel that shows a point, by the matrix of a pinhole camera."""
    right, up, back = room.turn @ (point - room.eye)
    left, end, bottom, top = room.window
    column = (right / -back - left) / (end - left) * PIXELS[0]
    return column, (top - up / -back) / (top - bottom) * PIXELS[1]


@pytest.mark.slow
def test_light_is_seen_where_it_was_measured_and_the_same_light_gives_the_same_bytes(made, backend):
    """One bright pixel out of 8 x 8, to the right and above: nothing else in the room is as bright there."""
    system = made({})
    irradiance = np.zeros((8, 8))
    irradiance[1, 6] = 1.0
    sight = elements_sight(system, backend)
    png = photograph(system, irradiance, sight)
    grey = np.asarray(Image.open(io.BytesIO(png)).convert("L"), dtype=float)
    room = photo_room(system)
    hx, hy = room.half_width
    column, row = seen(room, room.screen.points(0.625 * hx, 0.625 * hy))
    assert grey[int(row), int(column)] > 240
    column, row = seen(room, room.screen.points(-0.625 * hx, 0.625 * hy))
    assert grey[int(row), int(column)] < 60
    assert grey.shape == PIXELS[::-1]
    again = photograph(system, irradiance, elements_sight(system, backend))
    assert again == png


@pytest.mark.parametrize("half_width", [5.0, 20.0, 3000.0])
@pytest.mark.parametrize("distance", [8.0, 60.0, 5e4, np.inf])
def test_the_screen_leaves_the_lens_free_and_both_are_in_the_picture(made, distance, half_width):
    angle = np.isinf(distance)
    width = min(half_width, 60.0) if angle else half_width
    room = photo_room(made({"target.distance": distance, "target.half_width": [width, width]}))
    hx, hy = room.half_width
    box = np.array(np.meshgrid(*room.elements["lens"])).reshape(3, 8).T
    lens_points = np.array([seen(room, point) for point in box])
    screen = np.array([seen(room, room.screen.points(x, y)) for x in (-hx, hx) for y in (-hy, hy)])
    everything = np.concatenate([lens_points, screen])
    assert (everything > 0).all()
    assert (everything < PIXELS).all()
    assert lens_points[:, 0].max() < screen[:, 0].min() + 0.02 * PIXELS[0]
    assert np.ptp(lens_points[:, 0]) > 0.1 * PIXELS[0]


def test_the_caption_says_what_is_not_drawn_as_it_is(made):
    assert photo_caption(made({})).endswith("The room is invented.")
    assert "is mirrored here" in photo_caption(made({"target.seen_from": "lens"}))
    assert "100 times smaller" in photo_caption(made({"target.half_width": [2400.0, 2400.0]}))
    assert "the distance to the screen is drawn 0." not in photo_caption(made({"target.distance": 2.0}))
    far = {"target.distance": np.inf, "target.half_width": [10.0, 10.0]}
    assert "the intensity in every direction" in photo_caption(made(far))


def test_a_plate_shows_the_room_displaced_as_snell_and_as_bright_as_fresnel_say(backend):
    angle = np.radians(30.0)
    direction = np.array([[np.sin(angle)], [0.0], [-np.cos(angle)]])
    rays = Rays(np.array([[-5.0], [0.0], [16.0]]), direction, np.ones(1))
    out = seen_branches(backend, PLATE, rays)
    through, mirrored = out.direction[2] < 0, out.direction[2] > 0
    inside = np.arcsin(np.sin(angle) / 1.5)
    passed = fresnel_parts(angle, 1.0, 1.5)  # of s and of p
    assert out.flux[mirrored] == pytest.approx([1 - passed.mean()], rel=1e-12)
    assert out.flux[through] == pytest.approx([(passed**2).mean()], rel=1e-12)
    assert out.direction[:, through] == pytest.approx(direction, abs=1e-12)
    at_front = -5.0 + 10.0 * np.tan(angle) + 6.0 * np.tan(inside)
    assert out.origin[:, through][:, 0] == pytest.approx([at_front, 0.0, 0.0], abs=1e-12)


MIRROR = {"kind": "mirror", "name": "M1", "position": (0, 0, 40), "tilt": (45, 0, 0), "thickness": 5.0}
MIRROR |= {"face": {"half_width": (20, 30), "radius": np.inf, "conic": 0.0, "freeform": None}}
GLASS = {"kind": "lens", "name": "L1", "index": 1.5, "thickness": 6.0, "front": {"half_width": (20, 20)}}
GLASS |= {"rear": {"half_width": (20, 20), "freeform": {"spans": (4, 4), "z_freedom": 1.0}}}


def glass_and_mirror():
    source = {"kind": "collimated", "half_width": (7, 7), "distance": 20.0}
    target = {"kind": "tophat", "half_width": (20, 20), "position": (0, 40, 40), "tilt": (-90, 0, 0)}
    return System(Problem(source=source, element=(GLASS, MIRROR), target=target))


@pytest.mark.slow
@pytest.mark.parametrize("row", [False, True])
def test_nothing_is_seen_beside_where_the_camera_looks(made, backend, monkeypatch, row):
    elements = glass_and_mirror()
    system = elements if row else made({})
    light, sight = np.ones((8, 8)), elements_sight(system, backend)
    monkeypatch.setattr(PhotoRoom, "showing", lambda room, points: tuple(map(np.arange, WHOLE)))
    whole = elements_sight(system, backend)
    assert sight.pixel.size == whole.pixel.size > 1e4
    assert photograph(system, light, sight) == photograph(system, light, whole)


@pytest.mark.slow
def test_a_mirror_shows_the_room_reflected_and_a_plate_through_itself(backend):
    """The plane mirror's normal is n = (0, 1, -1) / sqrt 2; the plate, whose sag is zero, turns no ray."""
    system = glass_and_mirror()
    sight = elements_sight(system, backend)
    normal, (start, ray) = np.array([0.0, 1.0, -1.0]) / np.sqrt(2), sight.before.astype(float)
    met = start + ((np.array([0, 0, 40.0]) - start.T) @ normal / (normal @ ray)) * ray
    mirrored = ray - 2 * normal[:, None] * (normal @ ray)
    share = np.zeros(ray.shape[1])
    np.maximum.at(share, sight.ray, sight.flux)
    first = (sight.flux == share[sight.ray]) & ~crosses((-20, -20, 0), (20, 20, 6), start, ray)[sight.ray]
    first &= ((abs(met[0]) < 19.9) & (abs(met[1]) < 21.1) & (normal @ ray < 0))[sight.ray]
    seen, goes = sight.ray[first], sight.behind[1][:, first]
    bare = np.isclose(share[seen], 0.9, rtol=1e-6)  # its reflectance
    assert bare.sum() > 1e4
    np.testing.assert_allclose(goes[:, bare], mirrored[:, seen[bare]], rtol=0, atol=1e-6)
    meets, near = (
        crosses((-20 - e, -20 - e, -e), (20 + e, 20 + e, 6 + e), met[:, seen], mirrored[:, seen])
        for e in (-1e-3, 1e-3)
    )
    assert meets.sum() > 100
    assert not bare[meets].any()
    assert bare[~near].all()


def crosses(low, high, origin, direction):
    """Return which rays meet a box, by its three pairs of planes."""
    ends = [(np.array(end)[:, None] - origin) / direction for end in (low, high)]
    return np.maximum(np.minimum(*ends).max(axis=0), 0) < np.maximum(*ends).min(axis=0)


def test_between_pixels_the_picture_is_linear():
    """Against scipy's interpolation."""
    rng = np.random.default_rng(1)
    picture, (u, v) = rng.uniform(size=(5, 7, 3)), rng.uniform(-1, 1, (2, 200))
    at = np.clip([(1 - v) * 2.5 - 0.5, (u + 1) * 3.5 - 0.5], 0, [[4], [6]])
    expected = [map_coordinates(channel, at, order=1) for channel in np.moveaxis(picture, -1, 0)]
    np.testing.assert_allclose(interpolated(picture, u, v), np.transpose(expected), rtol=0, atol=1e-14)
