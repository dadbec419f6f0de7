"""The examples that make something of a lens run, and what they make is sound."""

import importlib.util

import pytest

from tests.cases import ROOT
from thbcad import Conic, FreeformSurface, Lens

OTHER = Lens(
    FreeformSurface((9.0, 7.0), Conic(30.0, -1.0)), FreeformSurface((12.0, 8.0), Conic(-40.0, 0.0)), 8.0, 1.5
)


@pytest.fixture(scope="module")
def mount():
    spec = importlib.util.spec_from_file_location("mount", ROOT / "examples" / "mount.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
@pytest.mark.parametrize("own", [True, False], ids=["its own lens", "a rear larger than the front"])
def test_the_mount_holds_the_lens(mount, own, tmp_path, capsys):
    """The file holds two valid solids that do not meet; no face is nearer to the mount than the clearance
    less 2 per cent.

    Under a sloping rim the shortest way is shorter than that along z, by the cosine of the slope.
    """
    lens, holder = mount.main(mount.small_lens() if own else OTHER, tmp_path).children
    assert (lens.label, holder.label) == ("lens", "mount")
    assert lens.is_valid
    assert holder.is_valid
    assert len(holder.solids()) == 1
    assert tuple(holder.color)[:3] == pytest.approx(mount.ANODISED, abs=1e-6)
    printed = capsys.readouterr().out
    assert "in common: 0 mm^3" in printed
    least = 0.98 * mount.CLEARANCE
    assert holder.distance_to(lens) >= least
    assert (tmp_path / "mount.step").stat().st_size > 0
