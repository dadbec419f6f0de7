"""What a design's files say and keep: metadata, limits and titles arrive, damage to the solid is caught, from
outside."""

import json
import re
import shutil
from types import SimpleNamespace

import pytest

from optics.exchange.results import ResultFolder
from optics.interface.commands.cli import main
from optics.scene.problem import load_problem
from optics.scene.system import lens_product
from tests.optics.cases import write_problem
from tests.optics.interface.commands.cases import data_of, printed, refused, strict_json
from thbcad.cad.exchange import read_step

BRIEF = {
    "optimizer.iterations": [2],
    "lens.rear.freeform.max_level": 0,
    "target.pixels": [16, 16],
    "verify.rays": 17,
}
NAMED = BRIEF | {
    "lens.material": "PMMA (Plexiglas® 7N)",
    "lens.density": 1.19,
    "export.schema": "AP214",
    "export.product": "Linse 'ä' (透镜)",
    "export.author": "Jürgen O'Neill; #1",
    "export.organization": "Optik \\ 光学 GmbH",
}


def designed(folder, changes):
    """Design a lens; return its folder and the exit code."""
    code = main(["design", str(write_problem(folder, changes)), "--out", str(folder / "result"), "--full"])
    return SimpleNamespace(path=folder / "result", code=code)


@pytest.fixture(scope="module")
def named(tmp_path_factory):
    """A design with every word that goes into its files."""
    return designed(tmp_path_factory.mktemp("named"), NAMED)


@pytest.fixture
def copy(named, tmp_path):
    """A copy of the named design that a test may spoil."""
    return shutil.copytree(named.path, tmp_path / "copy")


# Metadata


@pytest.mark.slow
def test_the_names_of_a_design_arrive_in_its_step_file(named):
    assert named.code == 0
    step = read_step(named.path / "lens.step")
    assert (step.schema, step.author, step.organization) == (
        "AP214",
        NAMED["export.author"],
        NAMED["export.organization"],
    )
    assert (step.product, step.material) == (NAMED["export.product"], NAMED["lens.material"])
    assert step.face_names == ("front", "rear", "edge -y", "edge +x", "edge +y", "edge -x")
    text = (named.path / "lens.step").read_text("ascii")
    assert "refractive index 1.5" in text
    assert re.search(r"MEASURE\(\s*1\.19\)", text)


@pytest.mark.slow
def test_the_names_survive_verify_and_export(copy, tmp_path, capsys):
    assert main(["verify", str(copy), "--no-optiland"]) == 0
    assert main(["export", str(copy), "--out", str(tmp_path / "again.step")]) == 0
    assert (tmp_path / "again.step").read_bytes() == (copy / "lens.step").read_bytes()
    assert main(["export", str(copy), "--out", str(tmp_path / "cut.step"), "--aperture", "5", "5"]) == 0
    step = read_step(tmp_path / "cut.step")
    assert (step.product, step.material, step.author) == (
        NAMED["export.product"],
        NAMED["lens.material"],
        NAMED["export.author"],
    )
    assert "the cut costs " in capsys.readouterr().out
    report = json.loads((tmp_path / "cut.step.json").read_text("utf-8"))
    assert 0.5 < report["cut_cost"]["through"] < 0.9


@pytest.mark.parametrize(
    ("key", "value", "word"),
    [("author", "someone else", "author"), ("schema", "AP242", "schema"), ("product", "other", "name")],
)
def test_a_step_file_under_another_name_is_caught(copy, capsys, key, value, word):
    """The names are part of what a fresh export gives."""
    path = copy / "problem.toml"
    path.write_text(re.sub(rf"(?m)^{key} = .*$", f'{key} = "{value}"', path.read_text("utf-8")), "utf-8")
    lines = printed(capsys, "verify", copy, "--no-optiland", code=4).splitlines()
    failures = [line for line in lines if line.startswith("FAILED")]
    assert len(failures) == 1
    assert failures[0].startswith(f"FAILED text of the file: words that are not those of the problem ({word}")


def test_a_problem_that_is_not_that_of_the_lens_is_refused(copy, capsys):
    path = copy / "problem.toml"
    path.write_text(re.sub(r"(?m)^thickness = .*$", "thickness = 7.0", path.read_text("utf-8")), "utf-8")
    assert "problem.toml changed since the run" in refused(capsys, "verify", copy, "--no-optiland")


def test_a_file_with_other_line_ends_passes_with_a_note(copy, capsys):
    path = copy / "lens.step"
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    said = printed(capsys, "verify", copy, "--no-optiland")
    assert "note: the text of the STEP file differs from a fresh export" in said


TITLES = [
    "\"quoted\" and 'single'",
    "Größe für Übung",
    "珍珠耳环的少女",
    "two\nlines\r\nand\ttabs",
    " blanks ",
    "\u2028",
    "bell\x07\x00",
    "a" * 5000,
]


@pytest.mark.parametrize("title", TITLES, ids=ascii)
def test_a_title_becomes_one_line_in_the_step_file(tmp_path, title):
    problem = load_problem(write_problem(tmp_path, {"title": title}))
    assert lens_product(problem).name == (" ".join(re.sub("[\x00\x07]", " ", title).split())[:500] or "lens")


