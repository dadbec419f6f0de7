"""Lenses of other programs that are not round, whose splines are split, or that a Lens cannot hold."""

import re

import build123d as bd
import numpy as np
import pytest
from OCP.BRepAlgoAPI import BRepAlgoAPI_Splitter
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakeSolid,
    BRepBuilderAPI_Sewing,
)
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
from OCP.gp import gp_Vec
from OCP.TopAbs import TopAbs_SOLID

from tests.cases import slow_unless
from tests.thbcad.cad.foreign.cases import Meridian, RoundLens, integral
from tests.thbcad.drawings.cases import WAVY, WIDER
from tests.thbcad.io.cases import written
from thbcad import Conic, FreeformSurface, Lens, read_lens_solid, to_build123d, write_step
from thbcad.cad.exchange import explore, solid_volume
from thbcad.cad.foreign.glass_checks import cut_by_walls
from thbcad.cad.foreign.surveyed_faces import surveyed
from thbcad.cad.occt_names import ShapeList, as_shell
from thbcad.cad.shapes import geom_surface
from thbcad.lens import placed_surfaces
from thbcad.splines import BSplineSurface, KnotVector, interpolate

FRONT, REAR, THICKNESS = 40.0, -60.0, 6.0
EVEN = Meridian(-40.0, -1.0, (-2e-5, 3e-8))  # of degree 8 in x and in y


def sphere(radius, r):
    return radius - np.sign(radius) * np.sqrt(radius**2 - r**2)


def two_spheres(outline):
    """What a prism along z leaves of two spheres of radii 40 and 60 mm that are 6 mm apart on the axis."""
    ball = bd.Pos(0, 0, FRONT) * bd.Sphere(FRONT) & bd.Pos(0, 0, THICKNESS + REAR) * bd.Sphere(-REAR)
    return ball & outline


def volume_over(top, segments=1):
    """4 times the integral of the thickness of `two_spheres` over 0 <= x, 0 <= y <= top(x), mm^3.

    top : x_0, x_1, ... and the functions between them
    """
    nodes, weights = np.polynomial.legendre.leggauss(80)
    total = 0.0
    for low, high, f in top:
        # x = high - (high - low) s^2 makes a vertical end of an arc smooth
        s = (nodes + 1) / 2
        x, dx = high - (high - low) * s**2, (high - low) * 2 * s * weights / 2
        y = f(x)[:, None] * s
        r = np.hypot(x[:, None], y)
        thickness = THICKNESS + sphere(REAR, r) - sphere(FRONT, r)
        total += float((dx * f(x)) @ thickness @ (weights / 2))
    return 4 * total


A, B, C = 9.0, 6.0, 2.0


def corner(x):
    return B - C + np.sqrt(np.maximum(C**2 - (x - (A - C)) ** 2, 0))


OUTLINES = {
    "rectangle": (lambda: bd.Box(2 * A, 2 * B, 40), [(0, A, lambda x: B + 0 * x)]),
    "rounded": (
        lambda: bd.fillet(bd.Box(2 * A, 2 * B, 40).edges().filter_by(bd.Axis.Z), C),
        [(0, A - C, lambda x: B + 0 * x), (A - C, A, corner)],
    ),
    "ellipse": (
        lambda: bd.Pos(0, 0, -20) * bd.extrude(bd.Ellipse(A, B), 40),
        [(0, A, lambda x: B * np.sqrt(np.maximum(1 - (x / A) ** 2, 0)))],
    ),
}


@pytest.mark.parametrize("turn", [pytest.param((0, 0, 0), marks=pytest.mark.slow), (10, 20, 70)])
@pytest.mark.parametrize("word", OUTLINES)
def test_an_outline_is_named_and_holds_the_right_volume(tmp_path, word, turn):
    outline, top = OUTLINES[word]
    solid = bd.Pos(1, 2, 3) * bd.Rot(*turn) * two_spheres(outline())
    found = read_lens_solid(written(solid.wrapped, tmp_path / "lens.step"))
    assert (found.front.outline, found.rear.outline) == (word, word)
    assert sorted(found.front.half_width) == pytest.approx([B, A], rel=1e-6)
    refit = found.refit(1.5)
    assert refit.volume == pytest.approx(volume_over(top), rel=1e-6)
    assert refit.solid_volume == pytest.approx(volume_over(top), rel=1e-6)
    if word == "rounded":
        assert refit.lens.front.corners == pytest.approx((C, C), rel=1e-6)
    assert refit.how == ("conic", "conic")


