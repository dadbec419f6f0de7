"""Round lenses that were trimmed and chamfered in build123d, whose OCCT gives chamfers degree 13."""

import build123d as bd
import numpy as np
import pytest

from tests.thbcad.drawings.cases import WAVY
from thbcad import read_lens_solid, to_build123d
from thbcad.cad.foreign.face_groups import rim_edges, rim_points
from thbcad.cad.foreign.optical_surface import in_frame

RADIUS = 3.5  # mm; WAVY is 5 mm wide at least


def chamfered(shape, path):
    """Write a shape that was trimmed by a cylinder and chamfered at both of its rims."""
    trimmed = shape & bd.Cylinder(RADIUS, 100)
    rims = [edge for edge in trimmed.edges() if edge.length > 5 * RADIUS]
    assert len(rims) == 2
    bd.export_step(bd.Pos(7, -5, 3) * bd.chamfer(rims, 0.2), path)
    return read_lens_solid(path)


def test_a_chamfered_freeform_lens_keeps_its_spline(tmp_path):
    """The rim that a chamfer leaves of a freeform surface is no ellipse, and not quite centred."""
    found = chamfered(to_build123d(WAVY), tmp_path / "lens.step")
    assert RADIUS - 0.25 < found.rear.half_width.min() <= found.rear.half_width.max() < RADIUS - 0.1
    refit = found.refit(1.5)
    x, y = 2 * np.random.default_rng(1).uniform(-1, 1, (2, 200))
    shift = found.frame.shift - (7, -5, 3)
    for made, own, vertex in (
        (refit.lens.front, WAVY.front, 0),
        (refit.lens.rear, WAVY.rear, WAVY.thickness),
    ):
        start = found.thickness if vertex else 0.0
        apart = shift[2] + start + made(x, y) - vertex - own(x + shift[0], y + shift[1])
        assert np.abs(apart).max() < 1e-9


def test_a_chamfered_lens_of_two_spheres_is_two_conics(tmp_path):
    """The axis goes through the centres of the spheres, not through the middle of a rim."""
    front, rear = 30.0, 40.0
    ball = bd.Pos(0, 0, front - 2) * bd.Sphere(front) & bd.Pos(0, 0, 2 - rear) * bd.Sphere(rear)
    found = chamfered(ball, tmp_path / "lens.step")
    refit = found.refit(1.5)
    assert (refit.how, refit.proven) == (("conic", "conic"), (True, True))
    assert found.thickness == pytest.approx(4, abs=1e-9)
    assert found.frame.shift == pytest.approx((7, -5, 1), abs=1e-9)
    assert refit.lens.front.conic.radius == pytest.approx(front, abs=1e-9)
    assert refit.lens.rear.conic.radius == pytest.approx(-rear, abs=1e-9)


@pytest.mark.parametrize("turn", [(0, 0, 0), (20, 35, 50)])
def test_a_chamfered_round_lens_stays_round_however_it_is_turned(tmp_path, turn):
    """The rims are splines that OCCT makes within 1e-5 of circles; the lens of it ends there."""
    ball = bd.Pos(0, 0, 27) * bd.Sphere(30) & bd.Pos(0, 0, -38) * bd.Sphere(40)
    trimmed = ball & bd.Cylinder(10, 100)
    rims = [edge for edge in trimmed.edges() if edge.length > 50]
    path = tmp_path / "lens.step"
    bd.export_step(bd.Pos(3, 4, 5) * bd.Rot(*turn) * bd.chamfer(rims, 0.25), path)
    found = read_lens_solid(path)
    assert (found.front.outline, found.rear.outline) == ("ellipse", "ellipse")
    lens = found.refit(1.5).lens
    for face, made in ((found.front, lens.front), (found.rear, lens.rear)):
        assert made.outline.is_circle
        assert np.ptp(face.half_width) < 1e-4
        assert 9.7 < made.half_width[0] == face.half_width.min() < 9.8


def test_the_lens_of_a_rim_that_is_nearly_round_lies_within_the_glass(tmp_path):
    """A chamfer of a wavy surface: the rim is off an ellipse by 2e-3 of its size."""
    found = chamfered(to_build123d(WAVY), tmp_path / "lens.step")
    assert found.rear.outline == "other"
    lens = found.refit(1.5).lens
    rim = in_frame(found.frame, rim_points(rim_edges(found.rear.faces)))[:, :2]
    assert lens.rear.outline.is_ellipse
    gauge = lens.rear.outline.gauge(*rim.T)
    assert 1 - 1e-9 < gauge.min() < gauge.max() < 1.02


def test_a_sphere_that_ends_within_the_square_round_its_rim_is_refused_by_name(tmp_path):
    ball = bd.Sphere(13) & bd.Pos(0, 0, 8) * bd.Cylinder(12, 10)
    bd.export_step(ball, tmp_path / "lens.step")
    with pytest.raises(ValueError, match="is a sphere of radius 13 mm that ends within the rectangle"):
        read_lens_solid(tmp_path / "lens.step").refit(1.5)
