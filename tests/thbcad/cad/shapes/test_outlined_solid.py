"""Lenses with an outline as solids: cylinders, prisms, cones and ruled edges against closed forms, OCCT and
the text of their files."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.cases import examples
from tests.thbcad.cad.shapes.cases import assert_sound, rough
from thbcad.cad.exchange import part_step, read_step, solid_volume
from thbcad.cad.shapes import flanged_part, lens_part, polygon_part, trimmed_part
from thbcad.io import brep_of_text, volume
from thbcad.lens import Flange, FreeformSurface, Lens, Product, flanged_volume, ruled_edges
from thbcad.sags import Conic

SIZES = st.floats(1.0, 50.0)
ROUGH, PLANE, SPHERE = (Conic(-70.0, -1.0), rough((2, 2))), (), (Conic(80.0),)
SAME, TAPERED = ((10.0, 8.0), (10.0, 8.0)), ((10.0, 8.0), (12.0, 14.0))


def outlined(halves, corners, front=PLANE, rear=PLANE, thickness=12.0):
    """A lens whose corners are a share of its half-widths."""
    surfaces = (
        FreeformSurface(half, *shape, corners=tuple(np.multiply(half, corners)))
        for half, shape in zip(halves, (front, rear))
    )
    return Lens(*surfaces, thickness, 1.5)


def frustum(a, b, height):
    """The volume between two ellipses of semi-axes a and b."""
    mixed = (a[0] * b[1] + a[1] * b[0]) / 2
    return np.pi * height * (a[0] * a[1] + mixed + b[0] * b[1]) / 3


@pytest.fixture(
    scope="module",
    params=[
        (halves, corners, front, rear)
        for halves in (SAME, TAPERED)
        for corners in ((1.0, 1.0), (0.3, 0.5), (1.0, 0.5))
        for front, rear in ((PLANE, ROUGH), (SPHERE, PLANE))
    ],
    ids=str,
)
def written(request, tmp_path_factory):
    """(lens, part, text, what was read back), written once for each case."""
    lens = outlined(*request.param)
    part = lens_part(lens)
    path = tmp_path_factory.mktemp("outline") / "lens.step"
    path.write_bytes(part_step(part, Product()))
    return lens, part, path.read_text(), read_step(path)


@examples(40)
@given(st.tuples(SIZES, SIZES), st.tuples(SIZES, SIZES), SIZES, st.floats(0.05, 1.0))
def test_volume_between_planes_is_that_of_a_frustum(front, rear, height, share):
    assert outlined((front, rear), (1, 1), thickness=height).volume() == pytest.approx(
        frustum(front, rear, height), rel=1e-13
    )
    similar = outlined((front, np.multiply(front, 2)), (share, share), thickness=height)
    assert similar.volume() == pytest.approx(similar.front.outline.area * height * 7 / 3, rel=1e-12)


@examples(20)
@given(SIZES, SIZES, st.floats(100.0, 1000.0), st.floats(100.0, 1000.0))
def test_volume_between_paraboloids_is_a_frustum_with_two_caps(a, b, front, rear):
    """A cap of height h = a^2 / 2R over a circle holds pi a^2 h / 2."""
    lens = outlined(((a, a), (b, b)), (1, 1), (Conic(front, -1.0),), (Conic(-rear, -1.0),), 40.0)
    low, high = a * a / (2 * front), 40.0 - b * b / (2 * rear)
    caps = np.pi * (a * a * low + b * b * (40.0 - high)) / 2
    assert lens.volume() == pytest.approx(frustum((a, a), (b, b), high - low) + caps, rel=1e-12)


def test_a_lens_within_an_ellipse_is_the_rectangle_with_that_aperture():
    for half in ((7.0, 7.0), (7.0, 9.0)):
        oval = outlined((half, half), (1, 1), SPHERE, ROUGH)
        square = outlined((half, half), (0, 0), SPHERE, ROUGH)
        assert part_step(lens_part(oval), Product()) == part_step(trimmed_part(square, half), Product())


@pytest.mark.every(3)
def test_the_solid_is_closed_and_keeps_every_pole(written):
    lens, part, _, read = written
    assert_sound(lens, part, read, 2 + len(lens.rear.outline.pieces))


@pytest.mark.every(3)
def test_volumes_agree(written):
    """Rims on spheres lie within 1e-9 mm: 4 / (2 x 8) of that in the volume, and twice that of both rims."""
    lens, part, text, read = written
    assert volume(brep_of_text(text)) == pytest.approx(lens.volume(), rel=1e-9)
    assert solid_volume(part.solid, 1e-8) == pytest.approx(lens.volume(), rel=1e-8)
    assert solid_volume(read.shape, 1e-8) == pytest.approx(lens.volume(), rel=1e-8)


@pytest.mark.parametrize("corners", [(1.0, 1.0), (0.3, 0.5)])
def test_ruled_edges_join_points_of_equal_relative_position(corners):
    lens = outlined(TAPERED, corners, SPHERE, ROUGH)
    for edge in ruled_edges(lens):
        s = np.linspace(edge.kv_u.start, edge.kv_u.stop, 301)
        front, rear = np.moveaxis(edge.grid(s, [0.0, 1.0]), 1, 0)
        assert abs(front[:, :2] / TAPERED[0] - rear[:, :2] / TAPERED[1]).max() < 1e-9
        for surface, points, vertex in ((lens.front, front, 0.0), (lens.rear, rear, lens.thickness)):
            x, y, z = points.T
            assert abs(surface.outline.gauge(x, y) - 1).max() < 1e-9
            # points that the fit puts 1e-9 mm beside the rectangle; slopes are below 1
            x, y = (np.clip(row, -h, h) for row, h in zip((x, y), surface.half_width))
            assert abs(z - vertex - surface(x, y)).max() < 5e-9


@pytest.mark.parametrize("halves", [SAME, TAPERED])
@pytest.mark.parametrize("corners", [(1.0, 1.0), (0.3, 0.5)])
def test_a_flange_goes_round_the_outline(halves, corners):
    lens, flange = outlined(halves, corners, (Conic(300.0, -1.0),), PLANE), Flange(2.0, 4.0, 6.0)
    part = flanged_part(lens, flange)
    assert len(part.faces) == 4 + 3 * len(lens.rear.outline.pieces)
    assert solid_volume(part.solid, 1e-8) == pytest.approx(flanged_volume(lens, flange), rel=1e-7)


def test_cuts_lie_within_the_outline():
    """Every ellipse in the half-widths does; of a polygon every corner must."""
    lens = outlined(SAME, (0.9, 0.875))
    assert len(trimmed_part(lens, (10.0, 8.0)).faces) == 4
    assert len(polygon_part(lens, [(-6, -5), (6, -5), (0, 8)]).faces) == 5
    with pytest.raises(ValueError, match=r"within the front's outline of half-widths \(10.0, 8.0\) mm"):
        polygon_part(lens, [(-9.5, -7.5), (6, -5), (0, 8)])
