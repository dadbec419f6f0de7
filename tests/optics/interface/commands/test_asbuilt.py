"""`thbcad asbuilt`: a measured file becomes a lens and its light; nothing that is not ours is replaced."""

import json
from pathlib import Path

import numpy as np
import pytest

from optics.exchange.results import ResultFolder, sha256_of
from optics.interface.commands.cli import main
from tests.optics.cases import write_problem
from tests.optics.interface.commands.cases import data_of, printed, refused
from thbcad.cad import read_step
from thbcad.io import read_lens


def measured(folder: Path, lens, errors: float = 5e-4) -> Path:
    """Write points of the rear with a wave of 8 mm, heights in um."""
    rear = lens.rear
    x, y = np.random.default_rng(2).uniform(-0.98, 0.98, (2, 2500)) * np.reshape(rear.half_width, (2, 1))
    heights = rear(x, y) + errors * np.sin(2 * np.pi * x / 8)
    path = folder / "measured.csv"
    np.savetxt(path, np.column_stack([x, y, 1e3 * heights]), delimiter=",", header="x,y,z", comments="")
    return path


@pytest.mark.slow  # 20 traces, and as many for the re-positioning
def test_a_measured_file_becomes_a_lens_and_its_light(capsys, golden, tmp_path) -> None:
    lens = ResultFolder(golden.path).read_lens()
    file, out = measured(tmp_path, lens), tmp_path / "made"
    options = ["asbuilt", golden.path, "--measured", file, "--height-unit", "um", "--out", out]
    data = data_of(capsys, *options)
    assert data["points"] == 2500
    assert data["change"] > 1e-3
    assert data["alignments"]["datums"]["rms_mm"] == pytest.approx(5e-4 / np.sqrt(2), rel=0.05)
    assert data["re_positioning"]["rel_l2_after"] <= data["re_positioning"]["rel_l2_before"]
    record = json.loads((out / "asbuilt.json").read_text("utf-8"))
    assert {n: sha256_of(out / n) for n in record["sha256"]} == record["sha256"]
    made = read_lens(out / "lens.json")
    assert made.rear([1.7], [0.3])[0] - lens.rear([1.7], [0.3])[0] == pytest.approx(
        5e-4 * np.sin(2 * np.pi * 1.7 / 8), abs=2e-5
    )
    # its own files are replaced
    assert "aligned by best fit" in printed(capsys, *options, "--align", "best-fit")
    (out / "light.png").write_bytes(b"somebody else's")
    assert "light.png" in refused(capsys, *options)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "--measured"),
        (["--measured", "none.xyz"], "cannot read none.xyz"),
        (["--measured", "none.xyz", "--unit", "inch"], "--unit"),
        (["--measured", "none.xyz", "--turn", "45"], "--turn"),
    ],
)
def test_bad_options_are_refused(capsys, golden, tmp_path, monkeypatch, arguments, words) -> None:
    monkeypatch.chdir(tmp_path)
    assert words in refused(capsys, "asbuilt", golden.path, "--out", tmp_path / "made", *arguments)


def test_a_wrong_unit_is_said(capsys, golden, tmp_path) -> None:
    file = measured(tmp_path, ResultFolder(golden.path).read_lens())
    out = refused(
        capsys, "asbuilt", golden.path, "--measured", file, "--unit", "m", "--out", tmp_path / "made"
    )
    assert "is the unit right (--unit)" in out


@pytest.mark.slow  # a design
def test_the_step_of_a_plate_holds_all_its_lenses(tmp_path) -> None:
    plate = {"lens.array.columns": 2, "lens.array.rows": 1, "lens.array.pitch": 25.0, "lens.thickness": 8.0}
    few = {"optimizer.iterations": [1], "lens.rear.freeform.max_level": 0, "target.pixels": [16, 16]}
    problem = write_problem(tmp_path, plate | few)
    main(["design", str(problem), "--out", str(tmp_path / "result")])
    system = ResultFolder(tmp_path / "result").read().system
    words = ["--measured", measured(tmp_path, system.designed), "--height-unit", "um", "--step"]
    main(["asbuilt", str(tmp_path / "result"), *map(str, words)])
    volume = read_step(tmp_path / "result" / "asbuilt" / "lens.step").volume
    assert volume == pytest.approx(system.made.volume(), rel=1e-3)
    assert volume > 2 * system.designed.volume()
