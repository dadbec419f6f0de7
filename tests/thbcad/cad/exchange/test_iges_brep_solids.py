"""The lens as a solid in IGES and BREP files."""

import re

import pytest
from hypothesis import HealthCheck, given

from tests.cases import examples
from tests.thbcad.cad.shapes.cases import assert_whole
from tests.thbcad.cases import assert_holds, lenses
from thbcad import FreeformSurface, Lens
from thbcad.cad.exchange.iges_brep_solids import brep_bytes, iges_bytes, read_brep, read_iges
from thbcad.sags import Conic

FORMATS = {"iges": (iges_bytes, read_iges), "brep": (brep_bytes, read_brep)}
SPHERES = Lens(
    FreeformSurface((5.0, 4.0), Conic(40.0, 0.0)), FreeformSurface((5.0, 4.0), Conic(-30.0, 0.5)), 6.0, 1.5
)
RULED = Lens(
    FreeformSurface((5.0, 4.0), Conic(-9.0, -1.0)), FreeformSurface((8.0, 3.0), Conic(-12.0, -1.0)), 6.0, 1.5
)


def written(lens, name, folder):
    path = folder / f"lens.{name}"
    path.write_bytes(FORMATS[name][0](lens))
    return path


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMATS)
@examples(15, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
@given(lens=lenses())
def test_every_number_reads_back(tmp_path, name, lens):
    read = FORMATS[name][1](written(lens, name, tmp_path))
    assert_holds(read, lens)
    assert (read.solids, read.faces, read.free_edges) == (1, 6, 0)


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("lens", [SPHERES, RULED], ids=["equal sizes", "ruled edges"])
def test_the_solid_is_whole_and_bit_exact(tmp_path, name, lens):
    read = FORMATS[name][1](written(lens, name, tmp_path))
    assert_whole(read, 6)
    assert_holds(read, lens)
    assert read.volume == pytest.approx(lens.volume(), rel=1e-6)


@pytest.mark.parametrize("name", FORMATS)
def test_the_same_lens_gives_the_same_bytes(name):
    assert FORMATS[name][0](RULED) == FORMATS[name][0](RULED)


def test_iges_holds_one_manifold_solid_in_mm():
    text = iges_bytes(RULED).decode("ascii")
    kinds = [int(line[:8]) for line in text.splitlines() if line[72] == "D"][
        ::2
    ]  # two lines per directory entry
    assert [kinds.count(kind) for kind in (186, 514, 510)] == [1, 1, 6]  # solid, shell, faces
    assert re.search(r",2,2HMM,", "".join(line[:72] for line in text.splitlines() if line[72] == "G"))


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 0.9])
def test_truncated_files_are_refused(tmp_path, name, share):
    path = written(RULED, name, tmp_path)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(ValueError, match=r"lens\.\w+ is not a readable"):
        FORMATS[name][1](path)


def test_a_missing_file_is_an_oserror(tmp_path):
    for name, (_, read) in FORMATS.items():
        with pytest.raises(OSError, match="No such file"):
            read(tmp_path / f"none.{name}")
