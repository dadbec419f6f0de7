"""The page that is turned in a browser: it is whole in itself, small, and holds the lens's own points."""

import re
from base64 import b64decode
from itertools import pairwise

import numpy as np
import pytest

from optics.light.tracing import RayPath
from optics.reporting.view.viewer_page import MOST_PATHS, SAMPLES, scene_page
from tests.optics.cases import rough, small_lens, small_space, small_system
from tests.optics.reporting.cases import held
from thbcad.lens import SIDES, FreeformSurface, Lens
from thbcad.sags import Conic
from thbcad.surfaces import THBSurface

NARROW = 8.0  # mm, half-width of the rear where it differs from the front's
FAR = {"target.distance": float("inf"), "target.half_width": [30.0, 30.0]}


@pytest.fixture
def page(tmp_path):
    """A function from a lens to its page; changes are those of the small problem."""

    def make(lens, irradiance=None, paths=(), **changes):
        system = small_system(tmp_path, changes)
        return scene_page(
            system.with_lens(lens), np.ones((48, 48)) if irradiance is None else irradiance, paths
        )

    return make


def rough_lens():
    """Return a lens with two free surfaces of different size, neither of them symmetric."""
    front, rear = small_space(), small_space((NARROW, 10.0))
    return Lens(
        FreeformSurface((10.0, 10.0), Conic(), THBSurface(front, rough(front, seed=1))),
        FreeformSurface((NARROW, 10.0), Conic(40.0, -1.0), THBSurface(rear, rough(rear, 0.5))),
        6.0,
        1.5,
    )


def numbers(text, kind):
    return np.frombuffer(b64decode(text, validate=True), kind)


def grid(stored, shape, kind):
    """Return numbers on a grid, of which equal rows and columns are stored once."""
    rows, columns, text = stored
    return np.broadcast_to(numbers(text, kind).reshape(rows, columns), shape)


def decoded(face):
    """Return points (3, n, m) in mm and normals (3, n, m) of a face as the browser makes them."""
    points = np.array([grid(g, face["shape"], "<f4") for g in face["points"]], float)
    nx, ny = (grid(g, face["shape"], "<i2") / 32767 for g in face["normals"][:2])
    last = face["normals"][2]
    nz = (
        face["side"] * np.sqrt(1 - nx**2 - ny**2)
        if last is None
        else grid(last, face["shape"], "<i2") / 32767
    )
    return points, np.array([nx, ny, nz])


def path(*points, fate="on_target"):
    return RayPath(np.array(points, float), fate)


@pytest.mark.slow
def test_points_are_the_lens_s_own_rounded_to_float32(page):
    """Half a unit in the last place of float32, of z and of x and y times the greatest slope, below 1."""
    lens = rough_lens()
    front, rear = (decoded(face)[0] for face in held(page(lens))["faces"][:2])
    for (x, y, z), surface, vertex in ((front, lens.front, 0.0), (rear, lens.rear, lens.thickness)):
        x, y = x[:, 0], y[0]
        assert [x[0], x[-1], y[0], y[-1]] == [s * h for h in surface.half_width for s in (-1, 1)]
        assert len(x) == len(y) == SAMPLES
        assert z - vertex == pytest.approx(surface.grid(x, y), abs=3 * 2**-25 * 16, rel=0)


def test_edges_join_the_rims_of_front_and_rear(page):
    faces = held(page(rough_lens()))["faces"]
    (front, _), (rear, _) = (decoded(face) for face in faces[:2])
    for side, face in zip(SIDES, faces[2:], strict=True):
        rim = np.s_[:, :, side.end] if side.axis == 0 else np.s_[:, side.end]
        points, _ = decoded(face)
        assert np.array_equal(points[:, :, 0], front[rim])
        assert np.array_equal(points[:, :, 1], rear[rim])


