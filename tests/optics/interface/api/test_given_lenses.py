"""Lenses that are there already: their light, as of a design, from files of other programs."""

from dataclasses import replace

import build123d as bd
import numpy as np
import pytest

import optics
from optics.interface.commands import main
from optics.interface.relighting import given_system
from optics.light.analysis import delivery_checks, judged
from optics.scene.problem import load_problem
from tests.optics.cases import small_lens, small_space, write_problem
from tests.optics.interface.commands.cases import refused
from tests.optics.tolerancing.perturbations.cases import few
from tests.thbcad.cad.foreign.cases import Meridian, RoundLens
from tests.thbcad.io.cases import written
from thbcad import FreeformSurface, Lens, read_lens_solid, to_build123d, write_lens, write_step
from thbcad.sags import Conic
from thbcad.surfaces import THBSurface

# a beam well within the rim; a top hat, whose verdict knows no rays
ROUND = {"source.profile": "round", "source.half_width": [7.0, 7.0], "target.kind": "tophat"}
FEW = ROUND | {"target.pixels": [12, 12]}
WAVY = 0.02 * np.sin(np.arange(small_space().dim))
WAVY -= THBSurface(small_space(), WAVY)(0.0, 0.0)  # the vertex of the file is that of the lens


@pytest.fixture(scope="module")
def foreign(tmp_path_factory):
    """A lens, and the STEP file of it that was trimmed, chamfered and turned in another program."""
    lens = small_lens(sag=WAVY, space=small_space())
    trimmed = to_build123d(lens) & bd.Cylinder(9, 100)
    rims = [edge for edge in trimmed.edges() if edge.length > 50]
    path = tmp_path_factory.mktemp("foreign") / "part.step"
    bd.export_step(bd.Pos(3, 4, 5) * bd.Rot(20, 35, 0) * bd.chamfer(rims, 0.25), path)
    return lens, path


@pytest.mark.slow
def test_a_lens_of_another_program_makes_the_light_of_its_surfaces(foreign, tmp_path):
    lens, path = foreign
    problem = load_problem(write_problem(tmp_path, FEW))
    given = optics.Design.of_lens(problem, read_lens_solid(path).refit(lens.index).lens)
    own = optics.System(problem).measure(lens)
    assert given.problem.lens.outline == "ellipse"
    assert given.problem.lens.thickness == pytest.approx(lens.thickness, abs=1e-9)
    np.testing.assert_allclose(given.irradiance, own.irradiance, atol=1e-8 * own.irradiance.max())
    assert given.metrics["evaluations"] == 0
    sun = optics.System(problem.with_(**{"source.divergence": 1.0})).measure(lens)
    relit = given.relight(problem.with_(**{"source.divergence": 1.0}).source)
    assert relit.metrics["rel_l2"] == pytest.approx(sun.metrics["rel_l2"], rel=1e-6)
    budget = optics.tolerances(given, few(given.system, **{"lens.decentre_x": 0.1}), limit=0.02)
    assert all(np.isfinite(effect.tolerance.amount) for effect in budget.effects)


@pytest.mark.slow
def test_a_lens_of_two_spheres_has_a_free_rear_of_zeros(tmp_path, backend):
    """A problem needs a free surface; the light of the lens does not change."""
    problem = load_problem(write_problem(tmp_path, ROUND))
    size = (10.0, 10.0)
    lens = Lens(
        FreeformSurface(size, Conic(60.0), corners=size),
        FreeformSurface(size, Conic(-45.0), corners=size),
        6.0,
        1.6,
    )
    given = optics.Design.of_lens(problem, lens)
    assert given.problem.lens.index == 1.6
    assert given.problem.lens.rear.radius == -45.0
    np.testing.assert_array_equal(given.lens.rear.sag.coefficients, 0.0)
    exact = -45.0 + np.sqrt(45.0**2 - 25.0)
    assert float(given.lens.rear(3.0, 4.0)) == pytest.approx(exact, abs=1e-12)
    assert given.metrics["efficiency"] > 0.8


