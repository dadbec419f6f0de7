"""The light behind sliders: against the tolerance code, and against other problems measured afresh."""

import math
import sys
from dataclasses import replace

import pytest
from nbclient import NotebookClient
from nbformat.v4 import new_code_cell, new_notebook

import optics
from optics import UserError
from optics.interface.relighting.explored_light import Explorer
from optics.interface.relighting.slider_box import light_html
from optics.light.analysis import measure
from optics.scene.problem import load_problem
from optics.scene.system import solvable_system
from optics.tolerancing.perturbations import tolerance_budget, tolerances_of
from tests.optics.cases import write_problem
from thbcad.doors import MissingPackage

AMOUNTS = {"lens.decentre_x": 0.3, "lens.tilt_y": 1.5, "index": 0.01, "target.defocus": 4.0}
POINT = {"source.kind": "point", "source.half_width": [0.0, 0.0], "source.distance": 40.0}
LED = POINT | {"source.kind": "lambertian", "source.half_width": [0.5, 0.5], "source.half_angle": 20.0}
EVEN = {"target.kind": "tophat", "target.lit": [0.5, 0.5]}


def system_of(folder, changes=None):
    return solvable_system(load_problem(write_problem(folder, changes)))


def explorer_of(system, backend, pixels=48):
    return Explorer(system, backend, pixels)


@pytest.mark.parametrize(
    "name", [n if n == "target.defocus" else pytest.param(n, marks=pytest.mark.slow) for n in AMOUNTS]
)
def test_light_is_that_of_the_tolerance_code(tmp_path, backend, name):
    """At an amount, which is one end of what the tolerance costs, to the last bit."""
    system = system_of(tmp_path)
    amounts = {tolerance.name: 0.0 for tolerance in tolerances_of(system)} | {name: AMOUNTS[name]}
    target = system.target.irradiance(system.target.screen(), system.problem.flux)
    budget = tolerance_budget(system, target, backend, amounts)
    explorer, (effect,) = explorer_of(system, backend), budget.effects
    assert explorer({name: AMOUNTS[name]}).numbers == effect.ends[1]
    assert explorer({}).numbers == budget.light


@pytest.mark.parametrize(
    ("knob", "change", "other"),
    [
        ("target.defocus", 5.0, {"target.distance": 65.0}),
        ("index", 0.02, {"lens.index": 1.52}),
        pytest.param("source.divergence", 0.5, {"source.divergence": 0.5}, marks=pytest.mark.slow),
    ],
)
def test_light_is_that_of_another_problem_measured_afresh(tmp_path, backend, knob, change, other):
    system = system_of(tmp_path)
    problem = system.problem.with_(**other)
    lens = replace(system.base, index=problem.lens.index)
    fresh = measure(solvable_system(problem).with_lens(lens), backend).metrics
    numbers = explorer_of(system, backend)({knob: change}).numbers
    assert numbers.rel_l2 == pytest.approx(fresh["rel_l2_debiased"], abs=0.01)  # of 32 rays a pixel: 0.003
    assert numbers.efficiency == pytest.approx(fresh["efficiency"], abs=2e-3)


def test_the_beam_widens_and_becomes_parallel_again(tmp_path, backend):
    explorer = explorer_of(system_of(tmp_path), backend)
    values = {}, {"source.divergence": 1.0}, {}, {"source.divergence": 0.0}
    before, wide, *after = (explorer(v).numbers for v in values)
    assert before != wide
    assert after == [before, before]


def test_the_source_of_an_led_has_a_size_and_a_beam_a_divergence(tmp_path, backend):
    names = {}
    for name, changes in {"beam": {}, "led": LED, "point": POINT}.items():
        names[name] = {knob.name for knob in explorer_of(system_of(tmp_path, changes), backend).knobs}
    assert names["beam"] - names["point"] == {"source.divergence"}
    assert names["led"] - names["point"] == {"source.size"}
    assert names["point"] >= set(AMOUNTS)