def halved(solid):
    """A solid whose faces are split along the plane x = 0."""
    arguments, tools = ShapeList(), ShapeList()
    faces = BRepBuilderAPI_Sewing(1e-7)
    knife = bd.Plane.YZ.location * bd.Face.make_rect(100, 100)
    for face in solid.faces():
        arguments.Clear(), tools.Clear()
        arguments.Append(face.wrapped)
        tools.Append(knife.wrapped)
        splitter = BRepAlgoAPI_Splitter()
        splitter.SetArguments(arguments)
        splitter.SetTools(tools)
        splitter.Build()
        for piece in bd.Compound(splitter.Shape()).faces():
            faces.Add(piece.wrapped)
    faces.Perform()
    return BRepBuilderAPI_MakeSolid(as_shell(faces.SewedShape())).Solid()


@pytest.mark.parametrize("outline", ["rectangle", "round"])
def test_a_spline_in_two_faces_is_that_spline(tmp_path, outline):
    whole = to_build123d(WAVY) if outline == "rectangle" else to_build123d(WAVY) & bd.Cylinder(3.5, 100)
    path = written(halved(whole), tmp_path / "lens.step")
    found = read_lens_solid(path)
    refit = found.refit(1.5)
    assert len(found.rear.faces) == 2
    assert (refit.how, refit.proven) == (("plane", "spline as it is"), (True, True))
    assert found.rear.control_points == (9, 8)
    x, y = np.linspace(-2.4, 2.4, 9), np.linspace(-2.4, 2.4, 9)
    exact = WAVY.rear.grid(x, y) - WAVY.rear(0, 0)
    assert refit.lens.rear.grid(x, y) - refit.lens.rear(0, 0) == pytest.approx(exact, abs=1e-11)
    assert refit.volume == pytest.approx(solid_volume(whole.wrapped, 1e-9), rel=1e-8)
    if outline == "rectangle":
        assert refit.volume == pytest.approx(WAVY.volume(), rel=1e-8)


@pytest.mark.parametrize(
    "cuts", slow_unless(lambda cuts: len(cuts[0]) < 2, [((-1.1,), (0.4,)), ((-2.0, 1.3), (-1.0, 2.0))])
)
def test_a_spline_that_was_cut_into_several_is_one_again(tmp_path, cuts):
    """Each piece has its own knots and poles; a plate of constant thickness has them twice."""
    spline = placed_surfaces(WAVY)[1]
    ends = [
        [kv.start, *((kv.start + kv.stop) / 2 + c * (kv.stop - kv.start) / 2 / h for c in cut), kv.stop]
        for kv, cut, h in zip(spline.knot_vectors, cuts, (5.0, 4.0))
    ]
    faces = BRepBuilderAPI_Sewing(1e-7)
    for u0, u1 in zip(ends[0], ends[0][1:]):
        for v0, v1 in zip(ends[1], ends[1][1:]):
            faces.Add(BRepBuilderAPI_MakeFace(geom_surface(spline.segment((u0, u1), (v0, v1))), 1e-7).Face())
    faces.Perform()
    solid = BRepPrimAPI_MakePrism(faces.SewedShape(), gp_Vec(0, 0, 2.5)).Shape()
    (first, *others) = [bd.Solid(one) for one in explore(solid, TopAbs_SOLID)]
    body = first.fuse(*others, glue=True) if others else first
    (body,) = bd.Compound([body]).solids()
    found = read_lens_solid(written(body.wrapped, tmp_path / "lens.step"))
    refit = found.refit(1.5)
    assert len(found.rear.faces) == (len(cuts[0]) + 1) * (len(cuts[1]) + 1)
    assert (refit.how, refit.proven) == (("spline as it is",) * 2, (True, True))
    assert max(refit.deviation) < 1e-9
    x, y = np.linspace(-5, 5, 21), np.linspace(-4, 4, 21)
    exact = WAVY.rear.grid(x, y) - WAVY.rear(0, 0)
    assert refit.lens.rear.grid(x, y) - refit.lens.rear(0, 0) == pytest.approx(exact, abs=1e-9)
    assert refit.volume == pytest.approx(10 * 8 * 2.5, rel=1e-9)


def test_an_even_asphere_as_a_polynomial_spline_is_exact(tmp_path):
    """z(r) of degree 8 is a Bezier surface of degrees 8 and 8 over a square; the lens is a disk of it."""
    kv = KnotVector.uniform(8, 1, -9.0, 9.0)
    heights = interpolate(kv, kv, lambda x, y: 4.0 + EVEN(np.hypot(x, y))).coefficients
    x, y = np.meshgrid(kv.greville(), kv.greville(), indexing="ij")
    surface = BSplineSurface(kv, kv, np.stack([x, y, heights], axis=-1))
    face = BRepBuilderAPI_MakeFace(geom_surface(surface), 1e-7).Face()
    block = bd.Solid(BRepPrimAPI_MakePrism(face, gp_Vec(0, 0, -20)).Shape())
    solid = (block & bd.Pos(0, 0, 5) * bd.Cylinder(8, 10)).solids()[0]
    found = read_lens_solid(written(solid.wrapped, tmp_path / "lens.step"))
    refit = found.refit(1.5)
    lens = RoundLens(Meridian(), EVEN, 4.0, 8.0)
    assert refit.how == ("plane", "spline as it is")
    assert refit.volume == pytest.approx(lens.volume, rel=1e-7)
    assert refit.solid_volume == pytest.approx(lens.volume, rel=1e-7)
    r = np.linspace(0, 7.99, 21)
    assert refit.lens.rear(0.6 * r, -0.8 * r) == pytest.approx(EVEN(r), abs=1e-9)


