"""The lens as a solid of build123d: the same geometry, and fit for boolean operations and assemblies."""

import re
import sys
from pathlib import Path

import build123d as bd
import numpy as np
import pytest
from hypothesis import HealthCheck, given

from tests.cases import examples, python
from tests.thbcad.cad.exchange.cases import CURVES, REFINED, SURFACES
from tests.thbcad.cad.exchange.handed_over import (
    FLAT,
    assert_covers,
    assert_follows,
    assert_moved,
    edge_middle,
    kept,
    missing,
    net,
    volume,
)
from tests.thbcad.cad.shapes.cases import same_bits
from tests.thbcad.cases import LENSES, lenses
from thbcad.cad.exchange.handover import GLASS, named_faces, to_build123d
from thbcad.cad.shapes import NAMES, lens_part
from thbcad.lens import optical_forms
from thbcad.splines import BSplineSurface, KnotVector, circular_arc

OUTWARD = {
    "front": (0, 0, -1),
    "rear": (0, 0, 1),
    "edge -y": (0, -1, 0),
    "edge +x": (1, 0, 0),
    "edge +y": (0, 1, 0),
    "edge -x": (-1, 0, 0),
}
TRANSPARENT = re.compile(r"SURFACE_STYLE_TRANSPARENT\((.*?)\)")


def block(lens, size):
    """Return a cube with its centre on the edge +y, half-way between the rims."""
    return bd.Pos(*edge_middle(lens)) * bd.Box(size, size, size)


@pytest.mark.slow
@examples(15, suppress_health_check=[HealthCheck.too_slow])
@given(lens=lenses())
def test_faces_keep_every_bit(lens):
    faces = named_faces(lens)
    for front, rear in ((faces["front"], faces["rear"]), to_build123d(lens).faces()[:2]):
        assert same_bits(net(front), optical_forms(lens)[0])
        assert same_bits(net(rear), optical_forms(lens)[1])


@pytest.mark.parametrize("name", LENSES)
def test_build123d_finds_a_valid_solid_of_the_exact_volume(name):
    lens = LENSES[name]
    solid = to_build123d(lens)
    assert type(solid) is bd.Solid
    assert solid.is_valid
    assert volume(solid) == pytest.approx(lens.volume(), rel=2e-6)  # twice the tolerance of the integral


def test_label_and_colour():
    solid = to_build123d(LENSES["freeform"], "collimator")
    assert solid.label == "collimator"
    assert tuple(solid.color) == pytest.approx(GLASS, abs=1e-6)  # held in single precision


@pytest.mark.parametrize("name", LENSES)
def test_names_tell_the_faces(name):
    """A face's name tells where its outward normal points at the middle, and how its colleagues in the solid
    are found."""
    part = lens_part(LENSES[name])
    faces, solid = named_faces(part), to_build123d(part)
    assert tuple(faces) == NAMES
    for (name, face), own in zip(faces.items(), solid.faces()):
        assert face.label == name
        assert face.is_same(own)
        assert np.dot(tuple(face.normal_at()), OUTWARD[name]) > 0
        assert np.dot(tuple(own.normal_at()), OUTWARD[name]) > 0


def test_a_corner_between_named_faces_is_chamfered():
    part = lens_part(LENSES["plano"])
    faces, solid = named_faces(part), to_build123d(part)
    corner = faces["edge -y"].edges() & faces["edge +x"].edges()
    chamfered = solid.chamfer(0.5, None, corner)
    assert chamfered.is_valid
    assert len(chamfered.faces()) == 7
    lengths = [5.0 + LENSES["plano"].rear(10.0 - s, -8.0 + t) for s, t in ((0, 0), (0.5, 0), (0, 0.5))]
    # a prism of area 0.5^2 / 2 between planes: exact but for the curvature of the rear, h^2 / R / 8
    assert volume(solid) - volume(chamfered) == pytest.approx(
        0.125 * np.mean(lengths), abs=0.125 * 0.5**2 / 80
    )


@pytest.mark.parametrize("name", FLAT)
def test_a_pocket_is_cut_and_the_optical_faces_stay(name):
    """Half of a cube of 1 mm on an edge plane lies in the lens; front and rear keep every bit."""
    lens = LENSES[name]
    solid, cube = to_build123d(lens), block(lens, 1.0)
    cut = solid - cube
    assert cut.is_valid
    assert volume(solid) - volume(cut) == pytest.approx(0.5, abs=2e-6 * lens.volume())
    assert kept(cut.faces(), lens) == [1, 1]


