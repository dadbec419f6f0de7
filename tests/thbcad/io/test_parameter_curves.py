"""Edges and their images in the parameters of faces agree in every solid; a moved image is measured."""

import re
from dataclasses import replace

import numpy as np
import pytest
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakeTorus,
)
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

from tests.thbcad.cases import LENSES
from tests.thbcad.io.cases import SOLIDS, solid_of, turned_at_random, written
from thbcad.cad.exchange import part_step
from thbcad.cad.shapes import flanged_part, patched_part, trimmed_part
from thbcad.io.parameter_curves import image_distance, turned_faces
from thbcad.io.step_brep import brep_of_text, parse_brep
from thbcad.lens import Flange, FreeformSurface, Lens, Product, optical_forms
from thbcad.sags import Conic, ConicCurve
from thbcad.splines import BSplineSurface, KnotVector

PARTS = {
    "patches": (patched_part, ()),
    "aperture": (trimmed_part, ((5.0, 4.0),)),
    "flange": (flanged_part, (Flange(2.0, 1.0, 3.0),)),
    "parts of edges": (flanged_part, (Flange(2.0, 0.5, 1.5),)),
}
PARABOLOIDS = Lens(
    *(FreeformSurface((10, 8), Conic(radius, -1.0)) for radius in (60.0, -80.0)), thickness=5.0, index=1.5
)
OF = {"parts of edges": "ruled"}  # other lenses are freeform


@pytest.mark.parametrize("name", LENSES)
def test_the_edges_of_every_lens_are_their_images(name):
    """But for the rounding of poles and knots, of some 10 mm."""
    lens = LENSES[name]
    distance, left = image_distance(solid_of(lens))
    exact = all(isinstance(form, BSplineSurface) or form.kind == "PLANE" for form in optical_forms(lens))
    # images on spheres, patches and of their rims are splines within 1e-9 mm
    assert distance <= (1e-14 if exact else 1e-9)
    assert left == ()


@pytest.mark.parametrize("name", PARTS)
def test_the_edges_of_cut_and_patched_lenses_are_their_images(name):
    """Splines that approximate the cut are within OCCT's 1e-7 mm; cylinders are compared too."""
    make, arguments = PARTS[name]
    solid = brep_of_text(part_step(make(LENSES[OF.get(name, "freeform")], *arguments), Product()).decode())
    distance, left = image_distance(solid)
    assert distance <= (1e-7 if name in ("aperture", "parts of edges") else 1e-14)
    assert left == ()
    assert turned_faces(solid) == 0


@pytest.mark.parametrize(
    "make",
    [
        lambda: BRepPrimAPI_MakeBox(2.0, 3.0, 5.0),
        lambda: BRepPrimAPI_MakeCylinder(2.0, 5.0),
        lambda: BRepPrimAPI_MakeTorus(5.0, 1.0),
    ],
    ids=["box", "cylinder", "torus"],
)
def test_the_solids_of_another_program_pass(make, tmp_path):
    solid = parse_brep(written(make().Solid(), tmp_path / "solid.step"))
    distance, left = image_distance(solid)
    assert distance <= 1e-11  # it writes some 13 digits
    assert all(re.fullmatch(r"\d+ images of edges on a TOROIDAL_SURFACE", what) for what in left)
    assert turned_faces(solid) == 0


CONICS = {
    "cone cut by a plane along its axis": "HYPERBOLA",
    "cylinder cut aslant": "ELLIPSE",
}


@pytest.mark.parametrize("name", SOLIDS)
def test_conics_and_rational_splines_lie_on_round_faces(name, tmp_path):
    """Ellipses, hyperbolas and circles on cones, cylinders and spheres, as OCCT parametrises them."""
    solid = parse_brep(written(turned_at_random(SOLIDS[name]()), tmp_path / "solid.step"))
    kinds = {edge.conic.kind for edge in solid.edges if edge.conic}
    assert CONICS.get(name, "CIRCLE") in kinds or name == "rational splines"
    distance, left = image_distance(solid)
    assert distance <= 1e-6  # OCCT's own fits of Boolean cuts
    assert left == ()
    assert turned_faces(solid) == 0


def low_edge(solid):
    """Return the place of the edge of the front at low y."""
    front, side = solid.faces[0], solid.faces[2]
    assert (front.name, side.name) == ("front", "edge -y")
    (number,) = {k for k, _ in front.loops[0]} & {k for k, _ in side.loops[0]}
    return [edge.number for edge in solid.edges].index(number)


def changed(solid, **fields):
    """Return the solid with the image of its low edge on the front changed."""
    edges, place = list(solid.edges), low_edge(solid)
    first, *others = edges[place].images
    assert first.carrier == solid.faces[0].carrier
    edges[place] = replace(edges[place], images=(replace(first, **fields), *others))
    return replace(solid, edges=tuple(edges))


