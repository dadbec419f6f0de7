"""The lens on a Workplane of cadquery."""

import cadquery as cq
import pytest

from tests.thbcad.cad.parts.cases import LENSES
from thbcad.cad import cut, join, workplane, write_step
from thbcad.cad.exchange import step_shape
from thbcad.cad.parts.search import placed_lens

LENS = LENSES["round"]


@pytest.mark.parametrize("wrong", [None, 3, "lens", cq.Solid.makeBox(1, 1, 1)])
def test_only_a_lens_becomes_a_workplane(wrong):
    with pytest.raises(ValueError, match="lens must be a Lens"):
        workplane(wrong)
    with pytest.raises(ValueError, match="part must be a LensPart, a Workplane"):
        join(wrong, cq.Solid.makeBox(1, 1, 1))


def test_a_workplane_has_its_faces_tagged_and_keeps_the_tags(tmp_path):
    lens = workplane(LENS)
    assert lens.faces(tag="front").val().Area() == pytest.approx(20 * 16, rel=1e-9)
    part = join(lens, cq.Workplane().box(30, 26, 1, centered=(True, True, False)), "flange")
    part = cut(part, cq.Workplane().center(12, 10).circle(1).extrude(5), "bore")
    assert part.faces(tag="front").val().Area() == pytest.approx(20 * 16, rel=1e-9)
    assert part.faces(tag="bore").size() == 1
    write_step(part, tmp_path / "part.step")
    text = (tmp_path / "part.step").read_text("ascii")
    assert all(f"ADVANCED_FACE('{name}'" in text for name in ("front", "flange", "flange 2", "bore"))
    side = part.faces(">X").workplane(centerOption="CenterOfMass")
    with pytest.raises(ValueError, match=r"front.*clean\(\)"):
        write_step(side.hole(0.5, 2), tmp_path / "part.step", lens=LENS)
    drilled = side.hole(0.5, 2, clean=False)
    write_step(drilled, tmp_path / "part.step", lens=LENS)
    assert placed_lens(step_shape(tmp_path / "part.step"), LENS)
