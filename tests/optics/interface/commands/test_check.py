"""What `thbcad check` prints."""

import math
import re

import pytest

import optics
from optics.interface.commands.cli import main
from optics.scene.keys import assignment
from optics.scene.problem import Problem, load_problem
from tests.cases import ROOT
from tests.optics.cases import write_problem
from tests.optics.interface.commands.cases import data_of, printed, refused


@pytest.mark.slow
def test_check_explains_what_is_skipped_only_when_asked(tmp_path, capsys):
    path = str(write_problem(tmp_path, {"lens.density": 1.2}))
    brief = printed(capsys, "check", path)
    full = printed(capsys, "check", path, "--explain")
    assert "skips the search" in full
    assert "skip" not in brief
    for word in (" g; rear with", "z_freedom allows", "rel_l2: ", "of index", "of ripple", "of decentre"):
        assert word in brief


@pytest.mark.slow
def test_check_does_not_know_how_far_light_misses_a_face(tmp_path, capsys):
    path = str(write_problem(tmp_path, {"source.half_width": [12, 9.5]}))
    assert main(["check", path, "--full"]) == 0
    said = "loses no light: front at least 10 x 9.5 mm of 10 x 10, rear at least 10 x 9.5 mm of 10 x 10"
    assert said in capsys.readouterr().out


@pytest.mark.slow
def test_check_says_how_small_the_lens_may_be_and_what_is_blocked(tmp_path, capsys):
    """The beam of 19 mm is parallel to the rear; the clear aperture leaves 8/9.5 of it each way."""
    path = str(write_problem(tmp_path, {}))
    assert main(["check", path, "--full"]) == 0
    wide = "least half-width that loses no light: front 9.5 x 9.5 mm of 10 x 10, rear 9.5 x 9.5 mm of 10 x 10"
    said = capsys.readouterr().out
    assert wide in said
    assert "blocked" not in said
    found = data_of(capsys, "check", path, "--set", "lens.clear_aperture=[8, 8]")["expected"]
    assert found["blocked"] == pytest.approx(1 - (8 / 9.5) ** 2, abs=1e-5)
    assert found["least"]["rear"] == pytest.approx([8, 8], rel=1 / 256)  # corners of cells
    stop = 'stop=[{shape="ellipse", half_width=[6, 6], position=[0, 0, -1]}]'
    assert main(["check", path, "--set", stop, "--full"]) == 0
    share = 1 - math.pi * 36 / 19**2
    assert f"{share:.1%} blocked by stop.0\n" in capsys.readouterr().out


@pytest.mark.slow
def test_check_warns_of_a_freedom_that_was_given_not_of_one_that_was_left_to_it(tmp_path, capsys):
    """Both are greater than the least thickness of 0.5 mm."""
    path = str(write_problem(tmp_path, {"lens.thickness": 0.5, "target.half_width": [40.0, 40.0]}))
    for freedom, warned in (("1.0", True), ("auto", False)):
        main(["check", path, "--set", f"lens.rear.freeform.z_freedom={freedom}", "--full"])
        said = capsys.readouterr()
        assert ("z_freedom is larger than the least thickness" in said.out) == warned, said


@pytest.mark.slow
def test_check_asks_whether_lengths_of_a_tiny_lens_or_target_are_in_mm(tmp_path, capsys):
    path = str(write_problem(tmp_path, {}))
    for changes, asked in (
        ([], []),
        (["target.half_width=[0.05, 0.05]"], ["target"]),
        ([f"{face}.half_width=[0.02, 0.02]" for face in ("source", "lens.front", "lens.rear")], ["lens"]),
    ):
        options = [word for change in changes for word in ("--set", change)]
        said = printed(capsys, "check", path, *options)
        assert re.findall(r"note: the (\w+) is [\d.]+ mm wide; every length is in mm", said) == asked


def test_a_freedom_that_reaches_the_target_is_refused_with_one_that_does_not(tmp_path, capsys):
    path, key = str(write_problem(tmp_path, {})), "lens.rear.freeform.z_freedom"
    assert main(["check", path, "--set", f"{key}=1e6", "--full"]) == 2
    most = float(re.search(r"or make z_freedom less than ([\d.]+) mm", capsys.readouterr().err)[1])
    assert main(["check", path, "--set", f"{key}={most - 0.1}", "--full"]) == 0


@pytest.mark.slow
def test_check_names_one_remedy_for_a_steep_surface_that_z_freedom_cuts_off(tmp_path, capsys):
    """Half of a far field is 50 degrees wide; the rear bends light by less than 48.2."""
    wide = {"target.kind": "tophat", "target.distance": math.inf, "target.half_width": [50.0, 50.0]}
    path = str(write_problem(tmp_path, wide | {"lens.thickness": 20.0, "lens.rear.freeform.z_freedom": 3.0}))
    said = printed(capsys, "check", path).partition("\nNotes\n")[2]
    assert "no z_freedom helps" in said
    assert "reflected at the rear, which bends it far" in said
    assert said.count("--set 'target.half_width=") == 1


