"""A whole run of the command line: files, exit codes, output, the report."""

import csv
import json
import re
from html import escape, unescape
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from optics.interface.commands import main
from optics.scene.problem import load_problem
from tests.optics.cases import write_problem
from tests.optics.interface.commands.cases import FIGURES, QUICK, data_of, printed, refused, strict_json

MIRROR = """
[source]
kind = "collimated"
half_width = [9, 9]
[[element]]
kind = "mirror"
name = "M1"
tilt = [45, 0, 0]
thickness = 4
face = {half_width = [10, 14], freeform = {max_level = 0, z_freedom = 1.0}}
[target]
kind = "tophat"
position = [0, 60, 0]
tilt = [-90, 0, 0]
half_width = [15, 15]
pixels = [16, 16]
[optimizer]
start = "flat"
iterations = [3]
"""


def test_a_design_ends_well(golden):
    assert (golden.code, golden.stderr.count("Traceback")) == (0, 0)


def test_the_result_folder_holds_what_the_design_contract_says(golden):
    names = {p.name for p in golden.path.iterdir()}
    checked = {"metrics.json", "verify.json", "manufacture.json", "result.json"}
    light = {"irradiance.npz", "irradiance_16bit.png"}
    files = {"problem.toml", "lens.json", "lens.step", "history.csv", "report.html", "figures"}
    wanted = files | checked | light
    # the picture lies beside the problem file that names it; no checkpoint and no temporary file is left
    assert names == wanted | {"target.png"}
    assert {p.name for p in (golden.path / "figures").iterdir()} == {f"{name}.png" for name in FIGURES}
    for figure in (golden.path / "figures").iterdir():
        with Image.open(figure) as image:
            image.load()
            assert min(image.size) > 200


@pytest.mark.slow
def test_a_report_of_a_mirror_speaks_of_one_and_shows_it(tmp_path, capsys):
    problem = tmp_path / "mirror.toml"
    problem.write_text(MIRROR, "utf-8")
    main(["design", str(problem), "--out", str(tmp_path / "result"), "--quiet"])
    names = {p.stem for p in (tmp_path / "result" / "figures").iterdir()}
    assert names == FIGURES - {"sag", "mesh"} | {"face_sag", "face_mesh"}
    page = (tmp_path / "result" / "report.html").read_text("utf-8")
    page = unescape(re.sub(r'<iframe.*?</iframe>|<pre>.*?</pre>|src="[^"]*"', "", page, flags=re.DOTALL))
    assert "the mirror reflects 90.0%" in page
    assert "<h2>Mirror</h2>" in page
    assert not re.search("the (front|rear|lens) (that|makes|surface)|front and rear", page)


def test_the_stored_light_is_that_of_the_metrics(golden):
    with np.load(golden.path / "irradiance.npz", allow_pickle=False) as arrays:
        e, t, x, y = (arrays[name] for name in ("irradiance", "target", "x", "y"))
    metrics = strict_json((golden.path / "metrics.json").read_text())
    difference = e / e.mean() - t / t.mean()
    assert np.linalg.norm(difference) / np.linalg.norm(t / t.mean()) == pytest.approx(
        metrics["rel_l2"], rel=1e-12
    )
    pixel_area = (x[1] - x[0]) * (y[0] - y[1])
    assert e.sum() * pixel_area == pytest.approx(metrics["efficiency"], rel=1e-9)  # of a source of 1 W
    with Image.open(golden.path / "irradiance_16bit.png") as picture:
        grey = np.asarray(picture)
    assert np.abs(grey / 65535 - e / e.max()).max() < 1e-5


def test_results_go_to_stdout_and_progress_to_stderr(golden):
    data = strict_json(golden.stdout)
    assert data["metrics"] == strict_json((golden.path / "metrics.json").read_text())
    assert data["verify"] == strict_json((golden.path / "verify.json").read_text())
    assert re.search(r"level 1: \d+ DOF, \d+ evaluations, misfit 0\.\d+", golden.stderr)


