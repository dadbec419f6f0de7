"""`thbcad export DIR --out scene.xml`: a scene that Mitsuba reads by itself; refusals in one sentence."""

import sys

import pytest

from optics.interface.commands.cli import main
from tests.optics.interface.commands.cases import data_of, refused


@pytest.mark.slow
def test_the_scene_is_written_read_back_and_recorded(capsys, result, tmp_path):
    pytest.importorskip("mitsuba")
    out = tmp_path / "scene.xml"
    data = data_of(capsys, "export", result, "--out", out)
    assert data["ok"]
    names = {out.parent.joinpath(file).name for file in data["files"]}
    assert {"scene.xml", "scene_front.ply", "scene_rear.ply", "scene_edges.ply"} <= names
    assert set(data["sha256"]) == names
    assert main(["export", str(result), "--out", str(out)]) == 0  # over its own files
    capsys.readouterr()
    out.write_text("mine", "utf-8")
    message = refused(capsys, "export", result, "--out", out)
    assert "scene.xml" in message
    assert out.read_text("utf-8") == "mine"


def test_what_a_scene_cannot_hold_is_refused(capsys, result, tmp_path):
    message = refused(capsys, "export", result, "--out", tmp_path / "scene.xml", "--aperture", "5", "5")
    assert "a scene holds the whole lens" in message
    message = refused(capsys, "export", result / "lens.json", "--out", tmp_path / "scene.xml")
    assert "a scene needs the problem of a result folder" in message
    assert not list(tmp_path.glob("scene*"))


class Lacking:
    """A finder of a system on which a package is not installed."""

    def __init__(self, package):
        self.package = package

    def find_spec(self, name, path=None, target=None):
        if name == self.package:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


@pytest.mark.parametrize(
    ("name", "package"), [("light.ies", "photompy"), ("light.ies", "matplotlib"), ("scene.xml", "drjit")]
)
def test_a_package_that_is_missing_is_told_before_light_is_traced(
    capsys, monkeypatch, result, tmp_path, name, package
):
    """photompy loads matplotlib, and Mitsuba loads Dr.Jit."""
    if name == "scene.xml":
        pytest.importorskip("mitsuba")
    for module in [m for m in sys.modules if m.partition(".")[0] in ("photompy", "mitsuba", package)]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setattr(sys, "meta_path", [Lacking(package), *sys.meta_path])
    monkeypatch.setattr("optics.interface.commands.light_export.traced_intensity", None)
    message = refused(capsys, "export", result, "--out", tmp_path / name)
    assert message == f'thbcad: {package} is not installed; pip install "thbcad[optics]"'
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize("name", ["scene.xml", "light.ies", "rays.dat"])
def test_an_assembly_beside_light_is_refused(capsys, result, tmp_path, name):
    light = ["--light", "rear"] if name == "rays.dat" else []
    message = refused(capsys, "export", result, "--out", tmp_path / name, *light, "--scene", "elements")
    assert "--scene writes an assembly as STEP" in message
    assert not (tmp_path / name).exists()


def test_a_back_at_zero_is_an_option_too(capsys, result, tmp_path):
    message = refused(capsys, "export", result, "--out", tmp_path / "scene.xml", "--back", "0")
    assert "a scene holds the whole lens" in message