@pytest.mark.slow
def test_check_says_by_what_light_is_blocked(tmp_path, capsys):
    """A bar of 3 % of a beam of 19 mm; it and a clear aperture leave the product of what each leaves."""
    bar = 'stop=[{name="bar", shape="rectangle", half_width=[0.285, 30], position=[3, 0, -1], hole=false}]'
    path = str(write_problem(tmp_path, {}))
    found = data_of(capsys, "check", path, "--set", bar)["expected"]
    assert found["blocked"] == pytest.approx(0.03, abs=5e-5)
    assert found["blocking"] == {"stop.bar": found["blocked"]}
    assert main(["check", path, "--full", "--set", bar, "--set", "lens.clear_aperture=[9.5, 8]"]) == 0
    left = 8 / 9.5
    assert (
        f"{1 - 0.97 * left:.1%} blocked by the clear aperture ({1 - left:.1%} alone), stop.bar (3.0% alone)\n"
        in capsys.readouterr().out
    )


def test_check_tells_what_material_and_colours_cost(tmp_path, capsys):
    """0.001 of index moves the light by some mm, so that the accuracy and the dispersion of PC move it by
    multiples of that."""
    changes = {"lens.material": "PC", "source.spectrum": [[450, 1], [650, 1]]}
    path = str(write_problem(tmp_path, changes, drop=("lens.index",)))
    lines = printed(capsys, "check", path).splitlines()
    (plain,) = (x for x in lines if x.startswith("0.001 of index shifts"))
    (grade,) = (x for x in lines if x.startswith("PC: another grade or melt may differ by 0.006"))
    (colours,) = (x for x in lines if x.startswith("from 450 to 650 nm the index falls by 0.0287"))
    shifts = [float(x.partition(" the light by ")[2].split()[0]) for x in (plain, grade, colours)]
    assert [s / shifts[0] for s in shifts] == pytest.approx([1, 6, 28.7], rel=0.05)  # two digits are printed


def test_an_illuminant_may_be_named_on_the_command_line(tmp_path, capsys):
    path = str(write_problem(tmp_path, {"lens.material": "PMMA"}, drop=("lens.index",)))
    assert "the index falls by" in printed(capsys, "check", path, "--set", "source.spectrum=LED-B1")
    assert main(["check", path, "--set", "source.spectrum=F11", "--full"]) == 2
    assert "source.spectrum must be a list of rows, such as" in capsys.readouterr().err


@pytest.mark.slow
def test_check_says_where_light_is_hottest_and_warns_of_fire(tmp_path, capsys):
    path = str(write_problem(tmp_path, {}))
    calm = printed(capsys, "check", path)
    assert "greatest concentration of light: " in calm
    assert "at the start of the design" in calm
    assert "fire" not in calm
    focus = ["lens.rear.radius=-40", "lens.rear.conic=-2.25", "target.half_width=[1, 1]"]
    focus = [word for change in (*focus, "target.distance=80") for word in ("--set", change)]
    data = data_of(capsys, "check", path, *focus)
    found = data["expected"]["concentration"]
    assert found["times"] == found["sunlight"] > 50
    assert 0 < found["behind"] <= found["searched"] == 80
    assert data["fire"].startswith("light that may start a fire: ")
    assert f"note: {data['fire']}" in printed(capsys, "check", path, *focus)


ASIDE = {"target.distance": False, "target.position": [44.0, 0.0, 66.0], "target.tilt": [0.0, 45.0, 0.0]}


@pytest.mark.slow
def test_check_says_which_share_a_rear_reflects_that_bends_light_far(tmp_path, capsys):
    """Up to 46 degrees behind a plane front, where a surface of index 1.5 bends by less than 48.2."""
    free = {"lens.rear.radius": math.inf, "lens.thickness": 12.0, "lens.rear.freeform.z_freedom": 11.0}
    path = str(write_problem(tmp_path, free | ASIDE | {"target.kind": "tophat"}))
    assert main(["check", path, "--full"]) == 0
    said = re.search(
        r"note: (\d+)% of the light is reflected at the rear, which bends it far, and ([\d.]+)% totally; "
        r"at most 10% are with --set '(target\.position=.*?)', or let both surfaces bend it",
        out := capsys.readouterr().out,
    )
    assert "rel_l2: not predicted off the axis, or on a curve; the start has" in out
    assert "\nlight asked for " in out  # a top hat is no picture
    assert said is not None
    assert 20 < int(said[1]) < 60
    assert 0 < float(said[2]) < int(said[1])
    found = data_of(capsys, "check", path, "--set", said[3])["expected"]
    assert 0.075 < found["reflected"] < 0.085
    assert found["nearest"] == []


