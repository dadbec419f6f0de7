"""When the optimiser stops: where the loss is flat, or at its iterations; then it says how it still fell."""

from types import SimpleNamespace

import numpy as np
import pytest

from optics.designing.optimisation.bounded_variables import BoundedVariables
from optics.designing.optimisation.objective import Evaluation
from optics.designing.optimisation.stage_search import FLAT, STEPS, Log, Search, minimised
from optics.designing.optimisation.state import State, first_sags
from tests.optics.designing.optimisation.cases import FLAT as FLAT_START, run


class Valley:
    """Loss floor + depth sum_k w_k (c_k - 1)^2 with weights w of very different size."""

    def __init__(self, floor, depth):
        self.floor, self.depth = floor, depth

    def __call__(self, coefficients):
        (c,) = coefficients
        weights = np.logspace(0, -7, len(c))
        loss = self.floor + self.depth * float(np.sum(weights * (c - 1) ** 2))
        return Evaluation(loss, [2 * self.depth * weights * (c - 1)], 0.0)


def found(small, valley, iterations):
    """Return what a search of a valley finds, and the losses of its history."""
    system, state = small.system, State(False, 0, first_sags(small.system, False))
    variables = BoundedVariables(state.sags, [f.freedom for f in system.freeforms])
    log = Log(state, SimpleNamespace(level=0), 0.0, lambda row: None)
    result = minimised(Search(system.problem, valley, variables, state.sags, None), iterations, log)
    return result, [row.loss for row in log.rows]


def test_what_still_falls_at_the_last_iteration_is_said(small):
    result, losses = found(small, Valley(0.0, 1.0), 2 * STEPS)
    best = np.minimum.accumulate(losses)
    most, least = (1 - np.sqrt(best[-1] / best[-1 - n]) ** (1 / STEPS) for n in (STEPS + 3, STEPS))
    assert least <= result.fall <= most
    assert result.fall > FLAT


def test_a_flat_loss_ends_the_work_early(small):
    result, losses = found(small, Valley(1.0, 1e-5), 500)
    assert STEPS < len(losses) < 4 * STEPS
    assert result.fall == 0


def test_a_design_that_still_falls_says_how_it_goes_on(tmp_path, backend):
    changes = {"optimizer.iterations": [12], "lens.rear.freeform.max_level": 0}
    (sentence,) = run(tmp_path, backend, FLAT_START | changes).notes
    assert "stopped by its 12 iterations, while the misfit still fell by" in sentence
    assert "--resume --iterations 48 goes on" in sentence


@pytest.mark.parametrize("iterations", [1, STEPS - 1])
def test_after_few_iterations_nothing_is_said(small, iterations):
    result, _ = found(small, Valley(0.0, 1.0), iterations)
    assert result.fall == 0


def test_where_a_search_ends_does_not_depend_on_the_size_of_its_loss(small):
    """A power of two changes no digit; scipy's own least decrease is 2.2e-9 for every loss below 1."""
    _, losses = found(small, Valley(0.0, 2.0**-2), 100)
    _, fainter = found(small, Valley(0.0, 2.0**-22), 100)
    np.testing.assert_array_equal(2.0**20 * np.array(fainter), losses)
