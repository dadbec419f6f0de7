"""Optimisers against the recurrences of thesis section 4.2 in plain numpy, and against exact minima."""

import numpy as np
import pytest
from scipy.optimize import minimize

import optics

START = np.array([1.0, -2.0, 0.5, 3.0])
STIFFNESS = np.array([1.0, 0.3, 4.0, 0.0])  # the last variable has no gradient


def bowl(x):
    return float(STIFFNESS @ x**2 + 0.1 * np.sin(x[0])), 2 * STIFFNESS * x + [0.1 * np.cos(x[0]), 0, 0, 0]


def path(optimiser, iterations=30):
    points = [START.copy()]
    optimiser.run(bowl, START, iterations, lambda x: points.append(np.array(x)))
    return np.array(points)


def descent(step, decay, iterations=30):
    points = [START]
    for k in range(iterations):
        points.append(points[-1] - step * decay**k * bowl(points[-1])[1])
    return np.array(points)


def averaged(step, b1, b2, unbiased, iterations=30):
    """The means m of g and v of g^2; b1 or b2 is None where a method has no such mean."""
    x, m, v, points = START, 0.0, 0.0, [START]
    for k in range(1, iterations + 1):
        g = bowl(x)[1]
        m = g if b1 is None else b1 * m + (1 - b1) * g
        v = 1.0 if b2 is None else b2 * v + (1 - b2) * g**2
        first = m / (1 - b1**k) if unbiased else m
        second = v / (1 - b2**k) if unbiased else v
        x = x - step * first / np.maximum(np.sqrt(second), 1e-12)
        points.append(x)
    return np.array(points)


