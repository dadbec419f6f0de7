"""`thbcad verify part.step --lens lens.json`."""

from dataclasses import replace

import pytest
from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

from optics.base.runtime import UserError
from optics.interface.commands.arguments import parsed
from optics.interface.commands.export_command import export
from optics.interface.commands.verify_command import verify
from tests.thbcad.cad.parts.cases import LENSES, MOTIONS, box, located
from thbcad import read_lens, write_lens, write_step
from thbcad.cad import cut, join
from thbcad.cad.shapes import lens_part
from thbcad.lens import MIRROR_SIDES, Product


@pytest.fixture(scope="module")
def step(tmp_path_factory):
    """The file of a lens with a flange, moved."""
    path = tmp_path_factory.mktemp("part") / "part.step"
    part = join(lens_part(LENSES["round"]), box(15, 13, 0, 1), "flange")
    write_step(located(part.solid, MOTIONS["screw"]), path, lens=LENSES["round"])
    return path


def options(path, lens):
    return parsed(["verify", str(path), "--lens", str(lens), "--no-optiland"])


def test_the_command_proves_a_part(step, tmp_path):
    write_lens(LENSES["round"], tmp_path / "lens.json")
    outcome = verify(options(step, tmp_path / "lens.json"))
    assert outcome.code == 0
    assert any("landing points by OCCT" in line for line in outcome.lines)


def test_the_faces_of_a_mirror_have_names_of_their_own(tmp_path):
    blank = replace(LENSES["round"], index=1.0)
    write_lens(blank, tmp_path / "lens.json")
    write_step(blank, tmp_path / "mirror.step", Product(sides=MIRROR_SIDES))
    outcome = verify(options(tmp_path / "mirror.step", tmp_path / "lens.json"))
    assert any(line.startswith("ok     text of the file: faces named back") for line in outcome.lines)
    assert [line for line in outcome.lines if line.startswith("FAILED text")] == []


@pytest.mark.parametrize("wrong", ["no such file", "folder", "cut off", "no lens"])
def test_wrong_files_are_one_sentence(wrong, step, tmp_path):
    write_lens(LENSES["round"], tmp_path / "lens.json")
    (tmp_path / "cut.step").write_text(step.read_text("ascii")[:5000], "ascii")
    paths = {"folder": tmp_path, "cut off": tmp_path / "cut.step", "no lens": step}
    lens = tmp_path / ("lens.json" if wrong != "no lens" else "none.json")
    with pytest.raises(UserError) as raised:
        verify(options(paths.get(wrong, tmp_path / "none.step"), lens))
    assert "\n" not in str(raised.value)


@pytest.mark.slow
def test_the_folder_of_a_design_knows_its_light(golden, tmp_path):
    lens = read_lens(golden.path / "lens.json")
    middle = gp_Ax2(gp_Pnt(-200, 0, lens.thickness / 2), gp_Dir(1, 0, 0))
    fine = BRepPrimAPI_MakeCylinder(middle, 0.02, 400).Shape()
    write_step(lens, tmp_path / "lens.step")
    write_step(cut(lens_part(lens), fine).solid, tmp_path / "bored.step", lens=lens)
    outcome = verify(options(tmp_path / "lens.step", golden.path))
    assert outcome.code == 0
    assert sum(line.startswith("ok") and "proven" in line for line in outcome.lines) == 5
    bored = verify(options(tmp_path / "bored.step", golden.path))
    assert bored.code == 4
    assert any("FAILED faces of the part within the light's glass" in line for line in bored.lines)
    assert any("left out: proof of the light in the glass" in line for line in bored.lines)


MOUNT = """
[flange]
size = [34, 30]
thickness = 1.5
[[holes]]
at = [[14, 12], [-14, -12]]
diameter = 2
"""


def export_options(tmp_path, out="part.step", mount="mount.toml", *more):
    given = ["export", tmp_path / "lens.json", "--out", tmp_path / out, "--mount", tmp_path / mount, *more]
    return parsed([str(word) for word in given])


@pytest.mark.slow
def test_an_exported_mount_is_proven(tmp_path):
    write_lens(LENSES["round"], tmp_path / "lens.json")
    (tmp_path / "mount.toml").write_text(MOUNT)
    outcome = export(export_options(tmp_path))
    assert outcome.code == 0
    assert any("least clearance of the mount, proven to be 4.65685 mm" in line for line in outcome.lines)
    assert verify(options(tmp_path / "part.step", tmp_path / "lens.json")).code == 0


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["part.step", "mount.toml", "--flange", "1", "1", "2"], "leave out --aperture, .*--flange"),
        (["part.step", "mount.toml", "--patches"], "leave out --aperture, .*--flange"),
        (["scene.xml"], "leave out --aperture, .*--mount"),
        (["part.step", "none.toml"], "cannot read .*none.toml"),
        (["part.npz"], "--mount needs step, iges"),
    ],
)
def test_wrong_exports_of_mounts_are_one_sentence(words, sentence, tmp_path):
    write_lens(LENSES["round"], tmp_path / "lens.json")
    (tmp_path / "mount.toml").write_text(MOUNT)
    with pytest.raises(UserError, match=sentence) as raised:
        export(export_options(tmp_path, *words))
    assert "\n" not in str(raised.value)
