"""Lenses of other programs: front, rear, frame and unit found in files with other headers, units, orders,
placements and surfaces; refits that are as near as they say."""

import random
import re
import tempfile
from itertools import pairwise
from pathlib import Path

import build123d as bd
import numpy as np
import pytest
from hypothesis import example, given, strategies as st
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
from OCP.gp import gp_Vec

from tests.cases import DATA, examples
from tests.thbcad.drawings.cases import PLAIN, WAVY, WIDER
from tests.thbcad.io.cases import written
from thbcad import read_lens_solid, to_build123d
from thbcad.cad.exchange import part_step
from thbcad.cad.shapes import flanged_part, geom_surface, lens_part, patched_part, trimmed_part
from thbcad.lens import Flange, Product, placed_surfaces

TOLERANCE = 1e-6


def heights_apart(lens, refit):
    """The greatest differences in z of front and rear of two lenses, each relative to its vertex."""
    apart = []
    for name in ("front", "rear"):
        own, other = getattr(lens, name), getattr(refit.lens, name)
        x, y = (
            np.linspace(-h * (1 - 1e-9), h * (1 - 1e-9), 41)
            for h in np.minimum(own.half_width, other.half_width)
        )
        middle = own(0, 0) - other(0, 0)
        apart.append(np.abs(own.grid(x, y) - other.grid(x, y) - middle).max())
    return apart


def is_wavy(found, tolerance=TOLERANCE):
    refit = found.refit(1.5, tolerance)
    middle = WAVY.thickness + WAVY.rear(0, 0) - WAVY.front(0, 0)
    assert found.thickness == pytest.approx(middle, abs=1e-9)
    assert max(heights_apart(WAVY, refit)) <= max(refit.deviation) + 1e-9
    return refit


@pytest.mark.parametrize(
    ("unit", "name", "size"), [("MM", "millimetre", 1), ("INCH", "inch", 25.4), ("M", "metre", 1000)]
)
@pytest.mark.parametrize("schema", ["AP214IS", "AP203", "AP242DIS"])
def test_units_and_schemas_do_not_matter(tmp_path, unit, name, size, schema):
    """OCCT's writer keeps the numbers of the shape and names another unit."""
    found = read_lens_solid(written(lens_part(WAVY).solid, tmp_path / "lens.step", unit, schema))
    assert found.unit == name
    assert found.rear.half_width == pytest.approx([5 * size, 4 * size], rel=1e-12)
    x = np.linspace(-5, 5, 11)
    heights = found.refit(1.5).lens.rear(size * x, 0 * x) / size
    assert heights == pytest.approx(WAVY.rear(x, 0 * x) - WAVY.rear(0, 0), abs=1e-10)


@pytest.mark.parametrize(
    ("before", "after", "unit"),
    [
        ("#1 = ", "#1 = ", "millimetre"),
        (r"#(\d+)(?=[,)\s])(?<!Context #1)", lambda m: f"#{int(m[1]) + 1000}", "millimetre"),
        (r"SI_UNIT\(\.MILLI\.,\.METRE\.\)", "CONTEXT_DEPENDENT_UNIT('millimetre')", "unknown"),
        (r"SI_UNIT\(\.MILLI\.,\.METRE\.\)", "SI_UNIT()", "unknown"),
    ],
    ids=["as it is", "without an entity 1", "by agreement", "nothing"],
)
def test_the_unit_is_that_of_the_context_or_unknown(tmp_path, before, after, unit):
    """OCCT names a context 'Context #1', which refers to nothing."""
    path = written(lens_part(PLAIN).solid, tmp_path / "lens.step")
    text, count = re.subn(before, after, path.read_text())
    assert count
    assert "'Context #1'" in text
    path.write_text(text)
    assert read_lens_solid(path).unit == unit


def shuffled(text, seed):
    """The text with another header, other numbers of entities in another order, and comments."""
    head, data = text.split("DATA;")
    body, tail = data.split("ENDSEC;")
    entities = [e.strip() for e in re.split(r";\s*(?=#|$)", body) if e.strip()]
    rng = random.Random(seed)
    rng.shuffle(entities)
    numbers = {}

    def renumbered(match):
        return f"#{numbers.setdefault(match[1], 7 * (len(numbers) + 100))}"

    entities = [re.sub(r"#(\d+)", renumbered, entity) for entity in entities]
    head = re.sub(
        r"FILE_NAME\(.*?\);", "FILE_NAME('','',(''),(''),'','other CAD 7','');", head, flags=re.DOTALL
    )
    return head + "DATA;\n/* by hand */\n" + ";\n".join(entities) + ";\nENDSEC;" + tail