def test_metrics_hold_what_the_design_contract_says(golden):
    metrics = strict_json((golden.path / "metrics.json").read_text())
    names = {
        "rel_l2",
        "psnr_db",
        "ssim",
        "rel_l2_floor",
        "efficiency",
        "stray",
        "dof",
        "levels",
        "evaluations",
        "wall_s",
        "peak_mb",
    }
    assert names <= set(metrics)
    assert {"setup", "optimise", "export", "verify", "total"} <= set(metrics["wall_s"])
    assert 0 < metrics["rel_l2_floor"] < metrics["rel_l2"] < 0.3
    assert 0.8 < metrics["efficiency"] <= 0.9216
    assert 0 <= metrics["stray"] < 0.1
    assert metrics["levels"] == 2
    assert metrics["peak_mb"] > 50
    phases = [seconds for name, seconds in metrics["wall_s"].items() if name != "total"]
    assert sum(phases) == pytest.approx(metrics["wall_s"]["total"], rel=0.2)


def test_a_design_measures_the_volume_by_the_text_and_says_what_it_leaves_out(golden, capsys):
    """OCCT's integral takes seconds on rough surfaces: `thbcad verify` computes it."""
    stored = strict_json((golden.path / "verify.json").read_text())
    assert [c["name"] for c in stored["checks"] if "volume" in c["name"]] == [
        "volume by quadrature over the text of the file against the closed form, relative"
    ]
    (sentence,) = stored["left_out"]
    assert "volume by OCCT's integral" in sentence
    assert "Left out: the volume by OCCT" in (golden.path / "report.html").read_text("utf-8")
    names = [c["name"] for c in data_of(capsys, "verify", golden.path, "--no-optiland")["checks"]]
    assert "volume by OCCT against the closed form, relative" in names