def test_triangles_run_counter_clockwise_seen_from_outside(page):
    """By the divergence theorem their volumes sum to that of the lens, but for chords."""
    lens = rough_lens()
    volume = 0.0
    for face in held(page(lens))["faces"]:
        p, _ = decoded(face)
        a, b, c, d = p[:, :-1, :-1], p[:, 1:, :-1], p[:, 1:, 1:], p[:, :-1, 1:]
        if face["flip"]:
            b, d = d, b
        for q, r in ((b, c), (c, d)):
            volume += np.einsum("kij,kij->", a, np.cross(q, r, axis=0)) / 6
    assert volume == pytest.approx(lens.volume(), rel=1e-3)


def test_normals_have_length_one_and_point_outwards(page):
    for face in held(page(rough_lens()))["faces"]:
        points, normals = decoded(face)
        assert np.linalg.norm(normals, axis=0) == pytest.approx(np.ones(face["shape"]), abs=1e-4)
        assert ((points - np.array([0, 0, 3.0])[:, None, None]) * normals).sum(axis=0).mean() > 0


def test_a_plane_front_takes_no_room(page):
    plane, free = (held(page(small_lens()))["faces"][k] for k in (0, 1))
    assert plane["points"][2][:2] == [1, 1]
    assert free["points"][2][:2] == [SAMPLES, SAMPLES]


def test_the_page_asks_for_nothing(page):
    text = page(rough_lens(), title="</script><b>&DATA TITLE")
    assert "default-src 'none'" in text
    assert not re.search(r"https?:|url\(|@import|\b(src|href)=|fetch|XMLHttp|WebSocket|import\(|eval", text)
    assert text.count("</script>") == 2
    assert "<title>&lt;/script&gt;&lt;b&gt;&amp;DATA TITLE</title>" in text
    assert held(text)["caption"] == "target 40 x 40 mm, 60 mm behind the lens"


def test_the_page_has_at_most_a_megabyte(page):
    rng = np.random.default_rng(2)
    paths = [path(*rng.uniform(-9, 9, (67, 3)), fate="absorbed") for _ in range(3 * MOST_PATHS + 1)]
    text = page(rough_lens(), rng.uniform(size=(512, 512)), paths)
    assert len(text.encode()) <= 1_000_000
    data = held(text)
    assert max(data["target"]["image"]["shape"]) <= 256
    assert len(numbers(data["rays"]["points"], "<f4")) <= MOST_PATHS * 66 * 2 * 3


def test_rays_are_told_apart_by_what_they_hit(page):
    inside, outside = [(1, 2, -5), (1, 2, 0), (1, 2, 6), (3, 4, 66)], [(0, 0, -5), (0, 0, 0), (9, 9, 66)]
    rays = held(page(small_lens(), paths=[path(*outside, fate="off_target"), path(*inside)]))["rays"]
    ends = numbers(rays["points"], "<f4").reshape(-1, 2, 3)
    assert rays["hits"] == 6
    assert ends[:3].tolist() == [[[*a], [*b]] for a, b in pairwise(inside)]
    assert ends[3:].tolist() == [[[*a], [*b]] for a, b in pairwise(outside)]


def test_light_is_shown_up_to_its_brightest_pixels_but_one_in_a_thousand(page):
    light = np.zeros((48, 32))
    light[:24, 16:] = 2.0
    image = held(page(small_lens(), light))["target"]["image"]
    grey = numbers(image["grey"], np.uint8).reshape(image["shape"])
    assert np.array_equal(grey, np.where(light > 0, 255, 0))


@pytest.mark.parametrize("changes", [{}, FAR])
def test_an_empty_beam_and_a_dark_target_have_their_page(page, changes):
    data = held(page(small_lens(), np.zeros((48, 48)), **changes))
    assert data["rays"] == {"points": "", "hits": 0}
    assert (data["target"] is None) == bool(changes)
    assert np.isfinite(data["views"]["scene"]).all()


def test_the_far_field_is_seen_as_far_as_its_rays_are_drawn(page):
    data = held(page(small_lens(), paths=[path((0, 0, -5), (0, 0, 0), (0, 0, 6), (7, 8, 46))], **FAR))
    assert data["target"] is None
    assert [7.0, 8.0, 46.0] in data["views"]["scene"]


def test_the_same_lens_gives_the_same_page(page):
    lens = rough_lens()
    assert page(lens) == page(lens)
