"""Parts with a lens proven by their STEP files: what is right passes, what is wrong is named."""

import numpy as np
import pytest
from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform

from optics.exchange.assemblies import part_checks, placed_text
from tests.optics.cases import failing
from tests.thbcad.cad.parts.cases import FLUSH, LENSES, MOTIONS, box, located, rod, rows
from thbcad import write_step
from thbcad.cad import cut, join
from thbcad.cad.shapes import lens_part
from thbcad.lens import placed_surfaces


def part_of(lens):
    """The lens with a flange of 1 mm round it and a bore in that."""
    x, y = (max(a, b) for a, b in zip(lens.front.half_width, lens.rear.half_width))
    low = 0.0 if lens.front.is_plane else 0.4 * lens.thickness
    part = join(lens_part(lens), box(x + 5, y + 4, low, low + 1), "flange")
    return cut(part, rod(x + 3, y + 2, 1, low - 1, low + 2), "bore")


def failed(path, lens, by_optiland=False):
    return failing(part_checks(path, lens, by_optiland)[0])


@pytest.fixture(scope="module")
def step(tmp_path_factory):
    """The file of a lens in its mount, moved."""
    path = tmp_path_factory.mktemp("part") / "part.step"
    write_step(located(part_of(LENSES["round"]).solid, MOTIONS["screw"]), path, lens=LENSES["round"])
    return path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "motion"),
    [("round", None), ("sphere", "turn"), ("upright", "shift"), ("flat, smaller", "screw")],
)
def test_a_lens_in_its_mount_is_proven(name, motion, tmp_path):
    lens = LENSES[name]
    solid = part_of(lens).solid
    solid = solid if motion is None else located(solid, MOTIONS[motion])
    write_step(solid, tmp_path / "part.step", lens=lens)
    checks, left_out = part_checks(tmp_path / "part.step", lens, False)
    assert failing(checks) == []
    told = ("distance from curves in the faces' parameters", "light by edges", "light before the front")
    words = ("proof of the light in the glass", "the volume between front and rear")
    sampled = words if "smaller" in name else ()  # its edges are no planes
    assert all(what.startswith((*told, *sampled)) for what in left_out)
    volumes = [check for check in checks if check.name.startswith("volume of the part")]
    assert [check.limit for check in volumes] == ([] if sampled else [1e-9])
    landing = next(check for check in checks if check.name.startswith("landing points by OCCT"))
    assert landing.value < 1e-11 < landing.limit == 1e-8


@pytest.mark.slow  # optiland takes seconds to load
@pytest.mark.parametrize("name", [*FLUSH, "sphere", "ellipsoid"])
def test_optiland_lands_where_the_lens_does(name, tmp_path):
    lens = LENSES[name]
    write_step(located(part_of(lens).solid, MOTIONS["turn"]), tmp_path / "part.step", lens=lens)
    checks, _ = part_checks(tmp_path / "part.step", lens, True)
    assert failing(checks) == []
    assert next(check for check in checks if check.name.startswith("landing points by opti")).value < 1e-11


def test_the_placement_stands_in_the_text(step):
    assert np.abs(placed_text(step).motion - rows(MOTIONS["screw"])).max() < 1e-15


def test_another_lens_fails(step):
    assert any("no face with the surface of the rear" in name for name in failed(step, LENSES["upright"]))


def test_a_digit_of_a_pole_fails(step, tmp_path):
    text = step.read_text("ascii")
    pole = repr(float(placed_surfaces(LENSES["round"])[1].coefficients[3, 4, 2]))
    last = str((int(pole[-1]) + 5) % 10)
    assert pole in text
    (tmp_path / "part.step").write_text(text.replace(pole, pole[:-1] + last), "ascii")
    assert failed(tmp_path / "part.step", LENSES["round"]) == [
        "text of the file: faces named rear that are not the rear of the lens",
        "rear numbers that differ from the lens in memory, by OCCT",
    ]


def test_a_hole_in_the_clear_aperture_fails(tmp_path):
    lens = LENSES["round"]
    holed = cut(lens_part(lens), rod(3, 2, 0.5, -1, 20), "hole")
    write_step(holed.solid, tmp_path / "part.step", lens=lens)
    names = failed(tmp_path / "part.step", lens)
    assert {
        f"area of the {name} that the part covers or cuts, relative" for name in ("front", "rear")
    } <= set(names)


def test_numbers_that_another_program_moved_fail(tmp_path):
    from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer

    lens = LENSES["round"]
    moved = BRepBuilderAPI_Transform(part_of(lens).solid, MOTIONS["screw"], True).Shape()
    writer = STEPControl_Writer()
    writer.Transfer(moved, STEPControl_AsIs)
    writer.Write(str(tmp_path / "part.step"))
    names = failed(tmp_path / "part.step", lens)
    assert "rear numbers that differ from the lens in memory, by OCCT" in names
