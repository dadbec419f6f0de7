"""`thbcad relight` and `thbcad export --light`: other light on a finished lens, and its light as rays."""

import json

import numpy as np
import pytest
from PIL import Image

from optics.interface.api import Design
from optics.scene.luminaires import read_luminaire
from optics.scene.problem import load_problem
from optics.scene.ray_files import read_rays
from optics.scene.system import System
from tests.optics.cases import target_z, write_problem
from tests.optics.interface.commands.cases import refused, run


@pytest.mark.slow
def test_a_lens_in_the_sun_stands_beside_its_own_light(capsys, golden, tmp_path):
    done = run(capsys, "relight", golden.path, "--source", "sun", "--out", tmp_path / "sun.png", "--json")
    assert done.code == 0
    data = json.loads(done.out)
    assert data["relit"]["efficiency"] == pytest.approx(data["designed"]["efficiency"], rel=0.01)
    assert data["relit"]["rel_l2_debiased"] > data["designed"]["rel_l2_debiased"]
    with Image.open(tmp_path / "sun.png") as picture:
        assert picture.width > 3 * 300


@pytest.mark.slow
def test_a_metric_that_is_not_defined_is_a_dash(capsys, tmp_path, monkeypatch):
    """Similarity has no window on two columns of pixels."""
    problem = load_problem(write_problem(tmp_path, {"target.pixels": [2, 8]}))
    system = System(problem)
    monkeypatch.setattr(Design, "load", lambda folder: Design(system))
    done = run(capsys, "relight", "lens", "--source", "sun")
    assert (done.code, done.err) == (0, "")
    assert ["ssim", "-", "-"] in [line.split() for line in done.out.splitlines()]
    data = json.loads(run(capsys, "relight", "lens", "--source", "sun", "--json").out)
    assert data["designed"]["ssim"] is None is data["relit"]["ssim"]


def test_light_of_another_file_may_be_in_another_unit(capsys, tmp_path, monkeypatch):
    problem = load_problem(write_problem(tmp_path, {"target.pixels": [12, 12]}))
    (tmp_path / "other").mkdir()
    lumens = write_problem(tmp_path / "other", {"source.unit": "lm", "source.half_width": [3.0, 3.0]})
    system = System(problem)
    monkeypatch.setattr(Design, "load", lambda folder: Design(system))
    done = run(capsys, "relight", "lens", "--source", lumens)
    assert done.err == ""
    assert done.out.splitlines()[-1].startswith(f"{lumens}: ")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--source", "moon"], "--source must be"),
        (["--source", "led:1mm"], "no place"),
        (["--source", "sun", "--out", "sun.jpg"], "--out must end in .png"),
        (["--source", "none.toml"], "none.toml"),
        ([], "--source"),
    ],
)
def test_bad_light_is_one_sentence(capsys, golden, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert words in refused(capsys, "relight", golden.path, *arguments)
    assert not (tmp_path / "sun.jpg").exists()


@pytest.mark.parametrize("suffix", [".tm25ray", ".dat", ".ray"])
def test_light_of_a_lens_is_written_as_rays(capsys, result, tmp_path, suffix):
    out = tmp_path / f"light{suffix}"
    done = run(capsys, "export", result, "--light", "target", "--rays", 900, "--out", out)
    assert done.code == 0, done.err
    rays = read_rays(out)
    assert len(rays) == 900
    assert f"900 rays with {rays.total:.6g} W" in done.out
    np.testing.assert_allclose(rays.position[:, 2], target_z(load_problem(tmp_path / "problem.toml")))
    assert json.loads((tmp_path / f"light{suffix}.json").read_text())["ok"]
    again = run(capsys, "export", result, "--light", "rear", "--rays", 900, "--out", out)
    assert again.code == 0  # its own file


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--out", "light.txt"], "choose one of .tm25ray, .dat, .ray"),
        (["--out", "light.ray", "--rays", "0"], "--rays must be from 1"),
        (["--out", "none/light.ray"], "there is no folder"),
        (["--out", "scene.xml"], "choose one of .tm25ray, .dat, .ray"),
        (["--out", "light.dat", "--format", "dat"], "leave out --format"),
        (["--out", "light.ray", "--aperture", "5", "5"], "light is that of the whole lens"),
    ],
)
def test_bad_ray_files_are_one_sentence_before_light_is_traced(
    capsys, result, tmp_path, monkeypatch, arguments, words
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("optics.interface.commands.light_export.outgoing_rays", None)
    before = {*tmp_path.iterdir()}
    assert words in refused(capsys, "export", result, "--light", "rear", *arguments)
    assert {*tmp_path.iterdir()} == before


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".ies", ".LDT"])
def test_light_of_a_lens_is_written_as_a_luminaire(capsys, result, tmp_path, suffix):
    light = 1 + np.sin(np.arange(48 * 48)).reshape(48, 48) ** 2
    np.savez(result / "irradiance.npz", irradiance=light)
    out = tmp_path / f"light{suffix}"
    done = run(capsys, "export", result, "--rays", 4000, "--step", 10, "--out", out, "--json")
    assert done.code == 0, done.err
    data = json.loads(done.out)
    assert data["ok"]
    assert data["steps_deg"] == [20.0, 10.0]
    shown = ["the lens", "this file", "steps of 10 alone", "steps of 5 alone", "steps of 0.5 alone"]
    assert list(data["on_target"]) == shown
    off = [data["on_target"][name]["rel_l2"] for name in shown]
    assert off[0] == 0 < off[4] < off[3] < off[2]
    assert read_luminaire(out).flux == pytest.approx(data["flux_w"], rel=1e-6)
    once = out.read_bytes()
    again = run(capsys, "export", result, "--rays", 4000, "--step", 10, "--out", out)
    assert "noise" in again.out
    assert "the light of one lens" in again.out
    assert f"steps of 10 alone {off[2]:.1%} off" in again.out
    (result / "irradiance.npz").unlink()
    bare = run(capsys, "export", result, "--rays", 4000, "--step", 10, "--out", out)
    assert "irradiance.npz is not in the result folder" in bare.out
    assert out.read_bytes() == once


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--step", "0"], "--step must divide 180"),
        (["--step", "nan"], "--step"),
        (["--step", "7"], "got 7"),
        (["--rays", "0"], "--rays"),
        (["--mount", "mount.toml"], "light is that of the whole lens"),
        (["--light", "rear"], "choose one of .tm25ray, .dat, .ray"),
    ],
)
def test_bad_luminaires_are_one_sentence(capsys, result, tmp_path, arguments, words):
    assert words in refused(capsys, "export", result, "--out", tmp_path / "light.ies", *arguments)
    assert not (tmp_path / "light.ies").exists()


def test_a_lens_alone_has_no_light(capsys, result, tmp_path):
    words = "export", result / "lens.json", "--light", "rear", "--out", tmp_path / "light.ray"
    assert "light needs the problem of a result folder" in refused(capsys, *words)