@pytest.mark.slow
def test_a_design_of_any_title_ends_well(tmp_path, capsys):
    title = "\"Größe\"\n'透镜' \\ */ ; bell\x07"
    done = designed(tmp_path, BRIEF | {"title": title})
    assert done.code == 0
    assert load_problem(done.path / "problem.toml").title == title
    assert read_step(done.path / "lens.step").product == " ".join(title.replace("\x07", " ").split())
    assert main(["verify", str(done.path), "--no-optiland"]) == 0
    capsys.readouterr()


def test_the_longest_names_arrive_in_iges_and_longer_ones_are_refused(copy, tmp_path, capsys):
    """From 2000 characters on OCCT's IGES writer ends the process."""
    path = copy / "problem.toml"
    for count, code in ((500, 0), (501, 2), (5000, 2)):
        text = re.sub(
            r"(?m)^(product|author|organization) = .*$", rf'\1 = "{"a" * count}"', path.read_text("utf-8")
        )
        path.write_text(text, "utf-8")
        assert main(["export", str(copy), "--out", str(tmp_path / "named.iges")]) == code
    assert "must have at most 500 characters" in capsys.readouterr().err


# Limits


LIMITS = {"limits.edge_thickness": 50.0, "limits.slope": 1.0, "limits.mass": 0.1, "lens.density": 1.19}


@pytest.mark.slow
def test_limits_that_a_design_misses_end_it_with_1_and_say_where(tmp_path, capsys):
    """The lens is 6 mm thick on the axis and bends by up to 19.5 degrees."""
    done = designed(tmp_path, BRIEF | LIMITS)
    assert done.code == 4
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("FAILED")]
    assert [re.sub(r"(, at|: ).*", "", line) for line in lines] == [
        "FAILED edge thickness short of limits.edge_thickness",
        "FAILED slope of the rear beyond limits.slope",
        "FAILED mass beyond limits.mass",
    ]
    assert all(re.search(r", at x = -?[\d.]+, y = -?[\d.]+ mm: ", line) for line in lines[:2])
    stored = strict_json((done.path / "verify.json").read_text())
    assert [c["name"] in (done.path / "report.html").read_text("utf-8") for c in stored["checks"]]
    assert sum(not c["ok"] for c in stored["checks"]) == 3
    # the solid itself is sound, and verify fails for the same reasons
    said = printed(capsys, "verify", done.path, "--no-optiland", code=4).splitlines()
    assert [line for line in said if line.startswith("FAILED")] == lines


@pytest.mark.slow
def test_check_notes_limits_that_the_base_lens_misses(tmp_path, capsys):
    assert main(["check", str(write_problem(tmp_path, LIMITS)), "--full"]) == 0
    notes = [
        line for line in capsys.readouterr().out.splitlines() if line.startswith("note: before optimisation")
    ]
    assert len(notes) == 3
    assert all(
        word in line for word, line in zip(("limits.edge_thickness", "limits.slope", "limits.mass"), notes)
    )


def test_the_workshops_figures_are_strict_json(named):
    data = strict_json((named.path / "manufacture.json").read_text())
    lens = ResultFolder(named.path).read_lens()
    assert data["mass_g"] == pytest.approx(lens.volume() * 1.19e-3, rel=1e-15 * 4)
    assert data["volume_mm3"] == lens.volume()
    assert data["front"]["concave_radius_mm"]["value"] is None  # a plane
    assert data["thickness_mm"]["lower"] <= data["thickness_mm"]["value"] <= data["thickness_mm"]["upper"]


# Damage


def failures(capsys, folder):
    """Return the names of the checks of `verify` that fail; it ends without a message then."""
    code = main(["verify", str(folder), "--no-optiland", "--json"])
    captured = capsys.readouterr()
    assert (code, captured.err) == (4, "")
    return {c["name"] for c in strict_json(captured.out)["checks"] if not c["ok"]}


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_bytes_of_another_file_are_refused_or_caught(copy, capsys, share):
    path = copy / "lens.step"
    data = bytearray(path.read_bytes())
    at = int(share * len(data))
    data[at : at + 64] = bytes(range(64))
    path.write_bytes(data)
    code = main(["verify", str(copy), "--no-optiland"])
    captured = capsys.readouterr()
    assert code in (1, 2)
    assert len(captured.err.splitlines()) == code - 1


def test_results_of_verify_are_strict_json_with_every_check_named_once(named, capsys):
    names = [c["name"] for c in data_of(capsys, "verify", named.path, "--no-optiland")["checks"]]
    assert len(set(names)) == len(names) > 25
    assert json.loads((named.path / "verify.json").read_text())["ok"]


@pytest.mark.slow  # it loads optiland
def test_optiland_traces_the_file_beside_the_other_checks(golden, capsys):
    pytest.importorskip("optiland")
    checks = data_of(capsys, "verify", golden.path)["checks"]
    found = [check for check in checks if "optiland" in check["name"]]
    assert len(found) == 3
    assert all(check["ok"] for check in found)
