"""`thbcad verify part.step --lens lens.json`."""

from argparse import Namespace

import pytest

from optics.commands.export_command import export
from optics.commands.verify_command import verify
from optics.runtime import UserError
from tests.thbcad.cad.parts.cases import LENSES, MOTIONS, box, located
from thbcad import write_lens, write_step
from thbcad.cad import join
from thbcad.cad.shapes import lens_part


@pytest.fixture(scope="module")
def step(tmp_path_factory):
    """The file of a lens with a flange, moved."""
    path = tmp_path_factory.mktemp("part") / "part.step"
    part = join(lens_part(LENSES["round"]), box(15, 13, 0, 1), "flange")
    write_step(located(part.solid, MOTIONS["screw"]), path, lens=LENSES["round"])
    return path


def options(path, lens):
    given = {"light": None, "rays": None, "out": None, "force": False, "optiland": False}
    return Namespace(result=str(path), lens=str(lens), **given)


def test_the_command_proves_a_part(step, tmp_path):
    write_lens(LENSES["round"], tmp_path / "lens.json")
    outcome = verify(options(step, tmp_path / "lens.json"))
    assert outcome.ok
    assert any("landing points by OCCT" in line for line in outcome.lines)


@pytest.mark.parametrize("wrong", ["no such file", "folder", "cut off", "no lens"])
def test_wrong_files_are_one_sentence(wrong, step, tmp_path):
    write_lens(LENSES["round"], tmp_path / "lens.json")
    (tmp_path / "cut.step").write_text(step.read_text("ascii")[:5000], "ascii")
    paths = {"folder": tmp_path, "cut off": tmp_path / "cut.step", "no lens": step}
    lens = tmp_path / ("lens.json" if wrong != "no lens" else "none.json")
    with pytest.raises(UserError) as raised:
        verify(options(paths.get(wrong, tmp_path / "none.step"), lens))
    assert "\n" not in str(raised.value)


MOUNT = """
[flange]
size = [34, 30]
thickness = 1.5
[[holes]]
at = [[14, 12], [-14, -12]]
diameter = 2
"""


def export_options(tmp_path, **changes):
    given = {"out": str(tmp_path / "part.step"), "format": None, "aperture": None, "flange": None}
    given |= {
        "patches": False,
        "separate": False,
        "chord": 1e-3,
        "force": False,
        "result": str(tmp_path / "lens.json"),
    }
    return Namespace(**(given | {"mount": str(tmp_path / "mount.toml")} | changes))


def test_an_exported_mount_is_proven(tmp_path):
    write_lens(LENSES["round"], tmp_path / "lens.json")
    (tmp_path / "mount.toml").write_text(MOUNT)
    outcome = export(export_options(tmp_path))
    assert outcome.ok
    assert any("least clearance of the mount, proven to be 4.65685 mm" in line for line in outcome.lines)
    assert verify(options(tmp_path / "part.step", tmp_path / "lens.json")).ok


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"flange": [1.0, 1.0, 2.0]}, "leave out --aperture, --flange"),
        ({"patches": True}, "leave out --aperture, --flange"),
        ({"out": "scene.xml"}, "leave out --aperture, --flange, --mount"),
        ({"mount": "none.toml"}, "cannot read none.toml"),
        ({"out": "part.npz"}, "--mount needs step, iges"),
    ],
)
def test_wrong_exports_of_mounts_are_one_sentence(changes, sentence, tmp_path):
    write_lens(LENSES["round"], tmp_path / "lens.json")
    (tmp_path / "mount.toml").write_text(MOUNT)
    with pytest.raises(UserError, match=sentence) as raised:
        export(export_options(tmp_path, **changes))
    assert "\n" not in str(raised.value)
