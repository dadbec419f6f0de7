"""Checks of lenses, curves and surfaces that another library holds; they need OCP alone."""

import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve

from tests.thbcad.cad.exchange.cases import assert_same
from tests.thbcad.cad.shapes.cases import same_bits
from thbcad.cad.exchange.solid_file import optical_form, solid_volume
from thbcad.cad.shapes import spline_surface
from thbcad.lens import optical_forms

FLAT = ("plano", "freeform", "paraboloids", "sphere")  # lenses whose edges are planes
TEXT = 1e-13  # relative accuracy of numbers in STEP files written by OCCT (about 13 digits)


def net(shape):
    """Return the surface of a face."""
    return optical_form(shape.wrapped)


def volume(shape):
    """Return the volume by OCCT with error control, which neither library offers."""
    return solid_volume(shape.wrapped, 1e-6)


def edge_middle(lens):
    """Return the point of the edge +y half-way between the rims."""
    hy = lens.front.half_width[1]
    rims = lens.front(0.0, hy), lens.thickness + lens.rear(0.0, hy)
    return 0.0, hy, sum(rims) / 2


def kept(faces, lens):
    """Return for front and rear how many faces have exactly the same surface, bit for bit."""
    forms = [net(face) for face in faces]
    return [sum(type(f) is type(own) and same_bits(f, own) for f in forms) for own in optical_forms(lens)]


def assert_moved(faces, lens, away):
    """Front and rear of a lens with a flat front, read from STEP, moved along z by `away` mm."""
    (front, rear), own = (net(face) for face in faces), optical_forms(lens)
    assert front.vertex == pytest.approx(own[0].vertex + away, abs=TEXT * away)
    moved = own[1].coefficients + np.array([0, 0, away])
    np.testing.assert_allclose(rear.coefficients, moved, rtol=0, atol=TEXT * np.abs(moved).max())


def assert_follows(edge, curve):
    """OCCT's points of an edge are those of the curve: sums of at most eight terms up to 10."""
    t = np.linspace(curve.kv.start, curve.kv.stop, 9)
    found = [BRepAdaptor_Curve(edge.wrapped).Value(x).Coord() for x in t.tolist()]
    np.testing.assert_allclose(found, curve(t), rtol=0, atol=80 * np.finfo(float).eps)


def assert_covers(face, surface):
    """A face has the numbers of a surface, bit for bit."""
    assert_same([spline_surface(BRep_Tool.Surface_s(face.wrapped))], [surface])


def missing(library):
    """Return the pattern of the message about a library that cannot be imported."""
    return rf'^{library} cannot be imported \(.*\); pip install "thbcad\[{library}\]"$'
