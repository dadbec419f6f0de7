"""Planes, spheres and conics of revolution in solids: faces and rims are what they are, in every format."""

from collections import Counter
from itertools import product

import build123d as bd
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface

from tests.thbcad.cad.shapes.cases import assert_whole
from tests.thbcad.cases import assert_holds, corner_sag
from thbcad.cad.exchange import (
    SolidState,
    brep_text,
    part_iges,
    part_step,
    read_brep,
    read_iges,
    read_step,
    solid_volume,
    step_bytes,
)
from thbcad.cad.shapes import flanged_part, lens_part, lens_solid, trimmed_part
from thbcad.lens import (
    Flange,
    FreeformSurface,
    Lens,
    Product,
    aperture_volume,
    flanged_volume,
    optical_forms,
)
from thbcad.sags import Conic

HALF = (9.0, 8.0)
CONICS = {  # and the type of the face and of its rims
    "plane": (Conic(), "Plane", "Line"),
    "sphere": (Conic(-40.0, 0.0), "Sphere", "Circle"),
    "hollow sphere": (Conic(60.0, 0.0), "Sphere", "Circle"),
    "ellipsoid": (Conic(-40.0, -0.5), "BSplineSurface", "Ellipse"),
    "oblate ellipsoid": (Conic(-40.0, 0.8), "BSplineSurface", "Ellipse"),
    "hyperboloid": (Conic(-40.0, -2.5), "BSplineSurface", "Hyperbola"),
    "hollow hyperboloid": (Conic(50.0, -3.0), "BSplineSurface", "Hyperbola"),
    "paraboloid": (Conic(-40.0, -1.0), "BSplineSurface", "BSplineCurve"),
}
KINDS = "plane", "sphere", "hyperboloid", "paraboloid"
SIZES = {"equal": HALF, "larger": (10.0, 9.0), "mixed": (8.0, 9.5)}
WRITERS = {
    "step": lambda part: part_step(part, Product()),
    "igs": lambda part: part_iges(part, Product()),
    "brep": lambda part: brep_text(part.solid),
}
READERS = {"step": read_step, "igs": read_iges, "brep": read_brep}


def lens_of(front, rear="hyperboloid", size="equal"):
    return Lens(
        FreeformSurface(SIZES[size], CONICS[front][0]), FreeformSurface(HALF, CONICS[rear][0]), 7.0, 1.5
    )


def kind_of(adaptor):
    return str(adaptor.GetType()).rpartition("_")[2]


@pytest.mark.every(4)
@pytest.mark.parametrize(("front", "size"), [*product(CONICS, SIZES)])
def test_faces_and_rims_are_what_they_are(front, size):
    """Valid and closed before any reader heals; by build123d."""
    lens = lens_of(front, size=size)
    part = lens_part(lens)
    solid = bd.Solid(part.solid)
    assert solid.is_valid
    assert (len(solid.faces()), len(solid.edges()), len(solid.vertices())) == (6, 12, 8)
    assert_whole(SolidState(part.solid), 6)
    assert SolidState(part.solid).tolerance == 1e-7
    _, face, rims = CONICS[front]
    for shape, wanted in zip(part.faces[:2], ((face, rims), ("BSplineSurface", "Hyperbola"))):
        assert kind_of(BRepAdaptor_Surface(shape)) == wanted[0]
        edges = Counter(kind_of(BRepAdaptor_Curve(edge.wrapped)) for edge in bd.Face(shape).edges())
        assert edges == {wanted[1]: 4}
    sides = Counter(kind_of(BRepAdaptor_Surface(shape)) for shape in part.faces[2:])
    assert sides == {"Plane" if size == "equal" else "BSplineSurface": 4}
    # twice what is asked of the integral
    assert solid_volume(part.solid, 1e-9) == pytest.approx(lens.volume(), rel=2e-9)
    for shape, up in zip(bd.Solid(part.solid).faces()[:2], (-1, 1)):
        assert np.sign(shape.normal_at().Z) == up