@pytest.mark.parametrize("seed", range(3))
def test_headers_numbers_and_order_of_entities_do_not_matter(tmp_path, seed):
    text = part_step(lens_part(WAVY), Product()).decode()
    path = tmp_path / "lens.step"
    path.write_text(shuffled(text, seed).replace("'front'", "''").replace("'rear'", "'front'"))
    found = read_lens_solid(path)
    assert is_wavy(found).how == ("plane", "spline as it is")
    assert max(found.refit(1.5).deviation) < 1e-12


def test_a_lens_that_was_moved_and_turned_has_its_frame(tmp_path):
    place = bd.Pos(10, -20, 30) * bd.Rot(20, 30, 40)
    found = read_lens_solid(written((place * to_build123d(WAVY)).wrapped, tmp_path / "lens.step"))
    turn = place.wrapped.Transformation()
    matrix = np.array([[turn.Value(row, column) for column in (1, 2, 3)] for row in (1, 2, 3)])
    assert found.frame.shift == pytest.approx([10, -20, 30], abs=1e-9)
    assert found.frame.rotation == pytest.approx(matrix, abs=1e-9)
    assert max(is_wavy(found).deviation) < 1e-10


def test_an_upside_down_lens_has_its_front_below(tmp_path):
    found = read_lens_solid(
        written((bd.Rot(180, 0, 0) * to_build123d(PLAIN)).wrapped, tmp_path / "lens.step")
    )
    refit = found.refit(1.5)
    assert found.frame.rotation[:, 2] == pytest.approx([0, 0, 1])
    x = np.linspace(-4, 4, 9)
    assert refit.lens.front(x, 0 * x) == pytest.approx(-PLAIN.rear(x, 0 * x), abs=1e-9)
    assert refit.lens.rear(x, 0 * x) == pytest.approx(0 * x, abs=1e-9)


def prism(surface, change):
    geom = geom_surface(surface)
    change(geom)
    face = BRepBuilderAPI_MakeFace(geom, 1e-7).Face()
    return BRepPrimAPI_MakePrism(face, gp_Vec(0, 0, 2.5)).Shape()


@pytest.mark.parametrize("change", ["UReverse", "VReverse", "ExchangeUV"])
def test_reversed_and_swapped_parameters_do_not_matter(tmp_path, change):
    """A prism over the rear: front and rear are one surface, 2.5 mm apart."""
    uneven = placed_surfaces(WAVY)[1].insert([1.3], [-2.1])  # else mirrored knots are the same
    shape = prism(uneven, lambda geom: getattr(geom, change)())
    found = read_lens_solid(written(shape, tmp_path / "lens.step"))
    refit = found.refit(1.5)
    x, y = np.linspace(-5, 5, 21), np.linspace(-4, 4, 21)
    exact = WAVY.rear.grid(x, y) - WAVY.rear(0, 0)
    assert found.thickness == pytest.approx(2.5, abs=1e-12)
    assert refit.proven == (True, True)
    for surface in (refit.lens.front, refit.lens.rear):
        assert surface.grid(x, y) - surface(0, 0) == pytest.approx(exact, abs=1e-12)


def test_the_deviation_from_graph_form_is_measured_by_the_poles(tmp_path):
    def pushed(geom):
        pole = geom.Pole(4, 4)
        pole.SetX(pole.X() + 1e-4)
        geom.SetPole(4, 4, pole)

    found = read_lens_solid(written(prism(placed_surfaces(WAVY)[1], pushed), tmp_path / "lens.step"))
    assert 0.9e-4 < found.rear.graph_deviation < 1e-4  # less what the affine function follows
    assert found.refit(1.5, 1e-3).deviation[1] > 0
    refit = found.refit(1.5, 1e-5)  # not as it is, then
    assert (refit.how, refit.proven) == (("fitted spline",) * 2, (False, False))


