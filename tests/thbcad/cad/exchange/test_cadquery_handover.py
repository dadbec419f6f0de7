"""The lens as a solid of cadquery: the same geometry, and fit for boolean operations and assemblies."""

import sys

import cadquery as cq
import numpy as np
import pytest
from hypothesis import HealthCheck, given

from tests.cases import examples
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
from thbcad.cad.exchange.handover import GLASS, to_cadquery
from thbcad.lens import optical_forms
from thbcad.splines import BSplineSurface, KnotVector, circular_arc


@pytest.mark.slow
@examples(15, suppress_health_check=[HealthCheck.too_slow])
@given(lens=lenses())
def test_faces_keep_every_bit(lens):
    for face, own in zip(to_cadquery(lens).Faces(), optical_forms(lens)):
        assert same_bits(net(face), own)


@pytest.mark.parametrize("name", LENSES)
def test_cadquery_finds_a_valid_solid_of_the_exact_volume(name):
    lens = LENSES[name]
    solid = to_cadquery(lens)
    assert type(solid) is cq.Solid
    assert solid.isValid()
    assert volume(solid) == pytest.approx(lens.volume(), rel=2e-6)  # twice the tolerance of the integral


@pytest.mark.parametrize("name", FLAT)
def test_a_pocket_is_cut_and_the_optical_faces_stay(name):
    """Half of a cube of 1 mm on an edge plane lies in the lens; front and rear keep every bit."""
    lens = LENSES[name]
    solid = to_cadquery(lens)
    cube = cq.Workplane().box(1, 1, 1).translate(edge_middle(lens))
    cut = cq.Workplane(obj=solid).cut(cube).val()
    assert cut.isValid()
    assert volume(solid) - volume(cut) == pytest.approx(0.5, abs=2e-6 * lens.volume())
    assert kept(cut.Faces(), lens) == [1, 1]


@pytest.mark.parametrize("name", FLAT)
def test_a_ring_is_fused_to_the_edges(name):
    """A rectangular ring, 1 mm wide and 1 mm high, half in the lens: the union has the volume of its parts
    less the overlap."""
    lens = LENSES[name]
    hx, hy = lens.front.half_width
    ring = cq.Workplane().rect(2 * hx + 1, 2 * hy + 1).rect(2 * hx - 1, 2 * hy - 1).extrude(1)
    solid = to_cadquery(lens)
    both = cq.Workplane(obj=solid).union(ring.translate((0, 0, edge_middle(lens)[2] - 0.5)))
    outside = (2 * hx + 1) * (2 * hy + 1) - 4 * hx * hy
    assert both.val().isValid()
    assert both.solids().size() == 1
    assert volume(both.val()) - volume(solid) == pytest.approx(outside, abs=4e-6 * lens.volume())


def test_an_assembly_reads_back(tmp_path):
    """Names, colour, place and net of a lens and a block, written and read by cadquery."""
    lens, path, away = LENSES["freeform"], str(tmp_path / "assembly.step"), 30.0
    assembly = cq.Assembly(name="assembly")
    assembly.add(to_cadquery(lens), name="lens", loc=cq.Location((0, 0, away)), color=cq.Color(*GLASS))
    assembly.add(cq.Solid.makeBox(2, 3, 4), name="block")
    assembly.export(path)
    parts = {child.name: child for child in cq.Assembly.load(path).children}
    assert set(parts) == {"lens", "block"}
    assert parts["lens"].color.toTuple() == pytest.approx(GLASS, abs=1e-6)
    placed = {name: part.obj.moved(part.loc) for name, part in parts.items()}
    assert volume(placed["lens"]) == pytest.approx(lens.volume(), rel=2e-6)
    assert volume(placed["block"]) == pytest.approx(24, rel=2e-6)
    assert_moved(placed["lens"].Faces()[:2], lens, away)


def test_a_missing_cadquery_is_reported_in_one_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "cadquery", None)
    with pytest.raises(ImportError, match=missing("cadquery")):
        to_cadquery(LENSES["plano"])


@pytest.mark.parametrize("name", CURVES)
def test_edges_are_the_curves(name):
    edge = to_cadquery(CURVES[name])
    assert type(edge) is cq.Edge
    assert edge.isValid()
    assert_follows(edge, CURVES[name])


@pytest.mark.parametrize("name", SURFACES)
def test_faces_are_the_surfaces(name):
    face = to_cadquery(SURFACES[name])
    assert type(face) is cq.Face
    assert face.isValid()
    assert_covers(face, SURFACES[name])


def test_the_face_of_a_thb_surface_is_its_tensor_product_form():
    assert_covers(to_cadquery(REFINED), REFINED.to_bspline())


FLAT_NET = BSplineSurface(*[KnotVector(1, [0, 0, 1, 1])] * 2, np.zeros((2, 2, 2)))


@pytest.mark.parametrize(
    ("geometry", "message"),
    [
        ("lens.json", "geometry must be a Lens or Part or THBSurface or .* or NURBSCurve, got str"),
        (circular_arc(1.0), r"curve must have points \(x, y, z\)"),
        (FLAT_NET, r"surface must have points \(x, y, z\), got a net of shape \(2, 2, 2\)"),
    ],
)
def test_other_things_are_refused(geometry, message):
    with pytest.raises(ValueError, match=message):
        to_cadquery(geometry)
