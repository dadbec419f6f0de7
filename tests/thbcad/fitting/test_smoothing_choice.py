"""The smoothing that samples ask for, against scipy's smoothing spline and against dense algebra."""

import numpy as np
import pytest
from scipy.interpolate import make_smoothing_spline
from scipy.optimize import minimize_scalar

from tests.thbcad.fitting.cases import everywhere, refined, smooth, tensor
from thbcad.fitting import smoothing_choice as choice
from thbcad.fitting.least_squares_fit import Samples, least_squares
from thbcad.fitting.normal_equations import NormalEquations, Underdetermined, thin_plate
from thbcad.hierarchy import THBSpace
from thbcad.splines import KnotVector

SIGMA = 0.05
FINE = np.linspace(0, 1, 41)


def noisy(n=600, seed=0):
    rng = np.random.default_rng(seed)
    u, v = everywhere(rng, n)
    return Samples(u, v, smooth(u, v) + rng.normal(scale=SIGMA, size=n))


def rms(surface):
    return np.sqrt(np.mean((surface.grid(FINE, FINE) - smooth(FINE[:, None], FINE)) ** 2))


def test_along_a_line_the_choice_is_that_of_scipy():
    """Samples at v = 1/2 leave the tilt in v free, and one more, of hardly any weight, takes it: the rest is
    the cubic smoothing spline with a knot at every sample, and V is that of scipy but for a factor."""
    rng = np.random.default_rng(3)
    x = np.sort(rng.uniform(0, 30, 40))
    z = np.sin(x / 3) + rng.normal(scale=0.2, size=40)
    twin = make_smoothing_spline(x, z)
    ends = np.repeat([x[0], x[-1]], 3)
    space = THBSpace(KnotVector(3, np.sort(np.r_[ends, x])), KnotVector.uniform(1, 1))
    line = Samples(np.r_[x, x[20]], np.r_[np.full(40, 0.5), 1.0], np.r_[z, 0.0], np.r_[np.ones(40), 1e-6])
    found = least_squares(space, line, "auto")
    at = np.linspace(x[0], x[-1], 200)
    # the smoothing is found to 2 % by both
    assert found(at, np.full(200, 0.5)) == pytest.approx(twin(at), abs=5e-3)
    assert abs(found(at, np.full(200, 0.5)) - make_smoothing_spline(x, z, lam=0.1)(at)).max() > 0.05


def dense_v(space, samples, smoothing):
    """V by definition, with the hat matrix."""
    a, root = space.collocation(samples.u, samples.v).toarray(), np.sqrt(samples.weights)
    rows = root[:, None] * a
    hat = rows @ np.linalg.solve(rows.T @ rows + smoothing * thin_plate(space).toarray(), rows.T)
    residual = root * samples.values - hat @ (root * samples.values)
    n = np.count_nonzero(samples.weights)
    return n * residual @ residual / (n - np.trace(hat)) ** 2


@pytest.mark.parametrize("exact", [500, 0])
def test_the_chosen_smoothing_has_the_least_v(exact, monkeypatch):
    monkeypatch.setattr(choice, "EXACT", exact)
    space = refined(3)
    weights = np.random.default_rng(1).uniform(0.5, 2, 600)
    weights[:20] = 0
    samples = Samples(*(getattr(noisy(), name) for name in ("u", "v", "values")), weights)
    best = minimize_scalar(lambda e: dense_v(space, samples, 10**e), bounds=(-6, 2), method="bounded")
    wanted = least_squares(space, samples, 10**best.x).coefficients
    found = least_squares(space, samples, "auto").coefficients
    # V is flat: 2 % of the smoothing move the fit by 1e-3, an estimated trace by a little more
    assert abs(found - wanted).max() <= (2e-3 if exact else 2e-2)
    assert abs(least_squares(space, samples, 1e-6).coefficients - wanted).max() > 0.2


