"""The scripts of examples/scripts: short, and each reaches what it claims."""

import os
import re
import subprocess
import sys
from importlib import import_module

import numpy as np
import pytest

import optics
from tests.cases import EXAMPLES, ROOT
from tests.optics.cases import rough, write_problem

FOLDER = EXAMPLES / "scripts"
SCRIPTS = sorted(FOLDER.glob("*.py"))
LONGEST = 40  # lines
# the script's arguments for a few steps, and what a whole run reaches; the start has 0.0315.  Adam and L-BFGS
# amplify rounding: a tenth is left for it.
STEPS = {
    "own_loss": (8, 0.0056),
    "own_regulariser": (8, 0.0043),
    "gauss_newton": (1, 0.0057),
    "drjit_adam": (30, 0.0048),
    "drjit_network": (40, 0.012),
}


@pytest.fixture
def script(monkeypatch):
    """A function that imports a script by its name."""
    monkeypatch.syspath_prepend(str(FOLDER))
    return import_module


def test_every_script_is_run():
    assert {path.stem for path in SCRIPTS} == set(STEPS)


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_scripts_are_short(path):
    assert len(path.read_text("utf-8").splitlines()) <= LONGEST


@pytest.mark.slow
@pytest.mark.parametrize("name", STEPS)
def test_a_few_steps_on_a_small_problem_better_the_start(script, tmp_path, monkeypatch, name):
    path = write_problem(tmp_path)
    module = script(name)
    monkeypatch.setattr(module, "PROBLEM", path)
    before = module.main(0)["rel_l2"]
    assert module.main(STEPS[name][0])["rel_l2"] < before


def printed(name):
    """Return what a script prints where nobody told Dr.Jit which LLVM to take."""
    told = {key: value for key, value in os.environ.items() if key != "DRJIT_LIBLLVM_PATH"}
    command = [sys.executable, FOLDER / f"{name}.py"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=told)
    assert not done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(STEPS) - {"own_regulariser"}))
def test_a_whole_run_reaches_its_claim(name):
    assert 0 < float(re.findall(r"rel_l2 ([\d.]+)", printed(name))[-1]) <= STEPS[name][1]


@pytest.mark.slow
def test_the_own_regulariser_calms_the_sag():
    """The variation falls to a quarter, or less, and the error grows by 15 per cent, or less."""
    found = re.findall(r"weight \S+: rel_l2 ([\d.]+), variation ([\d.]+)", printed("own_regulariser"))
    (plain, rough_sag), (error, calm_sag) = [(float(a), float(b)) for a, b in found]
    assert error <= min(STEPS["own_regulariser"][1], 1.15 * plain)
    assert calm_sag < rough_sag / 4


def test_the_custom_operation_has_the_gradient_of_the_model(script, tmp_path):
    """Only the order of sums may differ."""
    import drjit as dr

    system = optics.System(optics.load_problem(write_problem(tmp_path)))
    space = system.space(1)
    model, c = system.model(space, (97, 93)), rough(space, 0.03)
    operation, Float = script("drjit_adam").Irradiance, script("drjit_adam").Float
    image, pull = model.vjp(c)
    weights = np.random.default_rng(3).standard_normal(image.shape)

    variable = Float(c)
    dr.enable_grad(variable)
    light = dr.custom(operation, model, variable)
    np.testing.assert_array_equal(light.numpy(), image.ravel())
    dr.backward(dr.sum(light * Float(weights.ravel())))
    wanted = pull(weights)
    np.testing.assert_allclose(dr.grad(variable).numpy(), wanted, rtol=0, atol=1e-12 * abs(wanted).max())


@pytest.mark.slow
def test_the_recipe_for_jax_has_the_gradient_of_the_model(tmp_path):
    jax = pytest.importorskip("jax")
    (recipe,) = re.findall(
        r"^```python jax\n(.*?)^```", (ROOT / "docs/scripts.md").read_text("utf-8"), re.M | re.S
    )
    assert sum(map(bool, recipe.splitlines())) <= 12
    system = optics.System(optics.load_problem(write_problem(tmp_path)))
    space = system.space(1)
    names = {"model": system.model(space, (65, 65)), "np": np}
    exec(recipe, names)
    model, c = names["model"], rough(space, 0.03)

    def loss(c):
        return ((names["light"](c) - model.target) ** 2).sum()

    image, pull = model.vjp(c)
    wanted = pull(2 * (image - model.target))
    for derivative in (jax.grad(loss), jax.jit(jax.grad(loss))):
        np.testing.assert_allclose(derivative(c), wanted, rtol=0, atol=1e-12 * abs(wanted).max())