@pytest.mark.parametrize("name", FLAT)
def test_a_ring_is_fused_to_the_edges(name):
    """A rectangular ring, 1 mm wide and 1 mm high, half in the lens: the union has the volume of its parts
    less the overlap."""
    lens = LENSES[name]
    (hx, hy), (_, _, at) = lens.front.half_width, edge_middle(lens)
    ring = bd.Pos(0, 0, at) * (bd.Box(2 * hx + 1, 2 * hy + 1, 1) - bd.Box(2 * hx - 1, 2 * hy - 1, 1))
    solid = to_build123d(lens)
    both = solid + ring
    outside = (2 * hx + 1) * (2 * hy + 1) - 4 * hx * hy
    assert both.is_valid
    assert len(both.solids()) == 1
    assert volume(both) - volume(solid) == pytest.approx(outside, abs=4e-6 * lens.volume())


def read_back(path):
    return {child.label: child for child in bd.import_step(path).children}


def test_an_assembly_reads_back(tmp_path):
    """Names, colour, place and net of a lens and a block, written and read by build123d."""
    lens, path, away = LENSES["freeform"], str(tmp_path / "assembly.step"), 30.0
    solid, cube = bd.Pos(0, 0, away) * to_build123d(lens), bd.Solid.make_box(2, 3, 4)
    cube.label = "block"
    bd.export_step(bd.Compound(label="assembly", children=[solid, cube]), path)
    parts = read_back(path)
    assert set(parts) == {"lens", "block"}
    assert tuple(parts["lens"].color)[:3] == pytest.approx(GLASS[:3], abs=1e-6)
    # build123d 0.13 reads the colour of the edges, which has no opacity
    opacity = {1 - float(x) for x in TRANSPARENT.findall(Path(path).read_text("ascii"))}
    assert list(opacity) == pytest.approx([GLASS[3]], abs=1e-6)
    assert volume(parts["lens"].solid()) == pytest.approx(lens.volume(), rel=2e-6)
    assert volume(parts["block"].solid()) == pytest.approx(24, rel=2e-6)
    assert_moved(parts["lens"].faces()[:2], lens, away)


@pytest.mark.parametrize("make", [to_build123d, named_faces])
def test_a_missing_build123d_is_reported_in_one_sentence(make, monkeypatch):
    monkeypatch.setitem(sys.modules, "build123d", None)
    with pytest.raises(ImportError, match=missing("build123d")):
        make(LENSES["plano"])


@pytest.mark.parametrize("name", CURVES)
def test_edges_are_the_curves(name):
    edge = to_build123d(CURVES[name], name)
    assert (type(edge), edge.label) == (bd.Edge, name)
    assert edge.is_valid
    assert_follows(edge, CURVES[name])


@pytest.mark.parametrize("name", SURFACES)
def test_faces_are_the_surfaces(name):
    face = to_build123d(SURFACES[name])
    assert (type(face), face.label) == (bd.Face, "surface")
    assert face.is_valid
    assert_covers(face, SURFACES[name])


def test_the_face_of_a_thb_surface_is_its_tensor_product_form():
    assert_covers(to_build123d(REFINED), REFINED.to_bspline())


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (to_build123d, "geometry must be a Lens or Part or THBSurface or .* or NURBSCurve, got str"),
        (named_faces, "lens must be a Lens or Part, got str"),
        (lambda _: to_build123d(circular_arc(1.0)), r"curve must have points \(x, y, z\)"),
        (
            lambda _: to_build123d(BSplineSurface(*[KnotVector(1, [0, 0, 1, 1])] * 2, np.zeros((2, 2, 2)))),
            r"surface must have points \(x, y, z\), got a net of shape \(2, 2, 2\)",
        ),
    ],
)
def test_other_things_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make("lens.json")


@pytest.mark.slow
def test_the_module_loads_neither_library():
    program = "import sys, thbcad.cad.exchange.handover; print(*{'build123d', 'cadquery'} & set(sys.modules))"
    done = python(program, check=True)
    assert done.stdout.split() == []
