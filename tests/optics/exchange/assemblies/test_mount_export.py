"""Lenses with mounts in files of all formats, read back by programs that did not write them."""

from functools import cache

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.exchange.assemblies import export_mounted, mount_from, part_checks
from optics.exchange.export import MESHES, SOLIDS, Labels
from tests.optics.cases import failing
from tests.thbcad.mounts.cases import FLAT, PLAIN, ROUND, SQUARE, changed
from thbcad.lens import FreeformSurface, Lens
from thbcad.mounts import mount_of
from thbcad.sags import Conic

MOUNT = mount_of(SQUARE)


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """A function that exports the mount once in a format: its path, the files and the checks."""
    folder = tmp_path_factory.mktemp("mount")

    @cache
    def made(name):
        path = folder / f"part.{name}"
        return path, *export_mounted(FLAT, MOUNT, name, str(path), 0.05, Labels())

    return made


@pytest.mark.every(9)
@pytest.mark.parametrize("name", [*SOLIDS, *MESHES])
def test_every_format_reads_back(name, exported):
    path, files, checks = exported(name)
    assert failing(checks) == []
    assert files == [path]
    assert path.stat().st_size > 10_000
    differing = [check.value for check in checks if "numbers that differ" in check.name]
    assert differing == ([0, 0] if name in SOLIDS else [])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["step", "stl"])
def test_the_same_mount_gives_the_same_bytes(name, tmp_path, exported):
    export_mounted(FLAT, mount_of(SQUARE), name, str(tmp_path / f"again.{name}"), 0.05, Labels())
    assert exported(name)[0].read_bytes() == (tmp_path / f"again.{name}").read_bytes()


@pytest.mark.every(3)
@pytest.mark.parametrize("table", [ROUND, changed(ROUND, flange__seat=1.0), PLAIN])
def test_mounted_lenses_are_proven(table, tmp_path):
    export_mounted(FLAT, mount_of(table), "step", str(tmp_path / "part.step"), 0.05, Labels())
    checks, _ = part_checks(tmp_path / "part.step", FLAT, False)
    assert failing(checks) == []


@pytest.mark.slow
def test_a_mounted_round_lens_is_verified(tmp_path):
    disk = Lens(
        FreeformSurface((10.0, 10.0), corners=(10.0, 10.0)),
        FreeformSurface((10.0, 10.0), Conic(40.0, -1.0), corners=(10.0, 10.0)),
        5.0,
        1.5,
    )
    table = {"flange": {"outline": "round", "diameter": 26, "thickness": 1.5}}
    export_mounted(disk, mount_of(table), "step", str(tmp_path / "part.step"), 0.05, Labels())
    checks, _ = part_checks(tmp_path / "part.step", disk, False)
    assert failing(checks) == []


@pytest.mark.parametrize(
    ("name", "chord", "table", "sentence"),
    [
        ("dat", 0.01, SQUARE, r"--mount needs step, iges, brep, stl, 3mf, obj, ply.* got dat"),
        ("step", 0.01, changed(SQUARE, holes__0__at=[[0, 0]]), "hole 1 at .* into the clear aperture"),
        ("stl", np.nan, SQUARE, "chord must be"),
        ("stl", 1e-9, SQUARE, "chord must be"),
    ],
)
def test_what_cannot_be_written_is_one_sentence(name, chord, table, sentence, tmp_path):
    with pytest.raises(UserError, match=sentence):
        export_mounted(FLAT, mount_of(table), name, str(tmp_path / f"part.{name}"), chord, Labels())
    assert list(tmp_path.iterdir()) == []


def test_mount_files_that_are_none_are_one_sentence(tmp_path):
    with pytest.raises(UserError, match=r"cannot read .*give a mount.toml"):
        mount_from(str(tmp_path / "none.toml"))
    (tmp_path / "mount.toml").write_text("[flange]\nthicknes = 1\n")
    with pytest.raises(UserError, match=r"unknown key thicknes .did you mean thickness"):
        mount_from(str(tmp_path / "mount.toml"))
