"""`thbcad tolerance`: a page and numbers beside a result, whose own files stay what they are."""

import json
from html import unescape
from types import SimpleNamespace

import pytest

from optics.base.runtime import UserError
from optics.exchange.results import sha256_of
from optics.interface.api import Design
from optics.interface.commands import tolerance_command
from optics.tolerancing.perturbations import tolerances_of
from tests.optics.interface.commands.cases import raising, refused, run


@pytest.mark.slow
def test_a_result_gets_a_page_of_its_tolerances(capsys, copy, tmp_path):
    names = [t.name for t in tolerances_of(Design.load(copy).system)]
    amounts = tmp_path / "shop.toml"
    rest = "\n".join(f'"{name}" = 0' for name in names if name not in ("index", "lens.decentre_x"))
    amounts.write_text(f"{rest}\nindex = 0.002\n", "utf-8")
    before = {file: sha256_of(file) for file in copy.iterdir() if file.is_file()}
    words = ["tolerance", copy, "--tolerances", amounts, "--set", "lens.decentre_x=0.03", "--json"]
    words += ["--limit", "0.01", "--limit", "efficiency=0.5", "--float-shift"]
    done = run(capsys, *words)
    assert done.code == 0
    data = json.loads(done.out)
    assert {n: row["amount"] for n, row in data["tolerances"].items()} == {
        "index": 0.002,
        "lens.decentre_x": 0.03,
    }
    assert data["limits"] == {"rel_l2": pytest.approx(data["rel_l2"] + 0.01), "efficiency": 0.5}
    assert data["shift_floats"]
    page = (copy / "tolerance.html").read_text("utf-8")
    assert "What shop and mount must hold" in page
    # the costs, two changes of the light, the allowed form error and a map of it on either side
    assert page.count("<img ") == 6
    assert {*data["form_error"]["sides"]} == {"front", "rear"}
    assert all(sentence in unescape(page) for sentence in data["form_error"]["sentences"])
    record = json.loads((copy / "tolerance.json").read_text("utf-8"))
    assert record["tolerances"] == data["tolerances"]
    assert record["sha256"] == {"tolerance.html": sha256_of(copy / "tolerance.html")}
    assert {file: sha256_of(file) for file in before} == before
    assert run(capsys, *words).code == 0  # what it wrote itself, it replaces
    again = json.loads((copy / "tolerance.json").read_text("utf-8"))
    assert again["tolerances"] == record["tolerances"]
    (copy / "tolerance.html").write_text("mine", "utf-8")
    assert "--force" in refused(capsys, *words)


def test_tolerances_are_kept_where_form_errors_fail(capsys, copy, tmp_path, monkeypatch):
    monkeypatch.setattr(tolerance_command, "form_tolerances", raising(UserError("no light")))
    names = [t.name for t in tolerances_of(Design.load(copy).system)]
    amounts = tmp_path / "shop.toml"
    amounts.write_text("\n".join(f'"{name}" = 0' for name in names if name != "index"), "utf-8")
    done = run(capsys, "tolerance", copy, "--tolerances", amounts)
    assert done.code == 0
    record = json.loads((copy / "tolerance.json").read_text("utf-8"))
    assert [*record["tolerances"]] == ["index"]
    assert record["form_error"] == {"sentences": ["form errors could not be computed: no light"]}


@pytest.mark.parametrize(
    ("paths", "noise", "array", "starts"),
    [
        ("sequential", 0.0, None, []),
        ("sequential", 0.18, None, ["Fewer rays are counted here"]),
        (
            "all",
            0.18,
            "plate",
            ["These are tolerances of one", "Light that is reflected", "Fewer rays are counted here"],
        ),
    ],
)
def test_rel_l2_of_counted_rays_is_told_beside_the_reports(paths, noise, array, starts):
    metrics = {"paths": paths, "rel_l2_debiased": 0.07, "rel_l2_sequential": 0.0687}
    problem = SimpleNamespace(optic=SimpleNamespace(array=array))
    design = SimpleNamespace(metrics=metrics, problem=problem)
    budget = SimpleNamespace(rel_l2=0.0712, noise=noise)
    said = tolerance_command._Study(design, budget, None, "", None).beside_the_report()
    assert [sentence[: len(start)] for sentence, start in zip(said, starts, strict=True)] == starts
    assert all("6.87%" in one and "7.12%" in one for one in said[-1:])


def test_progress_has_one_phase_however_many_lenses_there_are(monkeypatch):
    """Its time would grow by the square of their number, were each lens a phase."""
    moments = []

    class Drawing:
        __call__ = staticmethod(moments.append)

        def close(self):
            pass

    monkeypatch.setattr(tolerance_command, "drawing", lambda stream: Drawing())
    with tolerance_command._Shown("lenses") as shown:
        for done in range(1, 9):
            shown.advance(done, 8, f"{done} of 8")
    assert {moment.phase for moment in moments} == {"lenses"}
    assert [moment.detail for moment in moments[:-1]] == [f"{done} of 8" for done in range(1, 9)]
    fractions = [moment.fraction for moment in moments]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--set", "lens.decenter=1"], "did you mean lens.decentre"),
        (["--set", "index"], "NAME=AMOUNT"),
        (["--limit", "-1"], "limit must be"),
        (["--limit", "much"], "--limit takes a rise of rel_l2"),
        (["--limit", "efficiency="], "--limit takes a rise of rel_l2"),
        (["--limit", "u0=0.7"], "there is no limit 'u0'"),
        (
            ["--limit", "efficiency=0.85", "--limit", "min_over_mean=0.7"],
            "the light asked for is not uniform",
        ),
        (["--tolerances", "none.toml"], "none.toml"),
        (["--tolerances", "/dev/zero"], "/dev/zero is larger than the 1,048,576 bytes allowed"),
        (["--tolerances", "lens.toml"], "lens.toml: title must be a number from 0, got 'small'; a file of"),
        (["--tolerances", "less.toml"], "less.toml: rear.form must be a number from 0, got -1.5"),
        (["--samples", "100"], "8 times a power of two"),
        (["--samples", "-8"], "the number of samples"),
        (["--samples", "16", "--periods", "5:2"], "band of periods must rise"),
        (["--samples", "16", "--set", "rear.form=-1"], "the rms of a form error"),
        (["--samples", "16", "--set", "side.form=1"], '"front" or "rear"'),
        (["--samples", "16", "--workers", "0"], "the number of workers"),
        (["--workers", "2"], "go with --samples"),
        (["--periods", "20:2"], "--periods goes with --samples"),
        (["--periods", "2:20"], "--periods goes with --samples"),
    ],
)
def test_bad_amounts_are_one_sentence(capsys, golden, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lens.toml").write_text("title = 'small'\nlens.index = 1.5\n")
    (tmp_path / "less.toml").write_text("index = 1e-4\nrear.form = -1.5\n")
    assert words in refused(capsys, "tolerance", golden.path, "--out", tmp_path / "new", *arguments)
