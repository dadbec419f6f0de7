"""Minimising a script's own loss."""

import numpy as np
import pytest

import optics

GOAL = np.array([0.3, -0.2, 0.5])
STIFFNESS = np.array([1.0, 10.0, 100.0])


def bowl(c):
    return float(STIFFNESS @ (c - GOAL) ** 2), 2 * STIFFNESS * (c - GOAL)


@pytest.mark.parametrize(("method", "error"), [("lbfgs", 1e-6), ("adam", 1e-2)])
def test_the_minimum_of_a_bowl_is_found(method, error):
    found = optics.minimise(bowl, np.zeros(3), method, iterations=300)
    assert np.abs(found.coefficients - GOAL).max() < error
    assert found.loss == min(found.losses) == bowl(found.coefficients)[0]
    assert found.evaluations == len(found.losses)
    assert not found.interrupted


def test_tuples_stay_tuples_and_nothing_is_changed_in_place():
    start = np.zeros(1), np.zeros(2)

    def loss(c):
        value, gradient = bowl(np.concatenate(c))
        return value, (gradient[:1], gradient[1:])

    found = optics.minimise(loss, start)
    assert isinstance(found.coefficients, tuple)
    np.testing.assert_allclose(np.concatenate(found.coefficients), GOAL, atol=1e-6)
    assert not any(row.any() for row in start)


def test_the_callback_sees_every_step_and_may_end_the_work():
    steps = []

    def callback(step, loss, c):
        steps.append((step, loss))
        if step == 3:
            raise StopIteration

    optics.minimise(bowl, np.zeros(3), "adam", callback=callback)
    assert [step for step, _ in steps] == [1, 2, 3]
    losses = [loss for _, loss in steps]
    assert losses == sorted(losses, reverse=True)


@pytest.mark.parametrize("method", ["lbfgs", "adam"])
def test_an_interrupt_gives_back_the_best_so_far(method):
    calls = []

    def loss(c):
        calls.append(bowl(c)[0])
        if len(calls) == 4:
            raise KeyboardInterrupt
        return bowl(c)

    found = optics.minimise(loss, np.zeros(3), method)
    assert found.interrupted
    assert found.loss == min(calls[:3]) == bowl(found.coefficients)[0]


def test_an_interrupt_before_anything_is_known_goes_on():
    def loss(c):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        optics.minimise(loss, np.zeros(3))


@pytest.mark.parametrize(
    ("loss", "error", "sentence"),
    [
        (lambda c: (1.0, np.zeros(2)), optics.UserError, r"gradient must have the shape \(3,\)"),
        (lambda c: 1.0, optics.UserError, "the loss must return a number and its gradient"),
        (lambda c: (np.nan, c), optics.NumericalError, "not finite"),
        (lambda c: (1.0, c + np.inf), optics.NumericalError, "not finite"),
    ],
    ids=["gradient of another shape", "no gradient", "loss not finite", "gradient not finite"],
)
def test_a_bad_loss_gets_one_sentence(loss, error, sentence):
    with pytest.raises(error, match=sentence):
        optics.minimise(loss, np.zeros(3))


def test_an_unknown_method_is_refused():
    with pytest.raises(optics.UserError, match=r"method must be one of 'lbfgs', 'adam', or an .*'newton'"):
        optics.minimise(bowl, np.zeros(3), "newton")


@pytest.mark.parametrize(
    ("start", "options", "message"),
    [
        (np.zeros(3), {"iterations": -1}, "iterations must be a whole number from 0 on, got -1"),
        (np.zeros(3), {"iterations": 2.5}, "iterations must be a whole number from 0 on, got 2.5"),
        (np.zeros(3) + 1j, {}, "coefficients: numbers must be real, got complex128"),
        (np.ma.array(np.zeros(3), mask=[0, 1, 0]), {}, "coefficients: numbers must not be masked, got 1"),
        (
            np.zeros((3, 1)),
            {},
            r"coefficients must be a vector or a tuple of vectors, got the shape \(3, 1\)",
        ),
        (None, {}, "coefficients must be"),
    ],
)
def test_starts_and_counts_that_cannot_be_are_refused(start, options, message):
    with pytest.raises(optics.UserError, match=message):
        optics.minimise(bowl, start, **options)


@pytest.mark.parametrize("part", [0, 1])
def test_a_complex_loss_or_gradient_is_refused(part):
    """numpy would drop the imaginary part with a warning."""

    def loss(c):
        found = [np.float64(1.0), np.zeros(3)]
        found[part] = found[part] + 1j
        return tuple(found)

    with pytest.raises(optics.UserError, match=r"its gradient: numbers must be real, got complex128"):
        optics.minimise(loss, np.zeros(3))


@pytest.mark.parametrize("method", ["lbfgs", "adam"])
def test_no_iterations_leave_the_start(method):
    found = optics.minimise(lambda c: (c @ c, 2 * c), np.array([3.0, 4.0]), method, iterations=0)
    assert (found.coefficients.tolist(), found.losses) == ([3.0, 4.0], (25.0,))
