"""`thbcad verify part.step --lens lens.json`."""

from argparse import Namespace

import pytest

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
