"""The optimiser of examples/thesis/own_optimiser.py: an object with a method `run`."""

import numpy as np

import optics
from examples.thesis import own_optimiser
from tests.cases import EXAMPLES


def bowl(x):
    """Return 1/2 x' A x and its gradient, A = diag(1, 30)."""
    curvatures = np.array([1.0, 30.0])
    return 0.5 * x @ (curvatures * x), curvatures * x


def test_it_finds_the_bottom_of_a_bowl_and_never_climbs():
    seen = []
    optimiser = own_optimiser.AcceptedSteps()
    steps = optimiser.run(bowl, np.array([3.0, -2.0]), 400, lambda x: seen.append(bowl(x)[0]))
    assert steps == 400
    assert seen[-1] < 1e-12
    assert (np.diff(seen) < 0).all()


def test_it_stops_where_the_callback_asks_for_it():
    def stop(number, value, x):
        raise StopIteration

    found = optics.minimise(bowl, np.array([3.0, -2.0]), own_optimiser.AcceptedSteps(), 100, stop)
    assert found.evaluations == 2


def test_it_betters_the_lens_of_its_problem():
    first, least = own_optimiser.main(iterations=5, rays=(65, 65))
    assert least < first


def test_the_problems_of_the_thesis_are_valid():
    for path in (EXAMPLES / "thesis").glob("*.toml"):
        optics.load_problem(path)