def test_a_surface_in_patches_is_one(tmp_path):
    sag = WAVY.rear.sag.refine({0: [(i, j) for i in range(3) for j in range(3)]})
    lens = WAVY.with_rear(WAVY.rear.with_sag(sag))
    path = tmp_path / "lens.step"
    path.write_bytes(part_step(patched_part(lens), Product()))
    found = read_lens_solid(path)
    assert len(found.rear.faces) == len(lens.rear.sag.to_patches()) > 1
    assert (found.rear.degrees, found.rear.outline) == (None, "rectangle")


@pytest.mark.parametrize("flange", [None, Flange(2.0, 0.3, 1.0)])
def test_a_round_lens_with_a_flange_keeps_its_spline(tmp_path, flange):
    part = trimmed_part(WAVY, (3.5, 3.5)) if flange is None else flanged_part(WAVY, flange, (3.5, 3.5))
    found = read_lens_solid(written(part.solid, tmp_path / "lens.step"))
    assert (found.front.outline, found.rear.outline) == ("ellipse", "ellipse")
    assert max(heights_apart(WAVY, found.refit(1.5))) < 1e-9


def test_a_revolved_lens_is_a_plane_and_a_sphere(tmp_path):
    with bd.BuildPart() as part:
        with bd.BuildSketch(bd.Plane.XZ):
            with bd.BuildLine():
                bd.Polyline((0, 0), (10, 0), (10, 2))
                top = 2 + 40 - np.sqrt(40**2 - 10**2)
                bd.RadiusArc((10, 2), (0, top), -40)
                bd.Line((0, top), (0, 0))
            bd.make_face()
        bd.revolve(axis=bd.Axis.Z)
    found = read_lens_solid(written(part.part.wrapped, tmp_path / "lens.step"))
    refit = found.refit(1.5)
    assert (found.front.kind, found.rear.kind) == ("plane", "sphere")
    assert found.rear.periodic[0]
    assert found.thickness == pytest.approx(top, abs=1e-9)
    assert (refit.how, refit.proven) == (("plane", "conic"), (True, True))
    assert max(refit.deviation) < 1e-10
    assert refit.lens.rear.conic.radius == pytest.approx(-40, abs=1e-9)
    assert refit.lens.rear.conic.constant == 0


def test_the_seam_of_a_round_face_is_no_part_of_its_outline(tmp_path):
    lens = bd.Pos(0, 0, -28) * bd.Sphere(30) & bd.Pos(0, 0, 28) * bd.Sphere(30)
    found = read_lens_solid(written(lens.wrapped, tmp_path / "lens.step"))
    assert (found.front.outline, found.rear.outline) == ("ellipse", "ellipse")
    assert found.rear.half_width == pytest.approx([116**0.5] * 2, rel=1e-6)


@examples(12)
@example(
    (0.0, 0.0, 1.0), 2.0, 1.0
)  # the farthest point lies just before the end of the rim, which is its start
@given(
    st.tuples(*[st.floats(-60, 60)] * 3), st.floats(2.0, 14.0), st.one_of(st.just(1.0), st.floats(0.3, 0.99))
)
def test_an_elliptic_rim_keeps_its_size_however_the_lens_is_turned(turn, a, ratio):
    """The box of the rim, in the lens's own frame, has the axes of the ellipse, which samples miss."""
    b = ratio * a
    round_ = bd.Cylinder(a, 5) if ratio == 1 else bd.Pos(0, 0, -2.5) * bd.extrude(bd.Ellipse(a, b), 5)
    lens = bd.Pos(0, 0, -35) * bd.Sphere(40) & bd.Pos(0, 0, 2.5) * round_
    with tempfile.TemporaryDirectory() as folder:
        found = read_lens_solid(
            written((bd.Pos(3, 4, 5) * bd.Rot(*turn) * lens).wrapped, Path(folder) / "lens.step")
        )
    for face in (found.front, found.rear):
        assert face.outline == "ellipse"
        assert sorted(face.half_width) == pytest.approx([b, a], rel=1e-7)
        assert face.centre == pytest.approx([0, 0], abs=1e-6)


def test_a_ball_without_rim_is_no_lens(tmp_path):
    with pytest.raises(
        ValueError, match=r"the lens has no surface opposite|one curved face and none opposite"
    ):
        read_lens_solid(written(bd.Sphere(5).wrapped, tmp_path / "ball.step"))