def test_a_round_lens_cut_off_the_axis_is_fitted(tmp_path):
    """Its vertex is not that of the spheres, 4 mm aside."""
    solid = two_spheres(bd.Pos(4, 0, 0) * bd.Cylinder(5, 40))
    refit = read_lens_solid(written(solid.wrapped, tmp_path / "lens.step")).refit(1.5)
    assert refit.how == ("fitted spline",) * 2
    assert max(refit.deviation) < 1e-7
    turn = np.linspace(0, 2 * np.pi, 129)[:-1]

    def mean_thickness(r):  # around the axis at x = 4
        at = np.hypot(4 + np.multiply.outer(r, np.cos(turn)), np.multiply.outer(r, np.sin(turn)))
        return (THICKNESS + sphere(REAR, at) - sphere(FRONT, at)).mean(axis=1)

    assert refit.volume == pytest.approx(integral(mean_thickness, 5.0), rel=1e-6)
    assert refit.solid_volume == pytest.approx(integral(mean_thickness, 5.0), rel=1e-6)
    x = np.linspace(-4.9, 4.9, 9)
    assert refit.lens.front(x, 0 * x) == pytest.approx(sphere(FRONT, 4 + x) - sphere(FRONT, 4), abs=1e-7)


def plano_convex(outline):
    """What a prism along z leaves of a ball of radius 20 mm above the plane z = 0, 3.5 mm high."""
    return outline & bd.Pos(0, 0, -16.5) * bd.Sphere(20) & bd.Pos(0, 0, 10) * bd.Box(50, 50, 20)


RIM_HEIGHT = 20 * (1 - np.sqrt(1 - (5 / 20) ** 2))  # of the cap of the ball over a disk of radius 5 mm
PLANO_CONVEX = np.pi * (25 * (3.5 - RIM_HEIGHT) + RIM_HEIGHT**2 * (20 - RIM_HEIGHT / 3))  # mm^3


@pytest.mark.parametrize("height", [1.0, 2.0])
def test_a_flange_lies_outside_the_outline_of_the_smaller_face(tmp_path, height):
    """A cone from rim to rim would hold more glass than the solid over the lower flange, and air in both."""
    solid = plano_convex(bd.Cylinder(5, 40)) + bd.Pos(0, 0, height / 2) * bd.Cylinder(7, height)
    refit = read_lens_solid(written(solid.wrapped, tmp_path / "lens.step")).refit(1.5)
    assert refit.lens.front.half_width == pytest.approx((5, 5), rel=1e-9)
    assert refit.lens.rear.half_width == pytest.approx((5, 5), rel=1e-9)
    assert refit.volume == pytest.approx(PLANO_CONVEX, rel=1e-8)
    assert refit.solid_volume - refit.volume == pytest.approx(np.pi * (49 - 25) * height, rel=1e-6)
    assert f"{np.pi * 24 * height:.6g} mm^3 of the solid's" in str(refit)


@pytest.mark.parametrize("shorter", [1e-4, 3e-6, 1e-9])
def test_an_ellipse_that_is_nearly_a_circle_holds_its_volume(tmp_path, shorter):
    """Mean height over the ellipse: that over the disk but for terms of first order in the difference."""
    b = 5 * (1 - shorter)
    solid = plano_convex(bd.extrude(bd.Ellipse(5, b), 40))
    refit = read_lens_solid(written(solid.wrapped, tmp_path / "lens.step")).refit(1.5)
    assert refit.lens.front.half_width == pytest.approx((5, b), rel=1e-7)
    # the strip that is lost, of width (5 - b) sin^2 t, is as high as the rim
    lost = np.pi * 5 * (5 - b) * (3.5 - RIM_HEIGHT)
    assert refit.volume == pytest.approx(PLANO_CONVEX - lost, rel=1e-6)


def test_ruled_walls_between_rectangles_of_other_proportions_do_not_cut_their_lens(tmp_path):
    path = tmp_path / "lens.step"
    write_step(WIDER, path)
    found = read_lens_solid(path)
    lens = found.refit(1.5).lens
    assert [surface.half_width for _, surface, _ in lens.faces] == [(5, 4), (8, 7)]
    assert not cut_by_walls(found.frame, surveyed(found.shape), (found.front, found.rear), lens)