def test_rounded_outlines_and_what_is_none_of_a_problem_file(tmp_path):
    problem = load_problem(write_problem(tmp_path, ROUND))

    def lens(*sizes):
        return Lens(*(FreeformSurface(h, Conic(), corners=c) for h, c in sizes), 6.0, 1.5)

    both = optics.Design.of_lens(problem, lens(((10, 10), (2, 2)), ((5, 5), (1, 1))))
    assert (both.problem.lens.outline, both.problem.lens.corner_radius) == ("rounded", 2.0)
    with pytest.raises(optics.UserError, match="is none that a problem file knows"):
        optics.Design.of_lens(problem, lens(((10, 10), (2, 3)), ((10, 10), (2, 3))))
    with pytest.raises(optics.UserError, match="a mirror, of index 1, is given"):
        optics.Design.of_lens(problem, replace(lens(((10, 10), (2, 2)), ((5, 5), (1, 1))), index=1.0))


@pytest.mark.slow
def test_a_folder_of_a_lens_that_is_there_serves_every_command(foreign, tmp_path, capsys):
    lens, path = foreign
    toml, folder = write_problem(tmp_path, ROUND), tmp_path / "given"
    assert main(["design", str(toml), "--lens", str(path), "--out", str(folder)]) in (0, 1)
    for words in (
        ["verify", str(folder), "--no-optiland"],
        ["relight", str(folder), "--source", "sun"],
        ["tolerance", str(folder)],
        ["tool", str(folder), "--ball", "2"],
    ):
        assert main(words) in (0, 1), words
    write_lens(lens, tmp_path / "own.json")
    assert main(
        ["design", str(toml), "--lens", str(tmp_path / "own.json"), "--out", str(tmp_path / "own")]
    ) in (0, 1)


def test_a_step_file_where_a_result_is_wanted_is_told_the_way(foreign, capsys, tmp_path):
    _, path = foreign
    for command in (["relight", "--source", "sun"], ["tolerance"], ["tool"]):
        sentence = refused(capsys, command[0], path, *command[1:])
        assert f"thbcad design PROBLEM.toml --lens {path}" in sentence
    toml = write_problem(tmp_path, ROUND)
    assert "--resume, --from and --live" in refused(capsys, "design", toml, "--lens", path, "--resume")
    (tmp_path / "no.step").write_text("no")
    assert "no.step" in refused(capsys, "design", toml, "--lens", tmp_path / "no.step")
    assert f"{tmp_path / 'lens.json'}" in refused(capsys, "design", toml, "--lens", tmp_path)


def bare_problem(folder, text=""):
    """Write a problem that says nothing of the shape of the lens, nor of the light."""
    path = folder / "bare.toml"
    path.write_text(f'source = {{ kind = "collimated", half_width = [6.0, 6.0] }}\n{text}')
    return path


@pytest.fixture(scope="module")
def halves(tmp_path_factory):
    """A lens of two spheres of 40 and 60 mm in half faces."""
    path = tmp_path_factory.mktemp("halves") / "theirs.step"
    return written(RoundLens(Meridian(40.0), Meridian(-60.0), 6.0, 10.0).solid(2).wrapped, path)


@pytest.mark.parametrize(("turn", "radii"), [(False, (40.0, -60.0)), (True, (60.0, -40.0))])
def test_a_lens_gives_what_its_problem_leaves_out(halves, tmp_path, capsys, turn, radii):
    problem = bare_problem(tmp_path, "lens.index = 1.5")
    system = given_system(problem, {}, halves, turn)
    lens = system.designed
    spec, target = system.problem.lens, system.problem.target
    assert (spec.thickness, *spec.front.half_width) == pytest.approx((6, 10, 10), abs=1e-9)
    assert (lens.front.conic.radius, lens.rear.conic.radius) == pytest.approx(radii, abs=1e-9)
    assert target.distance == pytest.approx(100, rel=1e-9)
    # of a lens with f = 48.5 mm the beam of 12 x 12 mm is 13 mm wide there
    assert 6 < target.half_width[0] < 9
    assert "so that no light is requested" in capsys.readouterr().err
    with pytest.raises(optics.UserError, match=r"the key target\.kind is missing"):
        given_system(problem, {"target.distance": 60.0}, halves, turn)


@pytest.fixture(scope="module")
def plano_convex(tmp_path_factory):
    """A plano-convex lens of radius 20 mm and diameter 10 mm whose sphere has its pole on the rear."""
    solid = bd.Pos(0, 0, 5) * bd.Cylinder(5, 10) & bd.Pos(0, 0, -16.5) * bd.Sphere(20)
    return written(solid.wrapped, tmp_path_factory.mktemp("plano") / "plano.step")