def test_a_revolved_parabola_is_a_conic(tmp_path):
    """r^2 = 2 R z with R = 30, as a spline of revolution."""
    with bd.BuildPart() as part:
        with bd.BuildSketch(bd.Plane.XZ):
            with bd.BuildLine():
                bd.Bezier((0, 0), (4, 0), (8, 64 / 60))
                bd.Polyline((8, 64 / 60), (8, 4), (0, 4), (0, 0))
            bd.make_face()
        bd.revolve(axis=bd.Axis.Z)
    found = read_lens_solid(written(part.part.wrapped, tmp_path / "lens.step"))
    refit = found.refit(1.5)
    assert found.front.kind in ("surface of revolution", "rational spline")
    assert (refit.how, refit.proven) == (("conic", "plane"), (True, True))
    assert refit.lens.front.conic.radius == pytest.approx(30, abs=1e-6)
    assert refit.lens.front.conic.constant == pytest.approx(-1, abs=1e-6)
    assert refit.deviation[0] < 1e-9


def rounded(box):
    return bd.fillet(box.edges().filter_by(bd.Axis.Z), 0.5)


def cylinder_lens(outline):
    """A plate of 3 mm with an arched top, R = 30 mm, straight along y."""
    arch = bd.Pos(0, 0, 3 - 30) * bd.Rot(90, 0, 0) * bd.Cylinder(30, 100)
    return bd.Pos(0, 0, 1.5) * outline & arch


@pytest.mark.parametrize("turn", [0, 30])
@pytest.mark.parametrize("outline", [bd.Box(20, 16, 3), bd.Cylinder(9, 3)])
def test_a_cylinder_lens_is_found(tmp_path, outline, turn):
    found = read_lens_solid(
        written((bd.Rot(turn, 0, turn) * cylinder_lens(outline)).wrapped, tmp_path / "lens.step")
    )
    assert (found.front.kind, found.rear.kind) == ("plane", "cylinder")
    assert found.thickness == pytest.approx(3, abs=1e-9)
    assert found.rear.radius == pytest.approx(30, abs=1e-9)
    assert "cylinder of radius 30 mm in 1 face" in str(found)
    if found.rear.outline == "rectangle":
        x = np.linspace(-7, 7, 15)
        curved = x if found.rear.half_width[0] > 9 else 0 * x
        heights = found.refit(1.5).lens.rear(x, x)
        assert heights == pytest.approx(np.sqrt(900 - curved**2) - 30, abs=1e-6)


def test_a_ruled_spline_is_an_optical_face(tmp_path):
    """An arch of splines, extruded along y."""
    top = bd.Edge.make_spline([bd.Vector(x, 0, 3 - 0.01 * x * x) for x in (-8, -4, 0, 4, 8)])
    lines = [bd.Edge.make_line(a, b) for a, b in pairwise([top @ 1, (8, 0, 0), (-8, 0, 0), top @ 0])]
    solid = bd.extrude(bd.Face(bd.Wire([top, *lines])), 10, (0, 1, 0))
    found = read_lens_solid(written(solid.wrapped, tmp_path / "lens.step"))
    assert found.rear.half_width == pytest.approx([8, 5], abs=1e-6)
    refit = found.refit(1.5, 1e-5)
    assert refit.lens.rear(4, 1) == pytest.approx(-0.16, abs=1e-5)


@pytest.mark.slow
def test_a_lofted_lens_is_fitted(tmp_path):
    """Sections x = -6, -2, 2, 6 with an arched upper line."""

    def section(x):
        top = [(x, y, 4 - 0.01 * x * x - 0.02 * y * y + 0.001 * x * y) for y in (-5, -2, 0, 2, 5)]
        edges = [bd.Edge.make_spline([bd.Vector(*p) for p in top])]
        corners = [top[-1], (x, 5, 0), (x, -5, 0), top[0]]
        edges += [bd.Edge.make_line(a, b) for a, b in pairwise(corners)]
        return bd.Wire(edges)

    solid = bd.Solid.make_loft([section(x) for x in (-6, -2, 2, 6)])
    found = read_lens_solid(written(solid.wrapped, tmp_path / "lens.step"))
    refit = found.refit(1.5, 1e-5)
    assert found.front.kind in ("plane", "spline")
    assert found.rear.half_width == pytest.approx([6, 5], abs=1e-6)
    x, y = (a.ravel() for a in np.meshgrid([-6, -2, 2], [-2, 0, 2]))
    exact = 4 - 0.01 * x * x - 0.02 * y * y + 0.001 * x * y
    assert found.thickness + refit.lens.rear(x, y) == pytest.approx(exact, abs=1e-5)
    assert max(refit.deviation) <= 1e-5