def test_the_history_is_a_table(golden):
    with (golden.path / "history.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["level", "dof", "evaluation", "loss", "fit", "stage", "fresh_fit"]
    metrics = strict_json((golden.path / "metrics.json").read_text())
    assert int(rows[-1]["evaluation"]) == metrics["evaluations"]
    assert int(rows[-1]["dof"]) == metrics["dof"]
    assert float(rows[-1]["loss"]) < float(rows[0]["loss"])


def test_the_stored_problem_is_the_problem(golden):
    """Resolved, with every key, and with a copy of the picture beside it."""
    stored, given = load_problem(golden.path / "problem.toml"), load_problem(golden.problem)
    assert stored.target.image == str(golden.path / "target.png")
    assert (golden.path / "target.png").read_bytes() == (golden.problem.parent / "picture.png").read_bytes()
    assert vars(stored) | {"target": None} == vars(given) | {"target": None}


class References(HTMLParser):
    """Collects every attribute that could fetch something, and the tags."""

    def __init__(self):
        super().__init__()
        self.links, self.tags = [], []

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.links += [
            value
            for name, value in attributes
            if name in ("src", "href", "srcset", "data", "action", "poster", "background")
        ]


def test_the_report_is_self_contained(golden):
    text = (golden.path / "report.html").read_text("utf-8")
    assert len(text.encode()) < 3e6
    text, (view,) = re.sub(r'(?<=srcdoc=")[^"]*', "", text), re.findall(r'srcdoc="([^"]*)"', text)
    inner = References()
    inner.feed(unescape(view))  # tests/optics/reporting/view says more of it
    assert inner.links == []
    page = References()
    page.feed(text)
    pictures = [link for link in page.links if link.startswith("data:image/png;base64,")]
    assert len(pictures) == len(FIGURES)
    files = [link for link in page.links if link not in pictures]
    assert {"lens.step", "irradiance.npz", "verify.json"} <= set(files)
    for name in files:
        assert (golden.path / name).is_file()
    assert not {"script", "link", "object"} & set(page.tags)
    assert page.tags.count("iframe") == 1
    assert 'sandbox="allow-scripts" srcdoc=""' in text
    without_pictures = re.sub(r"data:image/png;base64,[A-Za-z0-9+/=]+", "", text)
    assert not re.search(r"https?:|//|url\(|@import", without_pictures)
    assert str(golden.path.parent) not in text


def test_the_report_shows_figures_checks_and_problem_with_names_escaped(golden):
    text = (golden.path / "report.html").read_text("utf-8")
    assert "quick &lt;b&gt;&quot;&amp;" in text
    assert "quick <b>" not in text
    assert "the lens makes the light asked for, and the file is the lens" in text
    for check in strict_json((golden.path / "verify.json").read_text())["checks"]:
        assert escape(check["name"]) in text
    for name in set(strict_json((golden.path / "metrics.json").read_text())) - {"grade", "verdict", "notes"}:
        assert name in text
    assert "z_freedom = 1.0" in text


@pytest.mark.slow
def test_the_result_can_be_designed_again_from_its_own_problem_file(golden, tmp_path, capsys):
    again = tmp_path / "again"
    assert main(["design", str(golden.path / "problem.toml"), "--out", str(again)]) == 0
    capsys.readouterr()
    old, new = (strict_json((folder / "lens.json").read_text()) for folder in (golden.path, again))
    assert new["rear"]["sag"]["refined"] == old["rear"]["sag"]["refined"]
    # two threads add in any order: rounding, enlarged by a few steps of L-BFGS
    np.testing.assert_allclose(
        new["rear"]["sag"]["coefficients"], old["rear"]["sag"]["coefficients"], rtol=0, atol=1e-6
    )


@pytest.mark.slow
def test_text_for_people_names_the_files(tmp_path, capsys):
    problem = write_problem(tmp_path, QUICK | {"lens.rear.freeform.max_level": 0})
    out = printed(capsys, "design", problem, "--out", tmp_path / "out")
    assert "rel_l2" in out
    assert "lens.step" in out
    assert "report.html" in out
    assert "FAILED" not in out


def test_check_says_what_would_be_done(tmp_path, capsys):
    problem = write_problem(tmp_path, {"optimizer.start": "flat"})
    out = printed(capsys, "check", problem)
    assert "problem is valid" in out
    assert "level 2: 48 x 48 pixels" in out
    assert "least thickness 6 mm at x = 0, y = 0 mm" in out


def test_check_as_json(tmp_path, capsys):
    data = data_of(capsys, "check", write_problem(tmp_path))
    # plane to paraboloid: 20 x 20 x 6 plus the integral of (x^2 + y^2) / 80
    assert data["volume_mm3"] == pytest.approx(2400 + 2 * 20 * (2 * 10**3 / 3) / 80, rel=1e-12)
    assert data["least_thickness_mm"] == pytest.approx(6.0, rel=1e-15 * 8)
    assert data["target_pixels"] == [48, 48]


def test_check_writes_nothing(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    problem = write_problem(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    assert main(["check", str(problem)]) == 0
    assert sorted(tmp_path.rglob("*")) == before


def test_verify_passes_an_untouched_result(copy, capsys):
    before = {p: p.read_bytes() for p in copy.rglob("*") if p.is_file()}
    assert data_of(capsys, "verify", copy)["ok"] is True
    assert {p: p.read_bytes() for p in copy.rglob("*") if p.is_file()} == before


def test_verify_fails_a_changed_step_file(copy, capsys):
    text = (copy / "lens.step").read_text()
    number = re.search(
        r"CARTESIAN_POINT\('',\(-?\d+\.\d+,-?\d+\.\d+,\s*(\d\.\d{6})", text[text.index("B_SPLINE_SURFACE") :]
    )
    at = text.index("B_SPLINE_SURFACE") + number.end(1) - 1
    (copy / "lens.step").write_text(text[:at] + str((int(text[at]) + 1) % 10) + text[at + 1 :])
    assert main(["verify", str(copy), "--no-optiland"]) == 4
    captured = capsys.readouterr()
    assert captured.out.startswith("FAIL  file ")
    assert captured.err == ""


def test_verify_refuses_a_changed_lens_file(copy, capsys):
    data = json.loads((copy / "lens.json").read_text())
    data["rear"]["sag"]["coefficients"][5] += 1e-6
    (copy / "lens.json").write_text(json.dumps(data))
    assert "lens.json changed" in refused(capsys, "verify", copy, "--no-optiland")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("lens.step", "nonsense"),
        ("lens.json", "{"),
        ("lens.json", "[]"),
        ("lens.json", '{"schema": 1}'),
        ("problem.toml", "="),
        ("history.csv", "level,dof"),
        ("history.csv", "level,dof\n1,"),
    ],
)
def test_verify_refuses_damaged_files(copy, capsys, name, text):
    (copy / name).write_text(text)
    assert name in refused(capsys, "verify", copy)


@pytest.mark.parametrize("damage", ["refined", "knots", "coefficients", "degree", "radius", "deep"])
def test_verify_refuses_lens_files_with_wrong_contents(copy, capsys, damage):
    data = json.loads((copy / "lens.json").read_text())
    sag = data["rear"]["sag"]
    if damage == "refined":
        sag["refined"] = [[[99, 99]]]
    elif damage == "knots":
        sag["knots"][0][3] = "x"
    elif damage == "coefficients":
        sag["coefficients"] = sag["coefficients"][:-1]
    elif damage == "degree":
        sag["degree"] = 3
    elif damage == "radius":
        data["rear"]["radius"] = [1]
    text = json.dumps(data) if damage != "deep" else "[" * 100_000
    (copy / "lens.json").write_text(text)
    assert "lens.json" in refused(capsys, "verify", copy)


@pytest.mark.parametrize("name", ["lens.step", "lens.json", "problem.toml", "history.csv"])
def test_verify_refuses_a_result_with_a_missing_file(copy, capsys, name):
    (copy / name).unlink()
    assert name in refused(capsys, "verify", copy)


def test_verify_refuses_a_folder_without_result_and_a_file(tmp_path, capsys):
    assert "is not a result folder" in refused(capsys, "verify", tmp_path)
    assert "is not a result folder" in refused(capsys, "verify", tmp_path / "none")
    (tmp_path / "file").write_text("x")
    assert "is not a result folder" in refused(capsys, "verify", tmp_path / "file")


def test_verify_works_without_the_picture(copy):
    """The picture is not needed to check a solid."""
    (copy / "target.png").unlink()
    assert main(["verify", str(copy), "--no-optiland"]) == 0


@pytest.mark.slow  # a whole program
def test_a_design_that_misses_says_so_everywhere_and_ends_with_1(tmp_path, capsys):
    """With hardly any freedom the lens throws a bright square; the map's note and the verdict say why."""
    changes = QUICK | {"lens.rear.freeform.max_level": 0, "lens.rear.freeform.z_freedom": 0.01}
    problem = write_problem(tmp_path, changes | {"verify.rel_l2": 0.2})
    assert main(["design", str(problem), "--out", str(tmp_path / "out"), "--full"]) == 1
    captured = capsys.readouterr()
    metrics = strict_json((tmp_path / "out" / "metrics.json").read_text())
    record = strict_json((tmp_path / "out" / "result.json").read_text())
    assert metrics["grade"] == record["grade"] == "light misses"
    assert re.match(
        r"[\d.]+ % off: the light misses what was asked for: rel_l2, without noise", metrics["verdict"]
    )
    (asked,) = [sentence for sentence in metrics["notes"] if "the transport map asks for a sag" in sentence]
    assert asked in captured.err
    assert metrics["verdict"] in captured.out
    assert f"thbcad check {tmp_path / 'out' / 'problem.toml'} names what binds" in captured.out
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    assert metrics["verdict"] in page
    assert asked in page
    assert (record["ok"], record["verdict"], record["notes"]) == (False, metrics["verdict"], metrics["notes"])
