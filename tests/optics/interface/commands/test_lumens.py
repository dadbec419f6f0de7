"""A source in lumens: no command speaks of watts, and files say lm, lx and cd."""

import json
import re

import numpy as np
import pytest

from optics.interface.commands.cli import main
from optics.scene.ray_files import read_rays
from tests.optics.cases import DOME, write_problem
from tests.optics.interface.commands.cases import FIGURES, QUICK, data_of, in_full, refused

FAR = {
    "source.flux": 800.0,
    "source.unit": "lm",
    "target.kind": "tophat",
    "target.distance": np.inf,
    "target.half_width": [30.0, 25.0],
}
WATTS = re.compile(r"\bW\b")


def printed(capsys, *arguments):
    assert main(in_full(arguments)) in (0, 1)  # a few iterations may miss the light
    return capsys.readouterr().out


@pytest.mark.slow
def test_a_trace_prints_lumens_and_writes_candela(capsys, stored):
    folder = stored(FAR)
    out = printed(capsys, "trace", folder, "--rays", 33)
    assert re.search(r"^ *\d+\.\d{6} lm +\d+ rays  leaves by the rear and meets the target$", out, re.M)
    assert not WATTS.search(out)
    data = json.loads((folder / "trace" / "trace.json").read_text())
    assert sum(data["fates_lm"].values()) == pytest.approx(800, rel=1e-12)
    assert {"polar.png", "isocandela.png"} < set(data["sha256"])
    with np.load(folder / "trace" / "irradiance.npz") as arrays:
        assert str(arrays["unit"]) == "lm/degree^2"
    assert "fates_lm" in data_of(capsys, "trace", folder, "--rays", 33)


def test_light_in_lumens_is_exported_in_lumens(capsys, stored, tmp_path):
    out = tmp_path / "light.ray"
    command = "export", stored(FAR), "--light", "rear", "--rays", 1000, "--out", out
    text = printed(capsys, *command)
    assert re.search(r"rays with \d+\.?\d* lm over all faces", text)
    rays = read_rays(out)
    assert rays.unit == "lm"
    assert 700 < rays.total < 800
    assert json.loads((tmp_path / "light.ray.json").read_text())["flux_lm"] == rays.total


@pytest.mark.slow
def test_etendue_bounds_lumens_and_lux(capsys, problem_file):
    changes = DOME | {"source.unit": "lm", "source.flux": 100.0}
    path = problem_file(changes, drop=("target.image",))
    out = printed(capsys, "etendue", path)
    assert " lm  meet the front of the base lens" in out
    assert re.search(r"at most \S+ lm reach the target, at most \S+ lm the pixels .* more than \S+ lx", out)
    assert not WATTS.search(out)
    data = data_of(capsys, "etendue", path)
    assert data["flux_lm"]["source"] == 100
    assert {"on_target_lm", "on_lit_lm"} < set(data["universal"])


def test_a_lens_that_passes_nothing_is_refused_in_lumens(capsys, problem_file, no_helpers):
    closed = problem_file({"source.unit": "lm", "lens.rear.radius": 0.3, "target.distance": 1000.0})
    assert "lm of 1 lm pass the unoptimised lens" in refused(capsys, "design", closed)


def test_another_unit_is_refused(capsys, problem_file):
    message = refused(capsys, "check", problem_file({"source.unit": "cd"}))
    assert "source.unit must be one of 'W', 'lm', got 'cd'" in message


@pytest.mark.slow
def test_a_design_in_lumens_reports_its_beam(capsys, tmp_path):
    path = write_problem(tmp_path, QUICK | FAR | {"target.half_width": [15.0, 12.0]})
    out = printed(capsys, "design", path, "--out", tmp_path / "result")
    assert re.search(r"^peak intensity \S+ cd \(\S+ cd/klm\); beam angle .* in C90-C270$", out, re.M)
    assert re.search(r"^uniformity .* cd", out, re.M)
    names = {p.stem for p in (tmp_path / "result" / "figures").iterdir()}
    assert names == FIGURES | {"polar", "isocandela"}
    page = (tmp_path / "result" / "report.html").read_text("utf-8")
    assert "cd/klm" in page
    assert not WATTS.search(re.sub(r'src="data[^"]*"|srcdoc="[^"]*"', "", page))
