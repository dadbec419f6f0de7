"""The command line with a glowing picture, two free surfaces and a far-field target."""

import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from optics.designing.etendue import universal_bound
from optics.interface.commands.cli import main
from optics.scene.luminaires import Opening, write_ldt
from optics.scene.problem import load_problem
from optics.scene.system import System
from tests.optics.cases import write_problem
from tests.optics.interface.commands.cases import FIGURES, printed, run, strict_json
from tests.optics.scene.luminaires.cases import asymmetric

EXTENDED = {
    "title": "extended",
    "source.kind": "lambertian",
    "source.half_width": [0.5, 0.5],
    "source.half_angle": 50.0,
    "source.profile": "image",
    "source.image": "glow.png",
    "lens.thickness": 10.0,
    "lens.front.freeform.spans": [3, 3],
    "lens.front.freeform.max_level": 1,
    "lens.front.freeform.z_freedom": 0.5,
    "lens.rear.freeform.spans": [3, 4],
    "lens.rear.freeform.max_level": 1,
    "target.distance": np.inf,
    "target.half_width": [40.0, 40.0],
    "target.pixels": [24, 24],
    "optimizer.iterations": [3],
    "optimizer.rays_per_pixel": 1.0,
    "verify.rel_l2": 1.0,
}


# figures of two free surfaces, of a far field, and of light that may meet edges
MORE = {"front_sag", "front_mesh", "polar", "isocandela", "rays_1", "rays_2"}


def write_extended(folder, changes=None, drop=()):
    """Write a problem with a glowing picture, two free surfaces and a far-field target; return its path."""
    Image.fromarray(np.array([[50, 100], [150, 200]], dtype=np.uint8)).save(folder / "glow.png")
    return write_problem(folder, EXTENDED | (changes or {}), drop=drop)


@pytest.fixture(scope="module")
def extended(tmp_path_factory):
    """A whole run of the extended problem: its result folder and exit code."""
    folder = tmp_path_factory.mktemp("extended")
    code = main(["design", str(write_extended(folder)), "--out", str(folder / "result")])
    return SimpleNamespace(path=folder / "result", code=code, given=folder / "problem.toml")


@pytest.mark.slow
def test_a_luminaire_designs_a_lens_whose_report_says_what_is_assumed(tmp_path):
    write_ldt(asymmetric(Opening((2.0, 1.0))), tmp_path / "lamp.ldt")
    source = {"source.kind": "luminaire", "source.file": "lamp.ldt", "source.flux": 0}
    drop = ("source.half_width", "source.half_angle", "source.profile", "source.image")
    given = write_extended(tmp_path, source, drop)
    # a few iterations may miss the light
    assert main(["design", str(given), "--out", str(tmp_path / "result")]) in (0, 1)
    resolved = load_problem(tmp_path / "result" / "problem.toml").source
    assert resolved.half_width == (1.0, 0.5)
    assert resolved.flux == pytest.approx(asymmetric().flux, rel=1e-6)
    assert Path(resolved.file).read_bytes() == (tmp_path / "lamp.ldt").read_bytes()
    fates = strict_json((tmp_path / "result" / "metrics.json").read_text())["fates_w"]
    assert sum(fates.values()) == pytest.approx(resolved.flux, rel=1e-12)
    report = (tmp_path / "result" / "report.html").read_text()
    assert "the same intensity from every point of the luminaire&#x27;s opening is assumed" in report


@pytest.mark.slow
def test_an_extended_problem_ends_well_too(extended):
    assert extended.code in (0, 1)  # a few iterations may miss the light
    assert {p.stem for p in (extended.path / "figures").iterdir()} == FIGURES | MORE
    metrics = strict_json((extended.path / "metrics.json").read_text())
    lens = strict_json((extended.path / "lens.json").read_text())
    assert metrics["dof"] == sum(len(lens[name]["sag"]["coefficients"]) for name in ("front", "rear"))
    assert metrics["levels"] == 2
    assert sum(metrics["fates_w"].values()) == pytest.approx(1.0, abs=1e-9)
    assert metrics["fates_w"]["unresolved"] == 0
    allowed = universal_bound(System(load_problem(extended.path / "problem.toml")))
    assert metrics["rel_l2_by_etendue"] == allowed.least_rel_l2(metrics["efficiency"])
    assert strict_json((extended.path / "verify.json").read_text())["ok"] is True
    page = (extended.path / "report.html").read_text("utf-8")
    assert page.count("data:image/png;base64,") == len(FIGURES | MORE)


@pytest.mark.slow
def test_an_extended_result_is_verified_where_it_lies_and_elsewhere(extended, tmp_path, capsys):
    """The folder holds all that its problem file names."""
    assert main(["verify", str(extended.path)]) == 0
    moved = shutil.copytree(extended.path, tmp_path / "moved")
    stored = load_problem(moved / "problem.toml")
    for picture_file in (stored.target.image, stored.source.image):
        assert picture_file.startswith(str(moved))
    assert main(["verify", str(moved), "--no-optiland"]) == 0


@pytest.mark.slow
def test_an_extended_run_starts_from_an_earlier_design(extended, tmp_path, capsys):
    out = tmp_path / "out"
    done = run(capsys, "design", extended.given, "--out", out, "--from", extended.path, "--json")
    assert done.code == 0
    metrics = strict_json(done.out)["metrics"]
    before = strict_json((extended.path / "metrics.json").read_text())
    assert metrics["dof"] == before["dof"]
    assert metrics["rel_l2"] < 1.05 * before["rel_l2"]


@pytest.mark.slow
def test_check_adds_the_freedoms_of_both_surfaces(tmp_path, capsys):
    """Least thickness 10 mm; only together do 5.5 and 5 mm exceed it."""
    for on_front, noted in ((4.0, False), (5.5, True)):
        changes = {"lens.front.freeform.z_freedom": on_front, "lens.rear.freeform.z_freedom": 5.0}
        said = printed(capsys, "check", write_extended(tmp_path, changes))
        assert ("z_freedom is larger than the least thickness" in said) == noted
