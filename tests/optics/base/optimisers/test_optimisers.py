"""Optimisers against the recurrences of thesis section 4.2 in plain numpy, and against exact minima."""

import numpy as np
import pytest
from scipy.optimize import minimize, rosen, rosen_der

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


def evaluated(by, function):
    """The values of a function that an optimiser asks for, relative to the first."""
    values = []

    def heard(x):
        value, gradient = function(x)
        values.append(value)
        return value, gradient

    by(heard)
    return np.array(values) / abs(values[0])


def scipys(start, steps, memory=10):
    options = {"maxiter": steps, "maxcor": memory, "gtol": 0.0, "ftol": 0.0}
    return lambda f: minimize(f, start, jac=True, method="L-BFGS-B", options=options)


def ours(start, steps, **options):
    return lambda f: optics.LBFGS(**options).run(f, start, steps, lambda _: None)


def long_bowl(x, size=1.0):
    stiffness = np.geomspace(1, 300, 30)
    return float(stiffness @ (x / size) ** 2 / 2), stiffness * x / size**2


@pytest.mark.parametrize("memory", [1, 5, 40])
@pytest.mark.parametrize("factor", [1e-6, 1.0, 1e4])
def test_steps_of_lbfgs_are_those_of_scipy(memory, factor):
    """On a bowl, where the first lengths of both line searches will do."""

    def function(x):
        value, gradient = long_bowl(x)
        return factor * value, factor * gradient

    start = np.linspace(-1, 2, 30)
    found = evaluated(ours(start, 25, memory=memory, least_decrease=0.0), function)
    np.testing.assert_allclose(found[:15], evaluated(scipys(start, 25, memory), function)[:15], rtol=1e-6)
    assert found[-1] < (0.02 if memory == 1 else 1e-4)


@pytest.mark.parametrize("size", [1e-9, 1e-6, 1e-3, 1.0, 1e4])
def test_a_first_step_of_any_length_becomes_one_that_lbfgs_can_take(size):
    start = size * np.linspace(-1, 2, 30)
    found, wanted = (evaluated(by(start, 9), lambda x: long_bowl(x, size)) for by in (ours, scipys))
    assert found.min() < 1.1 * wanted.min()
    assert len(found) <= len(wanted) + 5


@pytest.mark.parametrize("start", [(-100.0, 100.0), (-10.0, 10.0, 5.0, -3.0, 2.0)])
def test_lbfgs_goes_on_from_a_far_start(start):
    found = optics.minimise(lambda x: (rosen(x), rosen_der(x)), np.array(start), iterations=300)
    assert found.loss < 1e-9


@pytest.mark.parametrize("allowed", [18, 60])
def test_lbfgs_lowers_a_kinked_function(allowed):
    """It has 2 n + 10 evaluations, and 20 of the search that it is in."""
    slopes = np.array([1.0, 3.0, 7.0])
    start = ours(np.array([1.0, -2.0, 0.3]), allowed, least_decrease=0.0)
    values = evaluated(start, lambda x: (float(slopes @ np.abs(x)), slopes * np.sign(x)))
    assert len(values) <= 2 * allowed + 10 + 20
    assert values.min() < 0.03


def test_lbfgs_ends_where_no_step_lowers_the_value():
    values = evaluated(ours(np.zeros(2), 50), lambda x: (1 + float(np.abs(x).sum()), np.ones(2)))
    assert len(values) <= 1 + 20


def test_lbfgs_goes_on_where_its_pairs_are_too_small_for_numbers():
    values = evaluated(ours(np.ones(3), 3000, least_decrease=0.0), lambda x: (float((x**4).sum()), 4 * x**3))
    assert values.min() < 1e-150


def test_a_function_may_use_its_gradient_again():
    gradient, start = np.zeros(30), np.linspace(-1, 2, 30)

    def reused(x):
        value, gradient[:] = long_bowl(x)
        return value, gradient

    own = evaluated(ours(start, 20), reused)
    np.testing.assert_array_equal(own, evaluated(ours(start, 20), long_bowl))


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
        (lambda: optics.LBFGS(least_decrease=None), "least_decrease must be a number from 0 to 1, got None"),
        (
            lambda: optics.LBFGS(least_decrease=-1e-9),
            "least_decrease must be a number from 0 to 1, got -1e-09",
        ),
    ],
)
def test_wrong_numbers_are_one_sentence(made, words):
    with pytest.raises(optics.UserError, match=words):
        made()


def test_what_is_no_optimiser_is_named():
    with pytest.raises(optics.UserError, match=r"or an optimiser such as optics\.Adam"):
        optics.minimise(bowl, START, optics.Adam)