def test_v_between_the_smoothings_that_were_solved_is_v_by_definition():
    space, samples = refined(3), noisy()
    collocation = space.collocation(samples.u, samples.v)
    equations = NormalEquations.of(space, collocation, thin_plate(space), samples.values, samples.weights)
    curve = choice._Curve(equations)
    for exponent in (-4.0, -2.0, -1.0, 0.0):
        assert curve.add(exponent)
    units = equations.height**2 * equations.unit
    assert units * curve.value(-2.0) == pytest.approx(dense_v(space, samples, 1e-2), rel=1e-9)
    # midway in a decade the best fraction with both poles errs by 0.6 %, ((10^(1/4) - 1) / (10^(1/4) + 1))^4,
    # which V has three times: in the misfit, and in the square of n - tr H
    for exponent in (-1.7, -1.5, -1.3, -0.7, -0.5):
        assert units * curve.value(exponent) == pytest.approx(
            dense_v(space, samples, 10**exponent), rel=18e-3
        )


def test_few_fits_find_the_smoothing_and_are_told():
    told = []
    least_squares(tensor(3, 24), noisy(), "auto", progress=lambda done, most: told.append((done, most)))
    assert told == [(k + 1, choice.MOST_FITS) for k in range(len(told))]
    assert 4 <= len(told) <= 9
    least_squares(tensor(3, 8), noisy(), "discrepancy", progress=lambda done, most: told.append((done, most)))
    assert told[-1][0] <= told[-1][1]


@pytest.mark.parametrize("spans", [8, 24])
def test_the_chosen_smoothing_is_nearly_the_best(spans):
    space = tensor(3, spans)
    errors = [rms(least_squares(space, noisy(), s)) for s in 10.0 ** np.arange(-5, 2, 0.5)]
    assert rms(least_squares(space, noisy(), "auto")) <= 1.3 * min(errors)
    assert errors[0] > 1.9 * min(errors)


def test_discrepancy_leaves_as_much_as_the_noise():
    """With weights 1 / sigma^2 the weighted sum of squares is the number of values, to the 1 % of the
    search."""
    given = noisy()
    values = np.stack([given.values, 2 * given.values], axis=1)
    samples = Samples(given.u, given.v, values, np.full(600, 1 / SIGMA**2 / 2.5))
    found = least_squares(tensor(3, 8), samples, "discrepancy")
    misfit = samples.weights @ ((found(samples.u, samples.v) - values) ** 2).sum(axis=1)
    assert misfit == pytest.approx(1200, rel=0.01)


def test_discrepancy_smooths_no_more_where_the_space_misses_more_than_the_noise():
    given = noisy()
    samples = Samples(given.u, given.v, given.values, np.full(600, 1e8))
    found = least_squares(tensor(2, 1), samples, "discrepancy")
    assert np.array_equal(found.coefficients, least_squares(tensor(2, 1), samples).coefficients)


def test_discrepancy_ends_at_the_plane_where_noise_is_all():
    given = noisy()
    samples = Samples(given.u, given.v, given.values, np.full(600, 1e-4))
    found = least_squares(tensor(3, 4), samples, "discrepancy")
    columns = np.column_stack([np.ones(600), given.u, given.v])
    plane = columns @ np.linalg.lstsq(columns, given.values)[0]
    assert abs(found(given.u, given.v) - plane).max() < 0.02


def test_samples_without_noise_are_not_smoothed():
    space = refined(3)
    u, v = everywhere(np.random.default_rng(0), 2000)
    c = np.random.default_rng(1).uniform(-1, 1, space.dim)
    exact = Samples(u, v, space.collocation(u, v) @ c)
    assert least_squares(space, exact, "auto").coefficients == pytest.approx(c, abs=1e-10)


def test_few_samples_are_smoothed_until_they_determine_the_spline():
    few = noisy(100)
    with pytest.raises(Underdetermined):
        least_squares(tensor(3, 16), few)
    for rule in ("auto", "discrepancy"):
        weighted = Samples(few.u, few.v, few.values, np.full(100, SIGMA**-2))
        assert rms(least_squares(tensor(3, 16), weighted, rule)) < SIGMA


def test_two_samples_and_those_without_weight_determine_nothing():
    few = noisy(2)
    for rule in ("auto", "discrepancy"):
        with pytest.raises(Underdetermined, match="choose another smoothing"):
            least_squares(tensor(2, 3), few, rule)
        with pytest.raises(Underdetermined, match="have no sample"):
            least_squares(tensor(2, 3), Samples(few.u, few.v, few.values, [0, 0]), rule)


def test_an_unknown_rule_is_refused():
    for rule in ("gcv", ""):
        with pytest.raises(ValueError, match=r"smoothing must be a number or one of \('auto', 'discrep"):
            least_squares(tensor(2, 3), noisy(), rule)
