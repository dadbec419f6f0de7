"""`thbcad tool`: files, exit codes, refusals in one sentence."""

import pytest

from optics.exchange.results import sha256_of
from optics.interface.commands.cli import main
from optics.reporting import figures as pictures
from optics.scene.problem import load_problem
from tests.optics.cases import small_lens, store_result, write_problem
from tests.optics.interface.commands.cases import data_of, printed, refused, strict_json


@pytest.fixture
def result(tmp_path):
    """A result whose rear is a bowl of radius 40 mm."""
    return store_result(tmp_path / "result", load_problem(write_problem(tmp_path)), small_lens()).path


@pytest.mark.slow
def test_a_nose_that_fits_leaves_record_page_and_picture(capsys, result):
    before = sha256_of(result / "result.json")
    words = ["tool", str(result), "--nose", "2", "--feed", "0.02", "--acceleration", "5"]
    told = data_of(capsys, *words)
    folder = result / "tool"
    kept = strict_json((folder / "tool.json").read_text("utf-8"))
    shown = {"tool.html", "tool_rear.png"}
    assert kept.pop("sha256") == {name: sha256_of(folder / name) for name in shown}
    assert kept == told
    assert {p.name for p in folder.iterdir()} == {"tool.json", *shown}
    assert kept["surfaces"]["rear"]["least_concave_radius_mm"]["value"] == pytest.approx(40, rel=1e-3)
    assert "draft angle" in (folder / "tool.html").read_text("utf-8")
    assert sha256_of(result / "result.json") == before


@pytest.mark.slow
def test_text_record_and_page_say_the_same_of_polishing_and_cutting(capsys, result):
    lines = printed(capsys, "tool", result, "--ball", "2", "--step", "0.5").splitlines()
    page = (result / "tool" / "tool.html").read_text("utf-8")
    found = strict_json((result / "tool" / "tool.json").read_text("utf-8"))["surfaces"]["rear"]
    polish, rows = found["cusps"]["polish"], found["rows"]
    assert polish["needed"]
    (cutting,) = (line for line in lines if line.startswith("one pass over the rear"))
    assert (
        f"{rows['rows']} rows, {rows['length_m']:.0f} m of cutting, and takes {rows['hours']:.3g} hours"
        in cutting
    )
    for line in (polish["why"], cutting):
        assert line in lines
        assert f"<li>{line}</li>" in page


@pytest.mark.slow
def test_a_picture_of_an_earlier_tool_does_not_stay(result, monkeypatch):
    def figures(findings):
        return [(f"tool_{surface.name}.png", "", b"png") for surface in findings.surfaces]

    monkeypatch.setattr(pictures, "figures_of_tool", figures, raising=False)
    folder = result / "tool"
    for words, shown in (
        (["--ball", "2"], {"tool_rear.png"}),
        ([], set()),
        (["--ball", "2"], {"tool_rear.png"}),
    ):
        assert main(["tool", str(result), *words]) == 0
        assert {p.name for p in folder.iterdir()} == {"tool.json", "tool.html", *shown}


@pytest.mark.slow
def test_the_same_tool_leaves_the_same_bytes(result):
    kept = []
    for _ in range(2):
        assert main(["tool", str(result), "--nose", "2"]) == 0
        kept.append({p.name: p.read_bytes() for p in (result / "tool").iterdir()})
    assert kept[0] == kept[1]


def test_a_ball_that_does_not_fit_is_a_failed_check(capsys, result, tmp_path):
    lines = printed(capsys, "tool", result, "--ball", "41", "--out", tmp_path / "out", code=4).splitlines()
    assert any(line.startswith("a ball end of 41 mm does not fit the rear for certain") for line in lines)
    assert any(line.startswith("FAILED a ball end of 41 mm on the rear") for line in lines)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--ball", "1", "--nose", "1"], "not allowed with argument"),
        (["--ball", "-1"], "ball must be a positive number of mm"),
        (["--ball", "nan"], "ball must be a positive number of mm"),
        (["--ball", "wide"], "invalid float value"),
        (["--nose", "1", "--step", "0.1"], "step goes with a ball"),
        (["--rpm", "10"], "rpm goes with a nose"),
    ],
)
def test_bad_tools_are_one_sentence(capsys, result, words, sentence):
    assert sentence in refused(capsys, "tool", result, *words)
    assert not (result / "tool").exists()


def test_files_of_others_are_not_replaced(capsys, result):
    (result / "tool").mkdir()
    (result / "tool" / "tool.html").write_text("mine")
    assert "would be replaced" in refused(capsys, "tool", result, "--ball", "1")
    assert (result / "tool" / "tool.html").read_text() == "mine"
