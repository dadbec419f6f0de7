"""Volume and areas from the text of a STEP file, against closed forms, OCCT's integrals and scipy."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.gp import gp_Ax1, gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from scipy.integrate import dblquad

from tests.cases import examples
from tests.thbcad.cad.shapes.cases import CASES
from tests.thbcad.cases import LENSES, lenses
from tests.thbcad.io.cases import SOLIDS, solid_of, turned_at_random, written
from thbcad.cad.exchange import part_step, solid_area, solid_volume, step_bytes
from thbcad.cad.shapes import flanged_part, lens_part, trimmed_part
from thbcad.io.brep_measure import ACCURACY, Density, NotMeasured, areas, volume
from thbcad.io.parameter_curves import image_distance
from thbcad.io.step_brep import brep_of_text, parse_brep
from thbcad.lens import Flange, FreeformSurface, Lens, Product, aperture_volume, flanged_volume
from thbcad.sags import Conic, graph_of_poles
from thbcad.splines import BSplineSurface, gauss_rule


def scaled(text, factor):
    """Return the text of a file with all components of directions times a factor."""

    def times(match):
        values = ",".join(f"{factor * float(word):#.17G}" for word in match[2].split(","))
        return match[1] + values + match[3]

    out, count = re.subn(r"(DIRECTION\s*\('',\()([^)]*)(\))", times, text)
    assert count > 10
    return out


@pytest.mark.every(5)
@pytest.mark.parametrize("factor", [2.0, 1e-200, 1e200, 1.5e308])
@pytest.mark.parametrize("name", ["plano", "cone with a bore", "cylinder cut aslant"])
def test_only_the_ratios_of_a_direction_count(name, factor, tmp_path):
    if name in LENSES:
        text = step_bytes(LENSES[name]).decode()
    else:
        text = written(turned_at_random(SOLIDS[name]()), tmp_path / "solid.step").read_text()
    solid, other = brep_of_text(text), brep_of_text(scaled(text, factor))
    # OCCT writes 13 digits, so that components of the same ratios differ by rounding alone
    assert volume(other) == pytest.approx(volume(solid), rel=1e-13)
    assert areas(other) == pytest.approx(areas(solid), rel=1e-13)
    assert image_distance(other)[0] == pytest.approx(image_distance(solid)[0], abs=1e-13)


# ---- volume ----


@pytest.mark.parametrize("name", LENSES)
def test_the_file_has_the_volume_of_the_lens(name):
    """Two integrals that share no code: over faces of the text, and over the lens between its graphs."""
    assert volume(solid_of(LENSES[name])) == pytest.approx(LENSES[name].volume(), rel=1e-10)


@pytest.mark.slow
@examples(15)
@given(lenses(conics=False))
def test_random_lenses(lens):
    assert volume(solid_of(lens)) == pytest.approx(lens.volume(), rel=1e-10)


def test_a_block_anywhere(tmp_path):
    """2 x 3 x 5 mm, turned and far from the origin, less a hole of 1 x 1 x 5 mm."""
    block = BRepPrimAPI_MakeBox(2.0, 3.0, 5.0).Solid()
    holed = BRepAlgoAPI_Cut(block, BRepPrimAPI_MakeBox(gp_Pnt(0.5, 1, -1), 1.0, 1.0, 9.0).Solid()).Shape()
    turn, shift = gp_Trsf(), gp_Trsf()
    turn.SetRotation(gp_Ax1(gp_Pnt(1, 2, 3), gp_Dir(1, 1, 1)), 0.7)
    shift.SetTranslation(gp_Vec(100, -50, 30))
    for shape, size, faces in (
        (block, 30, [6, 6, 10, 10, 15, 15]),
        (holed, 25, [5, 5, 5, 5, 5, 5, 10, 10, 15, 15]),
    ):
        moved = BRepBuilderAPI_Transform(shape, shift * turn, True).Shape()
        solid = parse_brep(written(moved, tmp_path / "block.step"))
        # OCCT's own writer keeps about 13 digits: coordinates near 100 mm lie within some 1e-11 mm
        assert volume(solid) == pytest.approx(size, rel=1e-10)
        assert sorted(areas(solid)) == pytest.approx(sorted(faces), rel=1e-10)


@pytest.mark.parametrize(("front", "rear"), [((5, 5), (8, 8)), ((5, 3), (2, 7)), ((4, 4), (4, 9))])
def test_a_frustum_with_ruled_edges(front, rear):
    """Prismatoid: h / 6 (A + 4 M + B); a side is a trapezoid."""
    solid = solid_of(Lens(FreeformSurface(front), FreeformSurface(rear), 3.0, 1.5))
    (a, b), (c, d) = front, rear
    assert volume(solid) == pytest.approx(2 * (a * b + (a + c) * (b + d) + c * d), rel=1e-13)
    sides = [(a + c) * np.hypot(3, d - b), (b + d) * np.hypot(3, c - a)] * 2
    assert areas(solid) == pytest.approx([4 * a * b, 4 * c * d, *sides], rel=1e-13)


@pytest.mark.every(6)
@pytest.mark.parametrize("name", CASES)
def test_round_lenses_and_round_flanges(name):
    """Against Green's theorem over the lens's own graphs; rims lie within 1e-9 mm of the ellipse, to either
    side."""
    lens, semi_axes = CASES[name]
    flange = Flange(2.0, 1.0, 1.6)
    for part, wanted in (
        (trimmed_part(lens, semi_axes), aperture_volume(lens, semi_axes)),
        (flanged_part(lens, flange, semi_axes), flanged_volume(lens, flange, semi_axes)),
    ):
        solid = brep_of_text(part_step(part, Product()).decode())
        assert volume(solid) == pytest.approx(wanted, rel=1e-10)


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_of_occt_with_round_faces(name, tmp_path):
    """Against OCCT's adaptive quadrature in the solid as it was before; its intersection curves and the
    digits that it writes are not exact."""
    shape = turned_at_random(SOLIDS[name]())
    solid = parse_brep(written(shape, tmp_path / "solid.step"))
    assert volume(solid) == pytest.approx(solid_volume(shape, 1e-12), rel=1e-8)
    if name != "rational splines":  # OCCT's integral is off by 1e-6 there
        assert sum(areas(solid)) == pytest.approx(solid_area(shape, 1e-9), rel=1e-7)


def test_a_cap_of_a_ball_has_the_volume_of_the_closed_form(tmp_path):
    """The cap of height h = 3 on a sphere of radius 5: pi h^2 (R - h / 3); its faces are a sphere and a
    plane."""
    cap = BRepAlgoAPI_Cut(
        BRepPrimAPI_MakeSphere(gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(0, 1, 0)), 5.0).Solid(),
        BRepPrimAPI_MakeBox(gp_Pnt(-9, -9, -9), 18.0, 18.0, 11.0).Solid(),
    ).Shape()
    solid = parse_brep(written(cap, tmp_path / "cap.step"))
    assert volume(solid) == pytest.approx(9 * np.pi * (5 - 1), rel=1e-10)
    assert sum(areas(solid)) == pytest.approx(2 * np.pi * 5 * 3 + np.pi * (25 - 4), rel=1e-10)


# ---- areas ----


@pytest.mark.parametrize("name", ["round", "upright"])
def test_areas_of_trimmed_faces(name):
    """Front and rear against OCCT; walls against quadrature over the angle, since OCCT's is off by 3e-5."""
    lens, (a, b) = CASES[name]
    part = trimmed_part(lens, (a, b))
    found = areas(brep_of_text(part_step(part, Product()).decode()))
    assert found[:2] == pytest.approx([solid_area(face, 1e-9) for face in part.faces[:2]], rel=1e-6)
    t, weights = gauss_rule(np.linspace(0, 2 * np.pi, 2001), 4)
    x, y = a * np.cos(t), b * np.sin(t)
    height = lens.thickness + lens.rear(x, y) - lens.front(x, y)
    wanted = weights @ (height * np.hypot(a * np.sin(t), b * np.cos(t)))
    assert sum(found[2:]) == pytest.approx(wanted, rel=1e-8)