def test_a_weak_lens_without_a_target_is_not_refused_for_light_that_nobody_wants(
    plano_convex, tmp_path, capsys
):
    """f = 40 mm: the beam of 12 x 12 mm, 10 x 10 mm at the lens, is 2.5 mm wide 50 mm after it."""
    system = given_system(bare_problem(tmp_path, "lens.index = 1.5"), {}, plano_convex, False)
    lens = system.designed
    assert lens.rear.conic.radius == pytest.approx(-20, abs=1e-9)
    assert system.problem.target.distance == pytest.approx(50, rel=1e-9)
    assert 1 < system.problem.target.half_width[0] < 2.5
    said = capsys.readouterr().err
    assert f"note: {plano_convex}: the front is a plane, which the file's face meets within" in said
    assert "Refit(" not in said


def test_limits_of_the_user_hold_without_a_target(halves, tmp_path):
    problem = bare_problem(tmp_path, "lens.index = 1.5\nverify.rsd = 0.3")
    system = given_system(problem, {"verify.stray": 0.01}, halves, False)
    limits = system.problem.verify
    assert (limits.stray, limits.rsd, limits.lit_efficiency, limits.min_over_mean) == (0.01, 0.3, 0.0, 0.0)
    with pytest.raises(optics.UserError, match="verify is a value, no table"):
        given_system(bare_problem(tmp_path, "lens.index = 1.5\nverify = 3"), {}, halves, False)


def test_a_lens_without_an_index_is_asked_for_it(halves, tmp_path):
    with pytest.raises(optics.UserError, match=r"lens\.index"):
        given_system(bare_problem(tmp_path), {}, halves, False)


def test_only_a_step_file_is_turned(tmp_path, capsys):
    toml = write_problem(tmp_path, ROUND)
    write_lens(small_lens(), tmp_path / "own.json")
    assert "--turn takes a STEP file" in refused(
        capsys, "design", toml, "--lens", tmp_path / "own.json", "--turn"
    )
    assert "--turn turns the lens of --lens" in refused(capsys, "design", toml, "--turn")


def test_no_light_is_judged_where_none_was_requested(halves, tmp_path):
    system = given_system(bare_problem(tmp_path, "lens.index = 1.5"), {}, halves, False)
    checks = delivery_checks(
        {"rel_l2_debiased": 0.9, "lit_efficiency": 0.1, "stray": 0.5}, system.problem.verify
    )
    assert checks == []
    verdict = judged({"efficiency": 0.922}, checks, of_file=False)
    assert (verdict.grade, str(verdict)) == (
        "made",
        "92.2% of the light arrives on the target: no limit of the light is set",
    )


def test_the_target_stays_where_the_problem_puts_it(tmp_path, capsys):
    """The rear of a design's own STEP file begins where its sag does: 0.3 mm before its vertex."""
    sag = THBSurface(small_space(), np.full(small_space().dim, -0.3))
    lens = small_lens(sag=sag.coefficients, space=small_space())
    toml = write_problem(tmp_path, FEW)
    write_step(lens, tmp_path / "lens.step")
    problem = load_problem(toml)
    system = given_system(toml, {}, tmp_path / "lens.step", False)
    read = system.designed
    place = problem.lens.thickness + problem.target.distance
    assert read.thickness == pytest.approx(problem.lens.thickness - 0.3, abs=1e-9)
    assert system.problem.lens.thickness + system.problem.target.distance == pytest.approx(place, abs=1e-9)
    assert "the target stays in its place" in capsys.readouterr().err


def test_a_design_of_a_system_for_scripts_names_what_makes_one(tmp_path):
    problem = load_problem(write_problem(tmp_path))
    with pytest.raises(optics.UserError, match=r"got Problem; optics.Design.of_lens\(problem, lens\) makes"):
        optics.Design(problem)


@pytest.mark.parametrize(
    ("changes", "help"),
    [
        (
            {"stop": [{"shape": "rectangle", "half_width": [20, 20], "position": [0, 0, -1], "hole": False}]},
            "blocks",
        ),
        (
            {"target.distance": False, "target.position": [120.0, 0.0, 150.0]},
            "make the target larger or nearer",
        ),
    ],
)
def test_where_no_light_arrives_it_is_said_what_helps(tmp_path, changes, help):
    design = optics.Design.of_lens(load_problem(write_problem(tmp_path, FEW)).with_(**changes), small_lens())
    assert design.metrics["efficiency"] == 0
    (said,) = (note for note in design.notes if note.startswith("no light reaches the target; "))
    assert help in said