def test_a_drafted_wall_stays_one(tmp_path):
    front, rear = (FreeformSurface((r, r), Conic(R), corners=(r, r)) for r, R in ((7, np.inf), (5, -20.0)))
    path = tmp_path / "lens.step"
    write_step(Lens(front, rear, 3.5, 1.5), path)
    refit = read_lens_solid(path).refit(1.5)
    sizes = [surface.half_width[0] for _, surface, _ in refit.lens.faces]
    assert sizes == pytest.approx([7, 5], rel=1e-9)
    cone = np.pi * (49 + 35 + 25) * (3.5 - RIM_HEIGHT) / 3
    assert refit.volume == pytest.approx(cone + PLANO_CONVEX - 25 * np.pi * (3.5 - RIM_HEIGHT), rel=1e-8)


def hexagon():
    return two_spheres(bd.Pos(0, 0, -20) * bd.extrude(bd.RegularPolygon(8, 6), 40))


def d_cut():
    return two_spheres(bd.Cylinder(10, 40) & bd.Pos(3, 0, 0) * bd.Box(20, 30, 40))


def dimple():
    """A ball of 2 mm radius has left its mark in the middle of the front."""
    return two_spheres(bd.Cylinder(10, 40)) - bd.Pos(0, 0, -1.2) * bd.Sphere(2)


def drilled():
    return two_spheres(bd.Cylinder(10, 40)) - bd.Pos(3, 0, 0) * bd.Cylinder(1, 40)


def pierced():
    return plano_convex(bd.Cylinder(5, 40)) - bd.Pos(2, 0, 0) * bd.Cylinder(0.05, 40)


def drilled_through_the_middle():
    return plano_convex(bd.Cylinder(5, 40)) - bd.Cylinder(1, 40)


def revolved_cone():
    """z = 4 - 0.3 r as a spline that is revolved, which is no cone by its kind."""
    r = np.linspace(0, 5, 40)
    top = bd.Edge.make_spline([(x, 0, 4 - 0.3 * x) for x in r.tolist()])
    sides = bd.Polyline((5, 0, 2.5), (5, 0, 0), (0, 0, 0), (0, 0, 4)).edges()
    return bd.revolve(bd.make_face([top, *sides]), bd.Axis.Z)


def hollow():
    return two_spheres(bd.Cylinder(10, 40)) - bd.Pos(1, 0, 3) * bd.Sphere(0.5)


def bored_from_the_side():
    return two_spheres(bd.Cylinder(10, 40)) - bd.Pos(8, 0, 3) * bd.Rot(0, 90, 0) * bd.Cylinder(0.5, 10)


def stepped_edge():
    """A round front over a square body: the rear has another outline."""
    body = two_spheres(bd.Box(12, 12, 40))
    return body & (bd.Pos(0, 0, 13) * bd.Box(40, 40, 20) + bd.Cylinder(5, 40))


REFUSED = {
    "hexagon": (hexagon, r"the outline of the front, 16 x 13.8564 mm and 166.277 mm\^2, is .* 0.944 mm off"),
    "D cut": (d_cut, r"the outline of the front, 17 x 20 mm and 284.609 mm\^2"),
    "dimple": (dimple, r"two curved surfaces, a sphere of radius 2 mm and a sphere of radius 40 mm"),
    "half ball": (lambda: bd.Sphere(5) & bd.Pos(0, 0, 10) * bd.Box(20, 20, 20), "as a half ball is"),
    "drilled": (drilled, r"the front, a sphere .*: it has an opening of 3\.1\d* mm\^2"),
    "pierced": (pierced, r"the front, a plane, .* outline: it has an opening of 0\.00785398 mm\^2"),
    "drilled through the middle": (
        drilled_through_the_middle,
        "misses one of the two faces, as at an opening",
    ),
    "cone": (revolved_cone, "an optical face is a cone with its tip on the axis"),
    "hollow": (hollow, "holds a solid with a cavity"),
    "bored": (bored_from_the_side, r"another face, a cylinder, within the outline of front and rear"),
    "two outlines": (stepped_edge, r"the outlines of front and rear differ: diameter 10 mm and 12 x 12 mm"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_a_lens_cannot_hold_is_refused_for_its_reason(tmp_path, name):
    make, words = REFUSED[name]
    solid = make()
    (body,) = solid.solids()
    path = written(body.wrapped, tmp_path / "lens.step")
    with pytest.raises(ValueError, match=words) as refused:
        read_lens_solid(path).refit(1.5)
    assert str(refused.value).startswith(f"{path}: ")
    assert not re.search(r"allow a greater tolerance|none opposite", str(refused.value))
