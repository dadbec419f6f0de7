"""STEP files: the same lens gives the same bytes, and only needed knots are written."""

import re

import numpy as np
import pytest
from OCP.Interface import Interface_Static

from tests.cases import python
from tests.thbcad.cases import LENSES
from thbcad import write_step
from thbcad.cad.exchange.step import read_step, step_bytes
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

# ---- the same bytes ----


@pytest.mark.parametrize("name", ["freeform", "table63"])
def test_the_same_lens_gives_the_same_bytes(name, tmp_path):
    files = [tmp_path / f"{k}.step" for k in range(3)]
    for file in files:
        write_step(LENSES[name], file)
    assert files[0].read_bytes() == files[1].read_bytes() == files[2].read_bytes()


@pytest.mark.slow
def test_another_process_gives_the_same_bytes_and_prints_nothing(tmp_path):
    program = (
        "from thbcad import *; import sys\n"
        "lens = Lens(FreeformSurface((5, 5), Conic(-5.0, -1.0)), FreeformSurface((8, 8), Conic(-10.0, "
        "-1.0)), 5.0, 1.5)\n"
        "write_step(lens, sys.argv[1])"
    )
    done = python(program, tmp_path / "a.step", check=True)
    assert (done.stdout, done.stderr) == ("", "")
    write_step(LENSES["table63"], tmp_path / "b.step")
    assert (tmp_path / "a.step").read_bytes() == (tmp_path / "b.step").read_bytes()


def test_settings_of_other_programs_do_not_change_the_file(tmp_path, occt_settings):
    """OCCT's settings are process-wide; a file must not depend on who wrote before."""
    write_step(LENSES["table63"], tmp_path / "before.step")
    Interface_Static.SetCVal_s("write.step.schema", "AP203")
    Interface_Static.SetCVal_s("write.step.unit", "M")
    write_step(LENSES["table63"], tmp_path / "after.step")
    unnamed = [
        re.sub(r"PRODUCT\('[^']*','[^']*'", "PRODUCT(", (tmp_path / f).read_text())
        for f in ("before.step", "after.step")
    ]
    assert unnamed[0] == unnamed[1]


# ---- only needed knots ----


def test_a_refined_corner_exports_only_its_knots(tmp_path):
    """4 x 4 spans, twice refined over the first 4 cells: 4 new knots per level and direction in the file."""
    lens = LENSES["freeform"]
    write_step(lens, tmp_path / "lens.step")
    rear = read_step(tmp_path / "lens.step").rear
    wanted = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16]) / 16
    for kv, half in ((rear.kv_u, 10), (rear.kv_v, 8)):
        assert abs(kv.breaks - half * (2 * wanted - 1)).max() <= 1e-14 * half
        assert kv.dim == 12 + 3
    assert read_step(tmp_path / "lens.step").front.kind == "PLANE"


@pytest.mark.slow
def test_a_lens_refined_in_one_quarter_is_a_small_file():
    """32^2 spans, of which one quarter is refined to 256^2: poles in lines through the quarter, (16 + 128)^2
    of 256^2."""
    space = THBSpace(*[KnotVector.uniform(3, 32)] * 2)
    for level in range(3):
        space = space.refine({level: np.argwhere(np.ones((16 << level, 16 << level)))})
    full = THBSpace(*[KnotVector.uniform(3, 256)] * 2)
    rng = np.random.default_rng(0)
    sizes = []
    for each in (space, full):
        sag = THBSurface(each, 1e-3 * rng.standard_normal(each.dim))
        rear = FreeformSurface((50, 50), Conic(-150.0, -1.0), sag)
        sizes.append(len(step_bytes(Lens(FreeformSurface((50, 50)), rear, 20.0, 1.5))))
    assert sizes[0] <= sizes[1] / 3