@pytest.mark.slow
def test_every_edge_lies_on_its_faces():
    """At 50 points of the curve and of its image, by OCCT."""
    for front, size in product(CONICS, ("equal", "mixed")):
        for shape in lens_part(lens_of(front, "sphere", size)).faces:
            surface = BRep_Tool.Surface_s(shape)
            for edge in bd.Face(shape).edges():
                first, last = BRep_Tool.Range_s(edge.wrapped)
                curve = BRep_Tool.Curve_s(edge.wrapped, 0.0, 0.0)
                image = BRep_Tool.CurveOnSurface_s(edge.wrapped, shape, 0.0, 0.0)
                for t in np.linspace(first, last, 50).tolist():
                    flat = image.Value(t)
                    # the image's 1e-9 mm, and 1e-11 mm of ruled edges between interpolated conics
                    assert curve.Value(t).Distance(surface.Value(flat.X(), flat.Y())) <= 2e-9


@pytest.mark.every(4)
@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("size", ["equal", pytest.param("mixed", marks=pytest.mark.slow)])
@pytest.mark.parametrize("front", CONICS)
def test_every_number_reads_back(tmp_path, front, size, name):
    for rear in ("sphere", "plane"):
        lens = lens_of(front, rear, size)
        path = tmp_path / f"lens.{name}"
        path.write_bytes(WRITERS[name](lens_part(lens)))
        read = READERS[name](path)
        assert_holds(read, lens)
        assert_whole(read, 6)
        assert read.volume == pytest.approx(lens.volume(), rel=1e-6)


@pytest.mark.every(12)
@pytest.mark.parametrize(  # often: every conic cut to an ellipse, and one of each kind of face otherwise
    ("front", "semi_axes", "name"),
    [
        pytest.param(front, semi_axes, name, marks=() if often else pytest.mark.slow)
        for front, semi_axes, name in product(CONICS, (None, (6.0, 6.0), (7.0, 5.0)), READERS)
        for often in [name == "step" and (semi_axes == (7.0, 5.0) or front in KINDS)]
    ],
)
def test_cut_and_mounted_lenses_read_back(tmp_path, front, semi_axes, name):
    lens, flange = lens_of(front, "sphere"), Flange(3.0, 3.9, 4.2)
    bodies = [(flanged_part(lens, flange, semi_axes), flanged_volume(lens, flange, semi_axes))]
    if semi_axes is not None:
        bodies.append((trimmed_part(lens, semi_axes), aperture_volume(lens, semi_axes)))
    for part, volume in bodies:
        path = tmp_path / f"lens.{name}"
        path.write_bytes(WRITERS[name](part))
        read = READERS[name](path)
        for face, own in zip((read.front, read.rear), optical_forms(lens)):
            assert np.array_equal(*(getattr(f, "numbers", None) for f in (face, own)))
        state = (read.solids, read.faces, read.free_edges, read.valid)
        assert state == (1, len(part.faces), 0, True)
        assert read.volume == pytest.approx(volume, rel=1e-6)


def test_rims_of_round_bodies_are_circles():
    part = trimmed_part(lens_of("sphere"), (6.0, 6.0))
    edges = Counter(kind_of(BRepAdaptor_Curve(edge.wrapped)) for edge in bd.Solid(part.solid).edges())
    assert edges == {"Circle": 4, "Line": 2}


def test_build123d_finds_the_flat_front_by_its_type(tmp_path):
    lens = Lens(FreeformSurface(HALF), FreeformSurface(HALF, Conic(150.0, -1.0), corner_sag()), 5.0, 1.5)
    path = tmp_path / "lens.step"
    path.write_bytes(step_bytes(lens))
    for solid in (bd.Solid(lens_solid(lens)), bd.import_step(path)):
        planes = solid.faces().filter_by(bd.GeomType.PLANE)
        (front,) = planes.filter_by(bd.Axis.Z)
        assert front.center().Z == 0.0
        assert front.area == pytest.approx(4 * HALF[0] * HALF[1], rel=1e-12)


def test_files_of_planes_and_spheres_are_small():
    """A sphere of 30 mm over 40 x 40 mm made 96 MB as a spline; half of that is its net."""
    flat = FreeformSurface((20, 20))
    sphere = Lens(FreeformSurface((20, 20), Conic(30.0, 0.0)), flat, 25.0, 1.5)
    assert len(step_bytes(sphere)) < 100e3
    rear = FreeformSurface((20, 20), Conic(150.0, -1.0), corner_sag())
    spline = Lens(FreeformSurface((20, 20), Conic(1e30, -1.0)), rear, 5.0, 1.5)  # flat to every bit
    assert len(step_bytes(Lens(flat, rear, 5.0, 1.5))) < len(step_bytes(spline))
