"""A whole design from a script: shaped, measured, saved, read back, verified, shown; the same bytes again."""

import json
import os
import subprocess
import sys
from hashlib import sha256

import numpy as np
import pytest

import optics
from optics.base.runtime import ProgressEvent
from optics.interface.api import design_run
from optics.interface.api.design_result import Design
from optics.scene.problem import load_problem
from tests.cases import ROOT
from tests.optics.cases import THREADS, front_problem, on_threads, write_problem
from thbcad import write_lens

QUICK = {"target.kind": "tophat", "optimizer.iterations": [4], "lens.rear.freeform.max_level": 1}


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """(Design, the moments of its progress, the folder that it was saved to)."""
    folder = tmp_path_factory.mktemp("design")
    moments = []
    design = optics.design(load_problem(write_problem(folder, QUICK)), progress=moments.append)
    return design, moments, design.save(folder / "result")


def test_progress_tells_every_phase_and_ends_with_the_whole(done):
    _, moments, _ = done
    assert all(isinstance(moment, ProgressEvent) for moment in moments)
    assert {"setup", "start surface", "level 1"} <= {moment.phase for moment in moments}
    assert moments[-1].fraction == 1.0


def test_the_lens_makes_the_light_that_the_design_tells(done):
    design, _, _ = done
    measured = optics.System(design.problem).measure(design.lens)
    assert design.metrics["rel_l2"] == measured.metrics["rel_l2"]
    assert design.irradiance.tobytes() == measured.irradiance.tobytes()
    assert design.metrics["evaluations"] == design.history[-1].evaluation
    assert design.metrics["dof"] == design.lens.rear.sag.space.dim


def test_a_saved_design_is_read_back_as_it_was(done):
    design, _, folder = done
    loaded = optics.Design.load(folder)
    image = {"target.image": loaded.problem.target.image}  # the folder holds it
    assert loaded.problem == design.problem.with_(**image)
    assert loaded.irradiance.tobytes() == design.irradiance.tobytes()
    assert loaded.target.tobytes() == design.target.tobytes()
    assert np.array_equal(loaded.lens.rear.sag.coefficients, design.lens.rear.sag.coefficients)
    assert [(r.level, r.evaluation, r.loss) for r in loaded.history] == [
        (r.level, r.evaluation, r.loss) for r in design.history
    ]
    assert {k: loaded.metrics[k] for k in design.metrics} == design.metrics
    assert list(loaded.notes) == list(design.notes)
    assert loaded.started_from_transport == design.started_from_transport


def test_a_design_is_saved_below_the_current_folder(done, tmp_path, monkeypatch):
    """Also by a helper process that was begun in another one, as `verify` begins one and keeps it."""
    design, _, _ = done
    design.verify()
    monkeypatch.chdir(tmp_path)
    folder = design.save("result")
    assert (tmp_path / "result" / "lens.step").is_file()
    assert not folder.is_absolute()


def test_a_tool_is_tried_on_the_lens(done):
    design, _, _ = done
    (surface,) = design.tool(optics.ToolOrder(ball=5.0, step=0.1)).surfaces
    assert (surface.name, surface.pitch) == ("rear", 0.1)


def test_the_solid_is_verified_before_anything_of_its_light_is_drawn(done, tmp_path, monkeypatch):
    """A run that fails behind it leaves the solid and what is claimed of it, and no result."""
    design, _, _ = done

    def full(*_):
        raise OSError("full")

    monkeypatch.setattr("optics.interface.api.design_figures.DesignFigures.draw_light", full)
    with pytest.raises(OSError, match="full"):
        design.save(tmp_path)
    claims = json.loads((tmp_path / "verify.json").read_text("utf-8"))
    assert claims["ok"]
    assert claims["step_sha256"] == sha256((tmp_path / "lens.step").read_bytes()).hexdigest()
    assert not {"metrics.json", "report.html", "result.json"} & set(os.listdir(tmp_path))
    assert not [name for name in os.listdir(tmp_path) if name.startswith(".lens.step")]