def test_a_lens_of_two_spheres_by_freecad():
    found = read_lens_solid(DATA / "freecad_spheres.step")
    refit = found.refit(1.5)
    assert (found.front.outline, found.rear.outline) == ("rectangle", "rectangle")
    assert (found.thickness, *found.front.half_width) == pytest.approx((12, 6, 5), abs=1e-9)
    assert refit.lens.front.conic.radius == pytest.approx(30, abs=1e-9)
    assert refit.lens.rear.conic.radius == pytest.approx(-25, abs=1e-9)
    assert refit.proven == (True, True)


@pytest.mark.slow  # a fit of seconds
def test_a_spline_by_freecad_is_no_graph_and_is_fitted():
    """Through z = 4 - 0.01 x^2 - 0.02 y^2 + 0.001 x y at integer x and y, extruded by 3 mm."""
    found = read_lens_solid(DATA / "freecad_spline.step")
    refit = found.refit(1.5)
    x, y = (a.ravel() for a in np.meshgrid(np.arange(-5, 6), np.arange(-4, 5)))
    exact = -0.01 * x * x - 0.02 * y * y + 0.001 * x * y
    assert 1e-3 < found.rear.graph_deviation < 1e-1
    assert found.thickness == pytest.approx(3, abs=1e-9)
    assert (refit.how, refit.proven) == (("fitted spline",) * 2, (False, False))
    for surface, deviation in zip((refit.lens.front, refit.lens.rear), refit.deviation):
        assert np.abs(surface(x, y) - exact).max() <= 2 * deviation <= 2e-6


def test_the_record_says_what_was_found(tmp_path):
    path = tmp_path / "lens.step"
    path.write_bytes(part_step(lens_part(WIDER), Product()))
    found = read_lens_solid(path)
    said = str(found).splitlines()
    assert said[0] == "ForeignLens of lens.step, in millimetre"
    assert re.search(r"front: spline in 1 face, degree 3 x 3, 9 x 8 poles, .* mm from graph form", said[3])
    assert said[4].endswith("rectangle of 16 x 14 mm")
    assert (found.rear.degrees, found.rear.control_points) == ((3, 3), (9, 8))
    assert len(found.rear.knots[0]) == 13
    assert re.fullmatch(
        r"Refit\(front: spline as it is, .* mm proven; rear: .* mm proven\)", repr(found.refit(1.5))
    )


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        (lambda: bd.Box(3, 4, 5), "holds no curved face that ends in sharp edges and faces one way"),
        (lambda: bd.Cone(10, 2, 5), "holds no curved face that ends in sharp edges and faces one way"),
        (lambda: bd.Cylinder(9, 2), "holds no curved face that ends in sharp edges and faces one way"),
        (lambda: rounded(bd.Box(3, 4, 5)), "holds no curved face that ends in sharp edges"),
        (lambda: bd.Sphere(2), "holds one curved face and none opposite"),
        (
            lambda: bd.Compound([bd.Box(1, 1, 1), bd.Pos(3) * bd.Sphere(1)]),
            "holds 2 solids where a lens is one",
        ),
    ],
)
def test_what_is_no_lens_is_refused(tmp_path, shape, words):
    with pytest.raises(ValueError, match=words):
        read_lens_solid(written(shape().wrapped, tmp_path / "lens.step"))


def test_a_radius_that_does_not_fit_its_edge_is_refused_with_the_path(tmp_path):
    ball = bd.Sphere(20.0) & bd.Cylinder(5.0, 100.0)
    path = written(ball.wrapped, tmp_path / "lens.step")
    text, count = re.subn(r"(SPHERICAL_SURFACE\([^)]*),[0-9.E+]+\)", r"\1,1.E99)", path.read_text())
    assert count >= 1
    path.write_text(text)
    with pytest.raises(ValueError, match=f"{path} holds curved faces without area"):
        read_lens_solid(path)


def test_a_damaged_file_is_refused(tmp_path):
    path = written(lens_part(PLAIN).solid, tmp_path / "lens.step")
    path.write_text(path.read_text()[:2000])
    with pytest.raises(ValueError, match="is not a whole STEP file"):
        read_lens_solid(path)
