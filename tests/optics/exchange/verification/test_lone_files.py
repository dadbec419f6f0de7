"""What a STEP file says without its lens: walls over outlines, and edges that OCCT rounded."""

from dataclasses import replace

import pytest

from optics.exchange.verification.lone_file import bare_checks, text_checks_of
from optics.exchange.verification.step_file import StepFile
from tests.optics.cases import failing, rough
from tests.thbcad.cad.shapes.cases import rounded_by_occt
from thbcad import FreeformSurface, Lens, write_step
from thbcad.cad.exchange import part_step
from thbcad.cad.shapes import moulded_part
from thbcad.hierarchy import THBSpace
from thbcad.io import parse_brep
from thbcad.lens import Product
from thbcad.moulds import BodyOptions, MouldedBody
from thbcad.sags import Conic
from thbcad.splines import BSplineSurface, KnotVector
from thbcad.surfaces import THBSurface

PROOF = "text of the file: no proof that front, rear and edges stay apart"
OUTLINES = {  # half-widths and corners of front and rear
    "round": [((10.0, 10.0), (10.0, 10.0))] * 2,
    "ellipse": [((10.0, 7.0), (10.0, 7.0))] * 2,
    "rounded": [((10.0, 7.0), (2.0, 1.5))] * 2,
    "cone": [((8.0, 8.0), (8.0, 8.0)), ((10.0, 10.0), (10.0, 10.0))],
}


def round_lens(pair, radius=-50.0):
    """A paraboloid, and a rear with a sag."""
    (front, first), (rear, last) = pair
    space = THBSpace(*[KnotVector.uniform(3, 4, -h, h) for h in rear])
    sag = THBSurface(space, rough(space, 0.05))
    return Lens(
        FreeformSurface(front, Conic(70.0, -1.0), None, first),
        FreeformSurface(rear, Conic(radius, -1.0), sag, last),
        4.0,
        1.5,
    )


@pytest.mark.every(3)
@pytest.mark.parametrize("pair", OUTLINES.values(), ids=OUTLINES)
def test_front_and_rear_of_a_file_are_proven_apart_within_their_outline(tmp_path, pair):
    """2.3 to 2.6 mm apart at x = 10 mm, and 4 in the middle; with a rear 2.8 mm lower the text tells."""
    write_step(round_lens(pair), tmp_path / "lens.step")
    solid = parse_brep(tmp_path / "lens.step")
    checks, left_out = text_checks_of(solid)
    assert failing(checks) == []
    assert checks[-1].name == PROOF
    assert left_out == []
    rear = next(face for face in solid.faces if face.name == "rear")
    s = rear.surface
    low = replace(rear, surface=BSplineSurface(s.kv_u, s.kv_v, s.coefficients - [0, 0, 2.8]))
    faces = tuple(low if face is rear else face for face in solid.faces)
    found = text_checks_of(replace(solid, faces=faces)).checks[-1]
    assert found.name.startswith(PROOF)
    assert "cross" in found.name


@pytest.mark.slow
def test_a_file_with_rounded_edges_is_read_and_says_what_occt_alone_measures(tmp_path):
    """OCCT's roundings have a degree of 14, as parts that other programs of its kernel make."""
    part = rounded_by_occt(round_lens(OUTLINES["round"]), 0.2)
    (tmp_path / "body.step").write_bytes(part_step(part, Product(), "AP242"))
    file = StepFile(tmp_path / "body.step")
    checks, left_out = bare_checks(file)
    assert failing(checks) == []
    assert any(c.name == "shell not closed, by OCCT" for c in checks)
    (measured,) = (sentence for sentence in left_out if sentence.startswith("volume and area"))
    assert "must be a plane, a spline up to degree 10" in measured
    assert f"OCCT alone finds {file.state.volume:.9g} mm3" in measured


@pytest.mark.slow
def test_a_body_with_rounded_edges_is_measured_by_its_text(tmp_path):
    """Its walls taper, so that they are not those over one outline."""
    body = MouldedBody.of(round_lens(OUTLINES["round"]), BodyOptions(3, edge_radius=0.2))
    (tmp_path / "body.step").write_bytes(part_step(moulded_part(body), Product(), "AP242"))
    checks, left_out = bare_checks(StepFile(tmp_path / "body.step"))
    assert failing(checks) == []
    assert not any(sentence.startswith("volume and area") for sentence in left_out)
    assert sum("crossings of front and rear" in sentence for sentence in left_out) == 1