def test_the_saved_folder_is_a_whole_result(done):
    _, _, folder = done
    record = json.loads((folder / "result.json").read_text())
    assert record["ok"]
    assert {"lens.step", "report.html", "verify.json", "metrics.json"} <= set(record["sha256"])


def test_another_problem_in_the_folder_is_not_replaced_unasked(done):
    _, _, folder = done
    other = optics.Design.load(folder)
    varied = other.problem.with_(title="another")
    with pytest.raises(optics.UserError, match="another problem"):
        Design(optics.System(varied).with_lens(other.lens)).save(folder)


def test_verify_checks_file_and_light(done):
    design, _, _ = done
    checked = design.verify()
    assert checked["ok"]
    names = " ".join(check["name"] for check in checked["checks"])
    assert "rear face" in names
    assert "uniformity U0 = E_min / E_mean" in names
    assert checked["grade"] == design.verdict.grade == "made"


@pytest.mark.slow
def test_it_shows_itself_without_touching_the_scripts_plots(done):
    design, _, _ = done
    html = design._repr_html_()
    assert "data:image/png;base64," in html
    assert "rel_l2" in html
    assert len(html) < 200_000
    assert design.plot()._repr_png_().startswith(b"\x89PNG")
    view = design.view()
    assert "srcdoc=" in view._repr_html_()
    assert "<html" in view.page.lower()
    assert repr(design).startswith("Design('small'")


@pytest.mark.slow
def test_a_design_is_a_scene_that_mitsuba_loads(done):
    mi = pytest.importorskip("mitsuba")
    design, _, _ = done
    scene = optics.mitsuba_scene(design)
    loaded = mi.load_dict(scene)
    assert {"front", "rear", "edges", "screen"} <= {shape.id() for shape in loaded.shapes()}
    with pytest.raises(optics.UserError, match="mitsuba_scene takes a Design"):
        optics.mitsuba_scene(design.problem)


def test_an_interrupt_gives_back_the_best_lens_so_far(tmp_path):
    seen = []

    def stop(moment):
        seen.append("evaluations" in moment.detail)
        if sum(seen) == 5:
            raise KeyboardInterrupt

    problem = load_problem(write_problem(tmp_path, QUICK | {"optimizer.iterations": [40]}))
    design = optics.design(problem, progress=stop)
    assert design.interrupted
    assert "stopped by Ctrl-C: this is the best lens so far" in design.notes
    best = min(row.loss for row in design.history)
    assert np.isfinite(best)
    assert design.metrics["rel_l2"] < 0.5


def test_an_interrupt_before_any_level_goes_on(tmp_path):
    def stop(moment):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        optics.design(load_problem(write_problem(tmp_path, QUICK)), progress=stop)


@pytest.mark.parametrize(
    ("precision", "of_all", "of_drawn"),
    [("mixed", np.float64, np.float32), ("double", np.float64, None), ("single", np.float32, None)],
)
def test_a_design_is_traced_in_the_precision_asked_for(tmp_path, monkeypatch, precision, of_all, of_drawn):
    engines, real = [], design_run.shape_lens

    def watched(system, backend, engine, *others):
        engines.append(engine)
        return real(system, backend, engine, *others)

    monkeypatch.setattr(design_run, "shape_lens", watched)
    optics.design(load_problem(write_problem(tmp_path, QUICK | {"run.precision": precision})))
    (engine,) = engines
    assert (engine.backend.dtype, engine.of_drawn and engine.of_drawn.dtype) == (of_all, of_drawn)


def test_import_optics_loads_nothing_heavy():
    program = "import sys, optics; print([m for m in ('numpy', 'scipy', 'drjit') if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


