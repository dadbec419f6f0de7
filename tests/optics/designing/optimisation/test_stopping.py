"""When the optimiser stops: where the loss is flat, or at its iterations; then it says how it still fell."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from optics.designing.optimisation.loop import design
from optics.designing.optimisation.objective import Evaluation
from optics.designing.optimisation.recorder import FLAT, STEPS, Recorder
from optics.designing.optimisation.state import State, first_sags
from optics.light.engines import ExactEngine
from tests.optics.designing.optimisation.cases import FLAT as FLAT_START, loaded


class Valley:
    """Loss floor + depth sum_k w_k (c_k - 1)^2 with weights w of very different size."""

    def __init__(self, floor, depth):
        self.floor, self.depth = floor, depth

    def __call__(self, coefficients):
        (c,) = coefficients
        weights = np.logspace(0, -7, len(c))
        loss = self.floor + self.depth * float(np.sum(weights * (c - 1) ** 2))
        return Evaluation(loss, [2 * self.depth * weights * (c - 1)], 0.0)


def recorder(small, valley, iterations):
    stage = SimpleNamespace(level=0, iterations=iterations)
    return Recorder(small.system, valley, stage, State(False, 0, first_sags(small.system, False)), (), 0.0)


def test_what_still_falls_at_the_last_iteration_is_said(small):
    run = recorder(small, Valley(0.0, 1.0), 2 * STEPS)
    run.minimized()
    best = np.minimum.accumulate([row.loss for row in run.history])
    most, least = (1 - np.sqrt(best[-1] / best[-1 - n]) ** (1 / STEPS) for n in (STEPS + 3, STEPS))
    assert least <= run.fall <= most
    assert run.fall > FLAT


def test_a_flat_loss_ends_the_work_early(small):
    run = recorder(small, Valley(1.0, 1e-5), 500)
    run.minimized()
    assert STEPS < len(run.history) < 4 * STEPS
    assert run.fall == 0


def test_a_design_that_still_falls_says_how_it_goes_on(tmp_path, backend):
    system = loaded(tmp_path, FLAT_START | {"optimizer.iterations": [12], "lens.rear.freeform.max_level": 0})
    notes = []
    design(system, backend, ExactEngine(backend), note=notes.append)
    (sentence,) = notes
    assert "stopped by its 12 iterations, while the misfit still fell by" in sentence
    assert "--resume --iterations 48 goes on" in sentence


@pytest.mark.parametrize("iterations", [1, STEPS - 1])
def test_after_few_iterations_nothing_is_said(small, iterations):
    run = recorder(small, Valley(0.0, 1.0), iterations)
    run.minimized()
    assert run.fall == 0