@pytest.mark.parametrize("name", ["plano", "table63"])
def test_the_distance_of_a_moved_image_is_that_in_space(name):
    """The front is a plane over x and y; or over 8 / 5 of them, and its slope at the rim is 1."""
    solid = solid_of(LENSES[name])
    poles = solid.edges[low_edge(solid)].images[0].poles
    factor = np.sqrt(2) * 5 / 8 if name == "table63" else 1.0
    distance, _ = image_distance(changed(solid, poles=poles + np.array([0.0, 1e-3])))
    assert distance == pytest.approx(1e-3 * factor, rel=1e-3)


def test_an_image_beside_its_face_or_its_edge_is_infinitely_far():
    solid = solid_of(PARABOLOIDS)
    poles = solid.edges[low_edge(solid)].images[0].poles
    rear = solid.faces[1].carrier
    short = KnotVector.uniform(1, 1, -9.0, 10.0)
    for fields in (
        {"poles": poles - np.array([0.0, 1e-3])},
        {"carrier": rear},
        {"carrier": 1},
        {"kv": short, "poles": np.array([[-9.0, -8.0], [10.0, -8.0]])},
    ):
        assert image_distance(changed(solid, **fields))[0] == np.inf


def test_a_vector_beyond_float64_is_infinitely_far():
    """Differences with it are not numbers, which no maximum shows."""
    solid = solid_of(LENSES["plano"])
    poles = solid.edges[low_edge(solid)].images[0].poles
    endless = poles[0] + np.array([[0.0, 0.0], [0.0, np.inf]])
    with np.errstate(invalid="ignore"):
        assert image_distance(changed(solid, poles=endless))[0] == np.inf


def test_a_curve_beyond_float64_is_infinitely_far_from_its_ends():
    solid = solid_of(LENSES["plano"])
    edges, place = list(solid.edges), low_edge(solid)
    along = np.diff(edges[place].ends, axis=0)[0]
    placement = np.array([[0.0, 0.0, 0.0], np.cross([0.0, 1.0, 0.0], along), [0.0, 1.0, 0.0]])
    endless = ConicCurve("HYPERBOLA", placement, np.array([np.inf, 1.0]))
    edges[place] = replace(edges[place], kv=None, poles=None, conic=endless, images=())
    with np.errstate(invalid="ignore"):
        assert image_distance(replace(solid, edges=tuple(edges)))[0] == np.inf


def test_curves_that_are_not_compared_are_counted():
    solid = solid_of(LENSES["plano"])
    distance, left = image_distance(changed(solid, poles=None))
    assert distance <= 1e-14
    assert left == ("1 images of edges that are neither lines, splines nor conics",)


@pytest.mark.parametrize("which", range(6))
@pytest.mark.parametrize("name", ["plano", "table63"])
def test_a_turned_face_is_counted(name, which):
    solid = solid_of(LENSES[name])
    faces = list(solid.faces)
    faces[which] = replace(faces[which], outward=not faces[which].outward)
    assert turned_faces(solid) == 0
    assert turned_faces(replace(solid, faces=tuple(faces))) == 1


@pytest.mark.parametrize("kind", ["CIRCLE", "ELLIPSE", "HYPERBOLA", "PARABOLA"])
def test_parameters_and_derivatives_belong_to_the_points_of_a_conic(kind):
    placement = np.array([[1.0, 2.0, 3.0], [1.0, 1.0, 0.5], [0.3, -1.0, 2.0]])
    sizes = {"CIRCLE": (2.0, 2.0), "PARABOLA": (1.5, 1.5)}.get(kind, (3.0, 0.7))
    conic = ConicCurve(kind, placement, np.array(sizes))
    t = np.linspace(-3.0, 3.0, 41)
    assert conic.parameters(conic.points(t)) == pytest.approx(t, abs=1e-13)
    slopes = (conic.points(t + 1e-5) - conic.points(t - 1e-5)) / 2e-5
    assert abs(slopes - conic.points(t, 1)).max() <= 1e-7


def test_a_parabola_is_read_and_its_images_by_occt_are_left_out(tmp_path):
    """OCCT counts its parameter in mm, ISO 10303-42 in units of twice the focal distance."""
    cone = BRepPrimAPI_MakeCone(3.0, 1.0, 5.0).Solid()
    along = gp_Ax2(gp_Pnt(1.5, -9, -2), gp_Dir(1, 0, 0.4), gp_Dir(0, 1, 0))
    cut = BRepAlgoAPI_Cut(cone, BRepPrimAPI_MakeBox(along, 18.0, 9.0, 9.0).Solid()).Shape()
    solid = parse_brep(written(cut, tmp_path / "solid.step"))
    (conic,) = (edge.conic for edge in solid.edges if edge.conic and edge.conic.kind == "PARABOLA")
    r = np.hypot(*conic.points(np.linspace(-3, 3, 9)).T[:2])
    assert r == pytest.approx(3 - 0.4 * conic.points(np.linspace(-3, 3, 9))[:, 2], abs=1e-11)
    distance, left = image_distance(solid)
    assert distance <= 1e-9
    assert left == ("2 images of parabolas, which OCCT writes over another parameter",)