@pytest.mark.slow
def test_a_front_alone_is_designed_stored_and_verified(tmp_path):
    plane = {"lens.rear.radius": float("inf"), "lens.rear.conic": 0.0}
    made = optics.design(front_problem(tmp_path, plane))
    assert made.lens.rear.is_plane
    assert made.metrics["rel_l2_sequential"] < 0.1
    assert made.metrics["rel_l2"] < 0.15  # with the light that the bent front sends into the edges
    assert sum(made.metrics["fates_w"].values()) == pytest.approx(1.0, abs=1e-12)
    folder = made.save(tmp_path / "result")
    assert "freeform = false" in (folder / "problem.toml").read_text("utf-8")
    again = optics.Design.load(folder)
    assert again.problem.lens == made.problem.lens
    assert again.lens.rear.sag is None
    np.testing.assert_array_equal(again.lens.front.sag.coefficients, made.lens.front.sag.coefficients)
    assert made.verify()["ok"]


@pytest.mark.slow
def test_what_is_left_to_the_program_is_found_for_a_front_alone(tmp_path):
    """The bound of its sag and its finest level; the map asks for no more than the bound."""
    auto = {"lens.front.freeform.z_freedom": "auto", "lens.front.freeform.max_level": "auto"}
    problem = optics.System(front_problem(tmp_path, auto)).problem
    front = problem.lens.front.freeform
    assert 0.5 < front.z_freedom < 3.0
    assert 3 <= front.max_level <= 6
    assert problem.lens.rear.freeform is None


GLOWING = {
    "source.kind": "lambertian",
    "source.half_width": [0.5, 0.5],
    "source.half_angle": 30.0,
}
POINT = {"source.kind": "point", "source.half_angle": 40.0, "source.distance": 8.0}
FEW = {"target.pixels": [64, 64], "lens.rear.freeform.max_level": 2, "optimizer.iterations": [5]}
FEWER = {
    "target.pixels": [32, 32],
    "lens.rear.freeform.max_level": 1,
    "optimizer.iterations": [3],
    "optimizer.finish": 2,
    "optimizer.rays_per_pixel": 6.0,
}
EXAMPLES = {
    "pearl": FEW,
    "point": FEW,
    "extended": FEWER,
    "extended_two": FEWER | {"lens.front.freeform.max_level": 1},
}


def designed(problem, threads, folder):
    """Return the bytes of the file of the lens that a problem is solved by."""
    design = on_threads(threads, optics.design, problem.with_(**{"run.threads": threads}))
    write_lens(design.lens, folder / "lens.json")
    return (folder / "lens.json").read_bytes()


@pytest.mark.every(2)
@pytest.mark.parametrize(
    "changes",
    [{}, GLOWING, pytest.param(POINT, marks=pytest.mark.slow)],
    ids=["parallel", "extended", "point"],
)
def test_a_small_design_has_the_same_bytes_on_one_and_two_threads(tmp_path, changes):
    """Of 32^2 pixels, with enough rays for several threads."""
    few = {"target.pixels": [32, 32], "lens.rear.freeform.max_level": 1, "optimizer.iterations": [3]}
    problem = optics.load_problem(write_problem(tmp_path, few | {"optimizer.rays_per_pixel": 8.0} | changes))
    assert len({designed(problem, threads, tmp_path) for threads in (1, 2)}) == 1


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_have_the_same_bytes_on_any_number_of_threads_and_again(tmp_path, monkeypatch, name):
    """With fewer pixels and levels, and fewer rays by other ways than front and rear: still enough for
    several threads, and for replicates after the first two."""
    monkeypatch.setattr("optics.light.analysis.closed_lens_light.RAYS", (192, 192))
    monkeypatch.setattr("optics.designing.optimisation.level_objective.REPLICATES", 3)
    problem = optics.load_problem(ROOT / "examples" / f"{name}.toml").with_(**EXAMPLES[name])
    assert len({designed(problem, threads, tmp_path) for threads in (*THREADS, 2)}) == 1