@pytest.mark.slow
def test_the_place_that_check_proposes_makes_the_light_that_total_reflection_forbade(tmp_path, capsys):
    """The pearl, 170 mm aside, on a screen turned to a lens that bends light at its rear alone."""
    problem = load_problem(ROOT / "examples" / "pearl.toml").with_(
        **ASIDE
        | {
            "target.position": [170.0, 0.0, 340.0],
            "target.half_width": [100.0, 100.0],
            "target.pixels": [32, 32],
        }
        | {"lens.thickness": 60.0, "lens.rear.freeform.z_freedom": "auto", "lens.rear.freeform.max_level": 2}
        | {"optimizer.iterations": [15], "verify.rays": 65}
    )
    (tmp_path / "c1.toml").write_text(problem.to_toml(), "utf-8")
    path = str(tmp_path / "c1.toml")
    expected = data_of(capsys, "check", path)["expected"]
    assert expected["reflected"] > 0.2
    assert expected["totally"] > 0
    (option,) = expected["nearest"]
    change = option.removeprefix("--set ").strip("'")
    assert "reflected at the rear" not in printed(capsys, "check", path, "--set", change)
    forbidden = optics.design(load_problem(path))
    made = optics.design(load_problem(path, dict([assignment(change, Problem)])))
    assert (forbidden.verdict.grade, made.verdict.grade) == ("light misses", "made")
    assert made.metrics["rel_l2"] < 0.1
    assert made.metrics["fates_w"]["rear_reflected"] < 0.1
    assert made.metrics["fates_w"]["total_internal"] == 0


def test_a_target_along_the_light_is_refused(capsys):
    changes = ("target.tilt=[0, 0, 0]", "target.pixels=[16, 16]")
    words = [word for change in changes for word in ("--set", change)]
    assert "the target is seen edge-on" in refused(capsys, "check", ROOT / "examples" / "folded.toml", *words)


@pytest.mark.slow
def test_bounds_by_etendue_are_left_out_where_they_do_not_hold_and_that_is_said(tmp_path, capsys):
    lamp = {"source.kind": "lambertian", "source.half_width": [0.5, 0.5], "source.distance": 4.0}
    path = str(write_problem(tmp_path, lamp | {"target.surface": "sphere", "target.radius": 90.0}))
    sentence = "etendue bounds the light of one lens on planes and in the far field; no bound is given of a "
    for command in ("check", "etendue"):
        assert printed(capsys, command, path).count(sentence) == 1
    found = data_of(capsys, "etendue", path)
    assert found["etendue_mm2_sr"]["target"] is None
    assert "universal" not in found


@pytest.mark.slow
def test_light_of_a_spectrum_is_foreseen_in_all_its_wavelengths(tmp_path, capsys, coarse_concentration):
    """Half of it is absorbed by exp(-0.5 d), and none at the wavelength of the design."""
    absorbing = {
        "source.spectrum": [[450.0, 1.0], [550.0, 1.0]],
        "lens.indices": [[450.0, 1.5], [550.0, 1.5]],
        "lens.absorptions": [[450.0, 0.5], [550.0, 0.0]],
    }
    found = []
    for changes in ({}, absorbing):
        found.append(data_of(capsys, "check", write_problem(tmp_path, changes))["expected"]["efficiency"])
    thickness = load_problem(tmp_path / "problem.toml").lens.thickness
    left = (1 + math.exp(-0.5 * thickness)) / 2
    assert found[1] / found[0] == pytest.approx(left, rel=0.03)  # on the axis: other ways are longer


@pytest.mark.slow
def test_check_says_how_far_light_is_diffracted_where_that_matters(tmp_path, capsys):
    """lambda L / D of 19 mm at 10 km; at 60 mm it is a hundredth of a pixel."""
    path = str(write_problem(tmp_path, {"lens.rear.freeform.z_freedom": 5.0}))
    far = "target.distance=1e7", "target.half_width=[500, 500]", "target.pixels=[48, 48]"
    words = [word for key in far for word in ("--set", key)]
    found = data_of(capsys, "check", path, *words)["diffraction"]
    assert found["blur"] == pytest.approx(550e-6 * 1e7 / 19, rel=1e-3)
    assert "diffraction: light of 550 nm" in printed(capsys, "check", path, *words)
    assert "diffraction" not in data_of(capsys, "check", path, "--set", "target.pixels=[16, 16]")