def test_the_area_of_a_sector_of_a_cone_in_rational_splines(tmp_path):
    """Radii 3 and 1, height 5, angle 2.5: 2.5 / 2 ((3 + 1) sqrt(29) + 9 + 1) + 20."""
    solid = parse_brep(written(SOLIDS["rational splines"](), tmp_path / "cone.step"))
    assert sum(areas(solid)) == pytest.approx(1.25 * (4 * np.sqrt(29) + 10) + 20, rel=1e-10)


def test_the_area_of_a_paraboloid_and_of_the_edges_under_it():
    """z = r^2 / 20 on 6 x 8 mm, 2 mm thick at its vertex; an edge at x = 3 has 8 (2 + 9 / 20) + 2 64 / 60
    mm^2."""
    rear = FreeformSurface((3, 4), Conic(10.0, -1.0))
    front, top, at_y, at_x, *_ = areas(solid_of(Lens(FreeformSurface((3, 4)), rear, 2.0, 1.5)))
    wanted, error = dblquad(lambda y, x: np.sqrt(1 + (x * x + y * y) / 100), -3, 3, -4, 4, epsrel=1e-13)
    assert front == pytest.approx(48, rel=1e-15)
    assert top == pytest.approx(wanted, rel=ACCURACY, abs=error)
    assert at_x == pytest.approx(8 * (2 + 9 / 20) + 2 * 64 / 60, rel=1e-13)
    assert at_y == pytest.approx(6 * (2 + 16 / 20) + 2 * 27 / 60, rel=1e-13)