@pytest.mark.parametrize(
    ("optimiser", "wanted"),
    [
        (optics.GradientDescent(0.05), descent(0.05, 1.0)),
        (optics.GradientDescent(0.1, decay=0.9), descent(0.1, 0.9)),
        (optics.Momentum(0.05, mean=0.8), averaged(0.05, 0.8, None, False)),
        (optics.RMSProp(0.02, square=0.95), averaged(0.02, None, 0.95, False)),
        (optics.Adam(0.03, mean=0.85, square=0.99), averaged(0.03, 0.85, 0.99, True)),
    ],
    ids=lambda value: type(value).__name__,
)
def test_steps_follow_the_recurrences(optimiser, wanted):
    np.testing.assert_allclose(path(optimiser), wanted, rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("factor", [1e-9, 1e6])
@pytest.mark.parametrize("optimiser", [optics.Adam(0.03), optics.RMSProp(0.03)], ids=["adam", "rmsprop"])
def test_a_factor_of_the_function_changes_nothing(optimiser, factor):
    points = []

    def scaled(x):
        value, gradient = bowl(x)
        return factor * value, factor * gradient

    optimiser.run(scaled, START, 30, lambda x: points.append(np.array(x)))
    np.testing.assert_allclose(points, path(optimiser)[1:], rtol=1e-9, atol=1e-9)


def test_line_search_ends_every_step_where_the_gradient_is_across():
    gradients = []
    optics.LineSearch().run(bowl, START, 5, lambda x: gradients.append(bowl(x)[1]))
    before = [bowl(START)[1], *gradients[:-1]]
    cosines = [a @ b / np.linalg.norm(a) / np.linalg.norm(b) for a, b in zip(before, gradients)]
    assert len(cosines) == 5
    assert np.abs(cosines).max() < 0.05


@pytest.mark.parametrize("method", [optics.LineSearch(), optics.LBFGS()], ids=["line", "lbfgs"])
def test_a_minimum_is_found_and_a_flat_function_ends(method):
    found = optics.minimise(bowl, START, method, iterations=200)
    assert np.abs(bowl(found.coefficients)[1]).max() < 1e-3
    flat = optics.minimise(lambda x: (1.0, 0 * x), START, method)
    assert flat.evaluations <= 2


@pytest.mark.parametrize("memory", [1, 5, 40])
@pytest.mark.parametrize("factor", [1e-6, 1.0, 1e4])
def test_steps_of_lbfgs_are_those_of_scipy(memory, factor):
    """On a bowl, where both line searches take the same lengths."""
    stiffness, start = np.geomspace(1, 300, 30), np.linspace(-1, 2, 30)

    def evaluated(by):
        values = []

        def function(x):
            gradient = factor * stiffness * x
            values.append(gradient @ x / 2)
            return values[-1], gradient

        by(function)
        return np.array(values) / values[0]

    ours = evaluated(lambda f: optics.LBFGS(memory, 0.0).run(f, start, 25, lambda _: None))
    options = {"maxiter": 25, "maxcor": memory, "gtol": 0.0, "ftol": 0.0}
    theirs = evaluated(lambda f: minimize(f, start, jac=True, method="L-BFGS-B", options=options))
    np.testing.assert_allclose(ours[:15], theirs[:15], rtol=1e-6)
    assert ours[-1] < (0.02 if memory == 1 else 1e-4)


def test_lbfgs_grows_a_step_that_is_too_short():
    """The first has the length 1, and scipy's search would give up at 1024."""
    values = []

    def far(x):
        values.append(float(np.sqrt(1 + (x[0] - 16000) ** 2)))
        return values[-1], (x - 16000) / values[-1]

    optics.LBFGS().run(far, np.zeros(1), 1, lambda _: None)
    assert len(values) <= 20
    assert min(values) < 400


@pytest.mark.parametrize("allowed", [100, 18])
def test_lbfgs_ends_where_no_step_lowers_a_kinked_function(allowed):
    """After 12 steps with 109 evaluations; 18 steps may have 46 of them, and what the last search takes."""
    slopes, values = np.array([1.0, 3.0, 7.0]), []

    def kinked(x):
        values.append(float(slopes @ np.abs(x)))
        return values[-1], slopes * np.sign(x)

    start = np.array([1.0, -2.0, 0.3])
    assert optics.LBFGS(least_decrease=0.0).run(kinked, start, allowed, lambda _: None) < allowed
    assert len(values) <= 2 * allowed + 10 + 20
    assert min(values) < 0.02 * values[0]


def test_no_gradient_moves_nothing():
    for method in (optics.Adam(), optics.RMSProp(0.1)):
        found = optics.minimise(lambda x: (1.0, 0 * x), START, method, iterations=3)
        np.testing.assert_array_equal(found.coefficients, START)


@pytest.mark.parametrize(
    "method",
    [optics.GradientDescent(0.01), optics.Adam(), optics.LineSearch(), optics.LBFGS()],
    ids=lambda method: type(method).__name__,
)
def test_a_callback_ends_the_work(method):
    def second(step, _, __):
        if step == 2:
            raise StopIteration

    found = optics.minimise(bowl, START, method, iterations=50, callback=second)
    assert found.evaluations < 40


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: optics.Adam(0.0), "step must be a positive number, got 0.0"),
        (lambda: optics.RMSProp(float("nan")), "step must be a positive number, got nan"),
        (lambda: optics.GradientDescent("1"), "step must be a positive number, got '1'"),
        (lambda: optics.LineSearch(-1), "step must be a positive number, got -1"),
        (lambda: optics.GradientDescent(1, decay=1.1), "decay must be a number from 0 to 1, got 1.1"),
        (lambda: optics.Momentum(1, mean=-1), "mean must be a number from 0 to 1, got -1"),
        (lambda: optics.Adam(square=True), "square must be a number from 0 to 1, got True"),
        (lambda: optics.LBFGS(0), "memory must be a whole number from 1 on, got 0"),
    ],
)
def test_wrong_numbers_are_one_sentence(made, words):
    with pytest.raises(optics.UserError, match=words):
        made()


def test_what_is_no_optimiser_is_named():
    with pytest.raises(optics.UserError, match=r"or an optimiser such as optics\.Adam"):
        optics.minimise(bowl, START, optics.Adam)
