"""Lenses found in parts, joined with others and written: the optical faces keep every bit."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf
from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain
from OCP.TopLoc import TopLoc_Location

from tests.thbcad.cad.parts.cases import FLUSH, LENSES, MOTIONS, box, located, rod, rows
from thbcad.cad.exchange import SolidState, step_bytes, step_shape
from thbcad.cad.parts.named_booleans import fused, without
from thbcad.cad.parts.numbers_of_surfaces import surface_numbers
from thbcad.cad.parts.search import placed_lens
from thbcad.cad.parts.writing import placed_step, write_step
from thbcad.cad.shapes import lens_part

ROUNDING = 1e-13  # of rotations and of shifts of some mm, twice


def mounted(lens, flush=True):
    """A lens with a flange of 1 mm, flush with the plane z = 0 or at half its height, and a bore in it."""
    x, y = (max(a, b) for a, b in zip(lens.front.half_width, lens.rear.half_width))
    low = 0.0 if flush else 0.4 * lens.thickness
    part = fused(lens_part(lens), box(x + 5, y + 4, low, low + 1), "flange")
    return without(part, rod(x + 3, y + 2, 1, low - 1, low + 2), "bore")


def mirrored(solid):
    """The solid mirrored about the plane x = 0, by its location alone."""
    mirror = gp_Trsf()
    mirror.SetMirror(gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(1, 0, 0)))
    return solid.Moved(TopLoc_Location(mirror), False)


@cache
def part_of(name):
    """The part of a lens by name, made once."""
    return mounted(LENSES[name], name in FLUSH)


def moved_bits(part, lens):
    """Return how many numbers of front and rear differ from those of the lens."""
    placed = placed_lens(part, lens)
    found = {
        name: surface_numbers(BRep_Tool.Surface_s(f, TopLoc_Location())) for name, f in placed.faces.items()
    }
    return sum(found[name].differing(surface_numbers(own)) for name, own in placed.surfaces.items())


@pytest.mark.every(8)
@pytest.mark.parametrize("name", LENSES)
@pytest.mark.parametrize("motion", [None, *MOTIONS])
def test_a_mounted_and_moved_lens_reads_back_bit_for_bit(name, motion, tmp_path):
    lens, part = LENSES[name], part_of(name)
    solid = part.solid if motion is None else located(part.solid, MOTIONS[motion])
    write_step(solid, tmp_path / "part.step", lens=lens)
    read = step_shape(tmp_path / "part.step")
    state, wanted = SolidState(read), SolidState(part.solid)
    assert (state.solids, state.faces, state.free_edges) == (1, wanted.faces, 0)
    assert state.valid
    assert state.closed
    assert state.tolerance <= 1e-6  # where a slanted edge of the lens meets the flange
    faces = placed_lens(read, lens).faces.values()
    assert max(SolidState(face).tolerance for face in faces) <= 1e-7 * (1 + 1e-9)
    assert moved_bits(read, lens) == 0
    placement = placed_lens(read, lens).matrix
    there = np.eye(4)[:3] if motion is None else rows(MOTIONS[motion])
    assert np.abs(placement - there).max() < ROUNDING


@pytest.mark.every(8)
@pytest.mark.parametrize("name", LENSES)
def test_numbers_that_another_program_has_moved_are_put_back(name, tmp_path):
    lens, part = LENSES[name], part_of(name)
    solid = BRepBuilderAPI_Transform(part.solid, MOTIONS["screw"], True).Shape()
    assert moved_bits(solid, lens) > 10
    write_step(solid, tmp_path / "part.step", lens=lens)
    read = step_shape(tmp_path / "part.step")
    assert moved_bits(read, lens) == 0
    assert SolidState(read).valid
    assert (
        np.abs(placed_lens(read, lens).matrix - rows(MOTIONS["screw"])).max() < 1e-12
    )  # of the least-squares fit to poles
    assert moved_bits(solid, lens) > 10  # the part that was given stays as it is


def test_the_same_part_gives_the_same_bytes():
    lens = LENSES["upright"]
    a, b = (placed_step(located(mounted(lens, False).solid, MOTIONS["screw"]), lens) for _ in range(2))
    assert a == b


def test_a_lens_is_written_as_ever(tmp_path):
    write_step(LENSES["round"], tmp_path / "lens.step")
    assert (tmp_path / "lens.step").read_bytes() == step_bytes(LENSES["round"])


@pytest.mark.parametrize("name", FLUSH)
def test_a_flush_flange_leaves_the_front_its_own_edges(name):
    lens, part = LENSES[name], part_of(name)
    front = placed_lens(part.solid, lens).faces["front"]
    area = 4 * lens.front.half_width[0] * lens.front.half_width[1]
    state = SolidState(front)
    assert abs(state.area / area - 1) < 1e-9  # the rectangle of the lens, no more
    assert part.names.count("front") == part.names.count("rear") == 1
    assert part.names.count("bore") == 1
    assert part.names.count("flange") >= 6


def test_a_plane_that_was_unified_is_named():
    lens = LENSES["round"]
    union = BRepAlgoAPI_Fuse(lens_part(lens).solid, box(15, 13, 0, 1)).Shape()
    clean = ShapeUpgrade_UnifySameDomain(union, True, True, True)
    clean.Build()
    with pytest.raises(ValueError, match=r"the (part holds no face with the surface of the )?front.*join"):
        placed_lens(clean.Shape(), lens)


def test_what_destroys_an_optical_face_is_refused():
    lens = LENSES["round"]
    part = lens_part(lens)
    with pytest.raises(ValueError, match="cut: the tool cuts the front into 2 pieces"):
        without(part, box(1, 20, -1, 1))
    with pytest.raises(ValueError, match="join: the tool leaves nothing of the rear"):
        fused(part, box(20, 20, 1, 9))
    with pytest.raises(ValueError, match="join: the part would fall into 2 solids"):
        fused(part, box(1, 1, 20, 21))
    assert without(part, rod(0, 0, 1, -1, 20), "hole").names.count("rear") == 1


@pytest.mark.parametrize(
    ("part", "sentence"),
    [
        ("a box", "part must be a Lens or one shape"),
        (None, "part must be a Lens or one shape"),
        (mirrored(lens_part(LENSES["round"]).solid), "the part is mirrored"),
        (box(1, 1, 0, 1), "no face with the surface of the rear"),  # a plane front is there
        (box(1, 1, 0, 1).Reversed().EmptyCopied(), "part must hold one solid|no face"),
    ],
)
def test_other_things_are_refused_in_one_sentence(part, sentence):
    with pytest.raises(ValueError, match=sentence):
        write_step(part, Path("never.step"), lens=LENSES["round"])


def test_a_part_without_its_lens_is_refused():
    with pytest.raises(ValueError, match="lens must be given"):
        write_step(part_of("round").solid, Path("never.step"))
