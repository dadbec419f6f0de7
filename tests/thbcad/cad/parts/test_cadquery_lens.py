"""The lens on a Workplane of cadquery."""

import cadquery as cq
import pytest
from OCP.BRep import BRep_Tool

from tests.cases import ROOT
from tests.page_blocks import blocks, of_cadquery, unannounced
from tests.thbcad.cad.parts.cases import LENSES
from thbcad.cad import cut, join, workplane, write_step
from thbcad.cad.exchange import step_shape
from thbcad.cad.parts.numbers_of_surfaces import surface_numbers
from thbcad.cad.parts.search import placed_lens

LENS = LENSES["round"]
FRONT = LENSES["upright"]  # a spline front
PAGES = [page for page in (ROOT / "docs").rglob("*.md") if any(map(of_cadquery, blocks(page)))]


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


def numbers(solid, lens, name):
    """Return how many numbers differ from the front or rear of a lens, for each face of the same kind."""
    own = surface_numbers(BRep_Tool.Surface_s(workplane(lens).faces(tag=name).val().wrapped))
    found = [surface_numbers(BRep_Tool.Surface_s(face.wrapped)) for face in solid.Faces()]
    return sorted(x.differing(own) for x in found if x.matches(own))


@pytest.mark.parametrize("clean", [True, False])
def test_cadquery_keeps_the_numbers_of_splines_and_merges_a_flush_front(clean):
    """`clean` is cadquery's name for merging neighbouring faces on one surface."""
    flange = cq.Workplane().box(30, 26, 1, centered=(True, True, False))
    part = workplane(LENS).union(flange, clean=clean).val()
    assert len(part.Faces()) == (11 if clean else 12)
    assert numbers(part, LENS, "rear") == [0]
    if clean:
        with pytest.raises(ValueError, match=r"front is merged.*clean\(\)"):
            placed_lens(part, LENS)
    else:
        assert placed_lens(part, LENS)


@pytest.mark.parametrize("clean", [True, False])
def test_cadquery_merges_the_pieces_of_a_spline_without_changing_it(clean):
    halves = [cq.Workplane().box(40, 40, 40).translate((x, 0, 0)) for x in (20, -20)]
    lens = workplane(FRONT)  # both halves have its very surfaces: OCCT merges no copies
    left, right = (lens.intersect(half, clean=False) for half in halves)
    part = left.union(right, clean=clean).val()
    found = [numbers(part, FRONT, name).count(0) for name in ("front", "rear")]
    assert found == ([1, 1] if clean else [2, 2])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_blocks_of_cadquery_print_what_their_comments_say(page):
    for block in filter(of_cadquery, blocks(page)):
        assert unannounced(block, {}) == []