def test_even_light_has_its_uniformity_on_at_most_so_many_pixels(tmp_path, backend):
    system = system_of(tmp_path, EVEN | {"target.pixels": [64, 32]})
    light = explorer_of(system, backend, 48)({})
    assert light.irradiance.shape == light.target.shape == (24, 48)
    assert "U0 = E_min/E_mean" in light_html(light)
    rows, columns = light.irradiance.shape
    assert f"on {columns} x {rows} pixels" in light_html(light)


def test_values_that_no_knob_can_have_are_refused_by_name(tmp_path, backend):
    explorer = explorer_of(system_of(tmp_path), backend)
    for values, words in (
        ({"indx": 0.01}, r"there is no knob 'indx'; there are .*index"),
        ({"index": float("nan")}, r"index must be a finite number, usually from -0\.05 to 0\.05 1, got nan"),
        ({"index": "0.01"}, r"index must be a finite number, .* got '0\.01'"),
        (
            {"source.divergence": -0.1},
            r"source\.divergence must be a finite number, usually from 0 to 1 degrees",
        ),
    ):
        with pytest.raises(optics.UserError, match=words):
            explorer(values)


def test_without_ipywidgets_the_command_that_installs_them_is_named(monkeypatch, tmp_path):
    system = optics.System(load_problem(write_problem(tmp_path)))
    monkeypatch.setitem(sys.modules, "ipywidgets", None)
    for name in ("optics.interface.relighting.slider_box", "optics.interface.relighting"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    with pytest.raises(
        MissingPackage, match=r'ipywidgets is not installed; pip install "thbcad\[notebook\]"'
    ):
        optics.Design(system).explore()


PROGRAM = """
import optics
system = optics.System(optics.load_problem({path!r}))
box = optics.Design(system).explore(32)
rows, shown = box.children
first = shown.value
rows.children[0].value = 0.5
print(rows.children[0].description, first != shown.value, shown.value.count("data:image/png"))
box
"""


@pytest.mark.slow
def test_a_notebook_shows_sliders_and_traces_again_where_one_moves(tmp_path):
    notebook = new_notebook(cells=[new_code_cell(PROGRAM.format(path=str(write_problem(tmp_path))))])
    NotebookClient(notebook, timeout=120).execute()
    printed, shown = notebook.cells[0].outputs
    assert printed.text == "lens.decentre_x / mm True 3\n"
    assert "application/vnd.jupyter.widget-view+json" in shown.data


def test_a_design_in_light_of_a_script_is_not_explored(tmp_path):
    system = optics.System(load_problem(write_problem(tmp_path)))
    own = optics.System(system.problem, source=system.source)
    with pytest.raises(UserError, match=r"cannot be explored"):
        optics.Design(own).explore()


@pytest.mark.parametrize(
    "receiver",
    [
        {"target.distance": math.inf, "target.half_width": [30.0, 25.0]},
        {"target.surface": "sphere", "target.radius": -80.0, "target.half_width": [40.0, 30.0]},
    ],
    ids=["far field", "sphere"],
)
def test_the_target_is_what_a_measurement_compares_with(tmp_path, backend, receiver):
    """Intensities in the far field, irradiances on a sphere: pixels there differ in size."""
    system = system_of(tmp_path, receiver)
    explored = explorer_of(system, backend, pixels=64)({})
    measured = measure(system, backend)
    wanted = measured.target / measured.target.mean()
    assert abs(explored.target - wanted).max() < 1e-12 * wanted.max()
    assert explored.numbers.rel_l2 == pytest.approx(measured.metrics["rel_l2"], abs=0.01)


def test_few_pixels_of_a_side_stay_two(tmp_path, backend):
    system = system_of(tmp_path, {"target.pixels": [64, 2]})
    assert explorer_of(system, backend, pixels=16)({}).target.shape == (2, 16)
