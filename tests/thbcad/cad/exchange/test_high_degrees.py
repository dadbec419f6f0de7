"""Parts of other programs with splines of a degree above 10, as OCCT rounds edges."""

import pytest
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_BSplineSurface

from tests.thbcad.cad.shapes.cases import rough, rounded_by_occt, same_bits
from thbcad.cad.exchange import faces_of, part_mesh, part_step, read_faces, read_step, spline_faces
from thbcad.cad.shapes import Part
from thbcad.io import parse_brep
from thbcad.lens import FreeformSurface, Lens, Product, optical_forms
from thbcad.sags import Conic

FRONT, REAR = (FreeformSurface((10, 10), Conic(r, -1.0), rough(), (10, 10)) for r in (70.0, -50.0))
LENS = Lens(FRONT, REAR, 6.0, 1.5)


def test_a_part_with_splines_of_degree_14_is_read_by_every_reader(tmp_path):
    """OCCT rounds edges with them; splines here have degrees up to 10."""
    part = rounded_by_occt(LENS, 0.3)
    path = tmp_path / "rounded.step"
    path.write_bytes(part_step(part, Product()))
    read, text = read_step(path), parse_brep(path)
    faces = [BRep_Tool.Surface_s(face) for face in faces_of(read.shape)]
    assert max(face.VDegree() for face in faces if isinstance(face, Geom_BSplineSurface)) == 14
    assert (read.valid, read.closed, read.faces) == (True, True, len(text.faces))
    assert sum(not face.known for face in text.faces) == 2
    assert same_bits(read.rear, optical_forms(LENS)[1])
    assert len(spline_faces(read.shape)) == sum(face.surface is not None for face in text.faces)
    assert part_mesh(Part(read.shape, part.names, faces_of(read.shape)), 0.05).chord <= 0.05
    with pytest.raises(ValueError, match=r"degree must be an integer from 1 to 10, got 1[34]"):
        read_faces(path)