@pytest.mark.every(3)
@pytest.mark.parametrize("name", LENSES)
def test_areas_against_occt(name):
    """Its adaptive Gauss quadrature reports 1e-6 as its own relative error."""
    wanted = [solid_area(face, 1e-7) for face in lens_part(LENSES[name]).faces]
    assert areas(solid_of(LENSES[name])) == pytest.approx(wanted, rel=1e-6)


# ---- refusals ----


def test_a_torus_is_refused(tmp_path):
    solid = parse_brep(written(BRepPrimAPI_MakeTorus(10.0, 3.0, 1.5).Shape(), tmp_path / "round.step"))
    for measure in (volume, areas):
        with pytest.raises(NotMeasured, match=r"must be a plane, a spline up .*, got TOROIDAL_SURFACE"):
            measure(solid)


def test_a_spline_face_that_ends_elsewhere_is_refused():
    solid = solid_of(LENSES["table63"])
    face = solid.faces[1]
    wider = BSplineSurface(face.surface.kv_u, face.surface.kv_v, 1.1 * face.surface.coefficients)
    for changed, sentence in (
        (replace(face, surface=wider), "must lie on it, got 0.8 beside it"),
        (replace(face, loops=(face.loops[0][:3],)), "must have images in its parameters that close"),
    ):
        with pytest.raises(NotMeasured, match=sentence):
            volume(replace(solid, faces=(solid.faces[0], changed, *solid.faces[2:])))


def test_an_open_solid_is_refused():
    with pytest.raises(ValueError, match="must be closed, got 4 edges"):
        volume(replace(solid_of(LENSES["plano"]), unpaired=4))


def test_a_solid_inside_out_is_refused():
    solid = solid_of(LENSES["table63"])
    turned = replace(solid, faces=tuple(replace(face, outward=not face.outward) for face in solid.faces))
    with pytest.raises(ValueError, match="must point outward, got a volume of -"):
        volume(turned)


@pytest.mark.parametrize("name", ["freeform", "paraboloids", "awkward"])
@pytest.mark.parametrize("origin", [None, np.array([0.3, -0.2, 1.0])], ids=["area", "volume"])
def test_densities_over_graphs_are_those_of_any_spline(name, origin):
    """On a grid z alone is evaluated; at points the whole surface and the cross product."""
    face = solid_of(LENSES[name]).faces[1]
    assert graph_of_poles(face.surface) is not None
    density = Density(face, origin)
    kvs = face.surface.kv_u, face.surface.kv_v
    u, v = (np.linspace(kv.start, kv.stop, n) for kv, n in zip(kvs, (9, 8)))
    across, up = (a.ravel() for a in np.meshgrid(u, v, indexing="ij"))
    wanted = density(across, up).reshape(9, 8)
    np.testing.assert_allclose(density.grid(u, v), wanted, rtol=0, atol=1e-13 * abs(wanted).max())


def test_a_face_that_goes_round_too_often_takes_no_memory(tmp_path):
    """Images stretched along a cylinder were cut into as many pieces of a turn."""
    cylinder = BRepPrimAPI_MakeCylinder(2.0, 3.0).Solid()
    solid = parse_brep(written(cylinder, tmp_path / "solid.step"))

    def stretched(edge):
        images = (k if k.kv or k.conic else replace(k, poles=k.poles * [1e12, 1.0]) for k in edge.images)
        return replace(edge, images=tuple(images))

    with pytest.raises(ValueError, match="must not go round more than 2 times"):
        areas(replace(solid, edges=tuple(map(stretched, solid.edges))))


def test_vertices_too_far_away_are_refused():
    solid = solid_of(LENSES["plano"])
    far = tuple(replace(edge, ends=1e200 * edge.ends) for edge in solid.edges)
    with pytest.raises(ValueError, match="vertices must lie nearer"):
        volume(replace(solid, edges=far))
