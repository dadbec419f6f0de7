"""The lens as a part of build123d."""

import build123d as bd
import pytest

from tests.thbcad.cad.parts.cases import LENSES, rows
from thbcad.cad import LensPart, join, write_step
from thbcad.cad.exchange import step_shape
from thbcad.cad.parts.search import placed_lens
from thbcad.cad.shapes import NAMES

LENS = LENSES["round"]
FLANGE = bd.Pos(0, 0, 0.5) * bd.Box(30, 26, 1)
PLACE = bd.Pos(5, 6, 7) * bd.Rot(10, 20, 30)


def test_plus_and_minus_keep_lens_names_label_colour_and_joints():
    plain = LensPart(LENS)
    part = plain + FLANGE - [bd.Pos(12, 10, 0) * bd.Cylinder(1, 5)]
    assert isinstance(part, LensPart)
    assert {"front", "rear", *NAMES[2:]} <= set(part.named_faces)
    assert part.label == "lens"
    assert tuple(part.color) == tuple(plain.color)
    assert set(part.joints) == {"front vertex", "rear vertex", "rim"}
    assert all(joint.parent is part for joint in part.joints.values())
    outside = 30 * 26 - 20 * 16 - 3.141592653589793
    assert part.volume - LensPart(LENS).volume == pytest.approx(
        outside, abs=1e-3
    )  # build123d asks OCCT for 1e-6


@pytest.mark.parametrize("wrong", [None, 3, "lens", bd.Box(1, 1, 1)])
def test_only_a_lens_becomes_a_part(wrong):
    with pytest.raises(ValueError, match="lens must be a Lens"):
        LensPart(wrong)
    with pytest.raises(ValueError, match="part must be a LensPart"):
        join(wrong, FLANGE)


def test_joints_sit_at_the_vertices_and_the_rim_and_move_along():
    places = {name: joint.location.position for name, joint in LensPart(LENS).joints.items()}
    assert tuple(places["front vertex"]) == (0, 0, 0)
    assert LENS.thickness + LENS.rear(0, 0) == places["rear vertex"].Z
    assert LENS.front.half_width[0] == places["rim"].X
    moved = {name: joint.location.position for name, joint in (PLACE * LensPart(LENS)).joints.items()}
    for name, place in places.items():
        wanted = (PLACE * bd.Pos(*place)).position
        assert (moved[name] - wanted).length < 1e-12
    normal = LensPart(LENS).joints["rim"].location.z_axis.direction
    assert normal.X > 0.9


def test_a_joint_of_another_part_connects():
    stand = bd.Box(5, 5, 5)
    bd.RigidJoint("top", stand, bd.Pos(1, 2, 2.5))
    part = LensPart(LENS)
    stand.joints["top"].connect_to(part.joints["front vertex"])
    assert (part.joints["front vertex"].location.position - bd.Vector(1, 2, 2.5)).length < 1e-12


@pytest.mark.parametrize("rotation", [(0, 0, 0), (10, 20, 30)])
def test_a_moved_part_is_written_through_a_placement(rotation, tmp_path):
    part = PLACE * (LensPart(LENS, rotation=rotation) + bd.Rot(*rotation) * FLANGE)
    write_step(part, tmp_path / "part.step")
    there = placed_lens(step_shape(tmp_path / "part.step"), LENS).matrix
    wanted = rows((PLACE * bd.Rot(*rotation)).wrapped.Transformation())
    assert abs(there - wanted).max() < 1e-13
    text = (tmp_path / "part.step").read_text("ascii")
    assert all(f"ADVANCED_FACE('{name}'" in text for name in ("front", "rear", "edge +x"))


def test_a_builder_adds_the_lens_to_its_part(tmp_path):
    with bd.BuildPart() as builder:
        LensPart(LENS)
        with bd.Locations((0, 0, 1.5)):
            bd.Box(30, 26, 1)
        with bd.Locations((12, 10, 1.5)):
            bd.Cylinder(1, 5, mode=bd.Mode.SUBTRACT)
    write_step(builder, tmp_path / "part.step", lens=LENS)
    assert not placed_lens(step_shape(tmp_path / "part.step"), LENS).moved


def test_chamfers_by_build123d_leave_the_optical_faces(tmp_path):
    part = LensPart(LENS) + bd.Pos(0, 0, 1.5) * bd.Box(30, 26, 1)
    outer = [e for e in part.edges() if abs(e.center().X) == 15 and abs(e.length - 26) < 1e-9]
    write_step(bd.chamfer(outer, 0.2), tmp_path / "part.step", lens=LENS)
    assert placed_lens(step_shape(tmp_path / "part.step"), LENS)
