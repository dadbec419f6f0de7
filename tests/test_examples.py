"""The examples that make something of a lens run, and what they make is sound."""

import pytest

from optics.exchange.assemblies import part_checks
from tests.cases import EXAMPLES, module_at


@pytest.fixture(scope="module")
def gallery():
    return module_at(EXAMPLES / "mount.py")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["led_with_pins", "wall_washer", "microscope_ring"])
def test_a_mount_of_the_gallery_is_proven_where_it_stands(gallery, name, tmp_path, capsys):
    part = gallery.mounted(name, tmp_path)
    lens, place = gallery.LENSES[name]
    assert part.is_valid
    assert part.label == name
    assert {"front", "rear", "flange"} <= set(part.named_faces)
    vertex = part.joints["front vertex"].location.position
    assert (vertex - place.position).length < 1e-12
    checks, _ = part_checks(tmp_path / f"{name}.step", lens, False)
    assert [check for check in checks if not check.ok] == []
    assert f"{name}: flange from z = " in capsys.readouterr().out


def test_the_gallery_is_whole(gallery):
    names = sorted(path.stem for path in (EXAMPLES / "mounts").glob("*.toml"))
    assert names == sorted(gallery.LENSES)
