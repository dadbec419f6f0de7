"""Adaptive fitting to a tolerance, and the example that fits a height map."""

import importlib.util

import numpy as np
import pytest
from hypothesis import given

from tests.cases import EXAMPLES
from tests.thbcad.cases import knot_vectors, seeds
from tests.thbcad.fitting.cases import everywhere, refined, smooth, tensor
from thbcad.fitting import adaptive_fit as adaptive
from thbcad.fitting.adaptive_fit import fit, surroundings
from thbcad.fitting.fit_targets import held_out
from thbcad.fitting.least_squares_fit import Samples, robust_weights
from thbcad.fitting.normal_equations import Underdetermined
from thbcad.fitting.quasi_interpolant import quasi_interpolate
from thbcad.hierarchy import THBSpace
from thbcad.sags import Conic
from thbcad.splines import BSplineSurface, KnotVector
from thbcad.surfaces import THBSurface

EXAMPLE = EXAMPLES / "height_map.py"


def bump(u, v):
    return np.exp(-((u - 0.37) ** 2 + (v - 0.61) ** 2) / 0.05**2)


# ---- adaptive fitting ----


def uniform_dim(degree, spans, function, error):
    """Return the number of functions of the first uniform refinement with at most this error."""
    u, v = everywhere(np.random.default_rng(0), 20000)
    while True:
        space = tensor(degree, spans)
        if abs(quasi_interpolate(space, function)(u, v) - function(u, v)).max() <= error:
            return space.dim
        spans *= 2


@pytest.mark.every(2)
@pytest.mark.parametrize("degree", [2, 3])
def test_an_adaptive_fit_of_a_bump_needs_far_fewer_functions(degree):
    found = fit(tensor(degree, 8), bump, 1e-4)
    assert found.outcome == "reached"
    assert found.error <= 1e-4
    assert found.error == found.history[-1].error
    assert found.history[-1].dim == found.surface.space.dim
    u, v = everywhere(np.random.default_rng(1), 20000)
    assert abs(found.surface(u, v) - bump(u, v)).max() <= 1.2e-4  # the error is measured at other points
    assert 8 * found.surface.space.dim < uniform_dim(degree, 8, bump, 1e-4)


def test_a_spline_of_the_space_is_reached_at_once():
    space = refined(3)
    target = THBSurface(space, np.random.default_rng(0).normal(size=(space.dim, 3)))
    found = fit(space, target, 1e-12)
    assert (found.outcome, len(found.history)) == ("reached", 1)


def test_the_error_of_a_spline_and_of_a_conic_is_a_bound():
    fine = refined(2, 12, 5)
    spline = THBSurface(fine, np.random.default_rng(0).uniform(-1, 1, (fine.dim, 2)))
    x = np.linspace(0, 1, 401)
    for target, tolerance in ((spline, 0.05), (spline.to_bspline(), 0.05), (Conic(1.5), 1e-4)):
        found = fit(tensor(3, 3), target, tolerance)
        assert (found.outcome, found.certified) == ("reached", True)
        apart = found.surface.grid(x, x) - target.grid(x, x)
        assert np.linalg.norm(apart.reshape(401, 401, -1), axis=2).max() <= found.error <= tolerance
        assert "error <= " in repr(found)


def test_a_peak_between_the_points_is_seen_where_the_error_is_a_bound():
    kv = KnotVector.uniform(3, 200)
    narrow = np.zeros((kv.dim, kv.dim))
    narrow[23, 151] = 1  # of height 4 / 9
    peak = BSplineSurface(kv, kv, narrow)
    bound, sampled = (fit(tensor(3, 2), target, 1e-3) for target in (peak, lambda u, v: peak(u, v)))
    assert (bound.certified, bound.outcome) == (True, "no progress")
    assert bound.error >= 0.4
    assert (sampled.certified, sampled.outcome) == (False, "reached")


def test_progress_is_told_after_every_fit():
    steps = []
    assert fit(tensor(3, 4), bump, 1e-3, progress=steps.append).history == tuple(steps)


def test_the_greatest_level_stops_the_fit():
    found = fit(tensor(3, 4), bump, 1e-6, max_level=2)
    assert found.outcome == "max level"
    assert found.surface.space.cells[:, 0].max() == 2
    assert found.error > 1e-6


def test_a_jump_makes_no_progress():
    found = fit(tensor(3, 4), lambda u, v: np.where(u > 0.4, 1.0, 0.0), 1e-3, max_level=20)
    assert found.outcome == "no progress"
    assert found.error == min(step.error for step in found.history)


def test_a_height_map_is_fitted_to_most_samples():
    g = np.linspace(0, 1, 121)
    samples = Samples.grid(g, g, bump(g[:, None], g))
    found = fit(tensor(3, 7), samples, 2e-3)
    assert found.outcome == "reached"
    assert found.error == pytest.approx(
        abs(found.surface(samples.u, samples.v) - samples.values).max(), rel=1e-12
    )
    # what is held out does not enter the fit
    values = samples.values.copy()
    values[held_out(len(values))] += 1
    moved = fit(tensor(3, 7), Samples(samples.u, samples.v, values), 2e-3, max_level=0)
    still = fit(tensor(3, 7), samples, 2e-3, max_level=0)
    assert np.array_equal(moved.surface.coefficients, still.surface.coefficients)
    assert moved.error > 0.9


def test_the_samples_held_out_are_no_lines_of_a_grid():
    """A ridge along one grid line must be seen, whatever the number of lines."""
    g, values = np.linspace(0, 1, 60), np.zeros((60, 60))
    values[:, 30] = 1
    found = fit(tensor(3, 4), Samples.grid(g, g, values), 0.2)
    truth = abs(found.surface.grid(g, g) - values).max()
    assert found.error == pytest.approx(truth, rel=1e-12)
    assert (found.outcome == "reached") == (truth <= 0.2)
    assert held_out(3600).sum() == 1200
    assert held_out(3600).reshape(60, 60).sum(axis=0).min() > 0
    assert held_out(3600).reshape(60, 60).sum(axis=0).max() < 60


def test_outliers_among_the_fitted_samples_count_and_those_of_zero_weight_do_not():
    g = np.linspace(0, 1, 41)
    clean = Samples.grid(g, g, smooth(g[:, None], g))
    k = np.flatnonzero(~held_out(len(clean)))[700]
    values, weights = clean.values.copy(), clean.weights.copy()
    values[k] += 5
    assert fit(tensor(3, 4), Samples(clean.u, clean.v, values), 1e-2, max_level=0).error > 3
    weights[k] = 0
    assert fit(tensor(3, 4), Samples(clean.u, clean.v, values, weights), 1e-2).outcome == "reached"


def test_refinement_that_float64_refuses_ends_the_fit():
    kv = KnotVector.uniform(1, 1, 1.0, 1.0 + 2.0**-50)
    space = THBSpace(kv, KnotVector.uniform(1, 1))
    found = fit(space, lambda u, v: np.where(v > 0.3, 1.0, 0.0), 1e-3, max_level=24)
    assert found.outcome == "smallest cells"
    assert (found.surface.space.levels, found.history[-1].dim) == (2, 25)


def test_a_fit_that_grows_too_large_ends(monkeypatch):
    monkeypatch.setattr(adaptive, "MOST_FUNCTIONS", 400)
    found = fit(tensor(3, 8), bump, 1e-6)
    assert found.outcome == "too large"
    assert max(step.dim for step in found.history) <= 400
    assert found.error == min(step.error for step in found.history)


GRID = np.linspace(0, 1, 61)
NOISE = 0.01 * np.random.default_rng(0).normal(size=(61, 61))


def grid(function, noise=0.0):
    return Samples.grid(GRID, GRID, function(GRID[:, None], GRID) + noise)


@pytest.mark.parametrize("smoothing", [0.0, 1e-9, "auto"])
@pytest.mark.parametrize("max_level", [1, 6])
def test_noise_ends_a_fit_as_soon_as_refinement_no_longer_helps(smoothing, max_level):
    found = fit(tensor(3, 4), grid(smooth, NOISE), 1e-3, max_level, smoothing)
    assert found.outcome == "noise"
    assert len(found.history) == 2
    assert found.rms == pytest.approx(0.01, rel=0.05)  # the noise of 1240 samples held out, to 2 %
    assert abs(found.surface.grid(GRID, GRID) - smooth(GRID[:, None], GRID)).max() <= 0.01


def test_detail_below_the_noise_is_still_refined():
    """Its greatest error never falls below that of the noise."""
    found = fit(tensor(3, 2), grid(lambda u, v: 0.02 * np.sin(20 * u), NOISE), 1e-3, smoothing="auto")
    assert found.outcome == "noise"
    assert found.surface.space.levels > 2
    assert abs(found.surface.grid(GRID, GRID) - 0.02 * np.sin(20 * GRID[:, None])).max() <= 0.01


def test_the_greatest_level_is_named_where_detail_is_left():
    for noise in (0.0, NOISE):
        assert fit(tensor(3, 4), grid(bump, noise), 1e-3, max_level=1).outcome == "max level"
    assert fit(tensor(3, 4), grid(smooth, NOISE), 1e-3, max_level=0).outcome == "max level"  # untried


def test_too_much_smoothing_makes_no_progress():
    found = fit(tensor(3, 4), grid(smooth, NOISE), 1e-3, smoothing=1e3)
    assert found.outcome == "no progress"
    assert len(found.history) <= 5


def test_a_space_of_more_functions_than_samples_is_not_fitted():
    """Smoothing would determine it."""
    samples = grid(lambda u, v: np.where(u + 0.3 * v > 0.5, 1.0, 0.0))
    found = fit(tensor(3, 8), samples[::9], 1e-3, smoothing=1e-6)
    assert found.outcome == "too few samples"
    assert found.history[-1].dim <= np.count_nonzero(~held_out(len(samples[::9])))


def test_the_rms_is_that_of_samples_held_out():
    samples = grid(bump, NOISE)
    found = fit(tensor(3, 8), samples, 1e-3)
    hidden = samples[held_out(len(samples))]
    apart = found.surface(hidden.u, hidden.v) - hidden.values
    assert found.rms == pytest.approx(np.sqrt(np.mean(apart**2)), rel=1e-12)
    assert found.rms == min(step.rms for step in found.history)
    assert (found.error, found.rms) in [(step.error, step.rms) for step in found.history]


def test_the_rms_of_a_function_is_that_of_its_area():
    found = fit(tensor(3, 4), bump, 1e-3)
    u, v = everywhere(np.random.default_rng(0), 40000)
    apart = np.sqrt(np.mean((found.surface(u, v) - bump(u, v)) ** 2))
    assert found.rms == pytest.approx(apart, rel=0.05)


@pytest.fixture(scope="module")
def spiked():
    """A bump, and the same with noise and 0.5 % outliers as high as the bump."""
    clean = grid(bump)
    values = clean.values + NOISE.ravel() / 10
    outliers = np.arange(7, len(values), 200)
    values[outliers] += np.random.default_rng(0).choice([-1, 1], len(outliers))
    return clean, Samples(clean.u, clean.v, values), outliers


@pytest.mark.slow
def test_a_robust_fit_reaches_the_tolerance_beside_outliers(spiked):
    clean, bad, outliers = spiked
    found = fit(tensor(3, 8), bad, 5e-2, robust=True)
    assert found.outcome == "reached"
    assert abs(found.surface(clean.u, clean.v) - clean.values).max() <= 6e-2
    assert (robust_weights(found.surface, bad)[outliers] == 0).all()
    plain = fit(tensor(3, 8), bad, 5e-2)
    assert plain.outcome != "reached"
    assert plain.error > 0.5


@pytest.mark.every(3)
@pytest.mark.parametrize("tolerance", [3e-2, 1e-2, 3e-3])
def test_a_robust_fit_that_is_wild_in_a_gap_has_reached_nothing(spiked, tolerance):
    """Where a cell is left with hardly a sample the surface may differ from good samples by far."""
    clean, bad, _ = spiked
    found = fit(tensor(3, 8), bad, tolerance, robust=True)
    truth = abs(found.surface(clean.u, clean.v) - clean.values).max()
    assert truth <= found.error + 5e-3  # 5 standard deviations of the noise


@pytest.mark.slow
@pytest.mark.parametrize("size", [2.0**-700, 2.0**600])
def test_a_fit_of_great_values_is_the_fit_of_small_ones(size):
    """Squares of these are 0 or infinite in float64."""
    small = grid(bump, NOISE)
    found = fit(tensor(3, 4), small, 0.1, smoothing=1e-5, robust=True)
    great = Samples(small.u, small.v, size * small.values)
    scaled = fit(tensor(3, 4), great, 0.1 * size, smoothing=1e-5, robust=True)
    assert np.array_equal(scaled.surface.coefficients, size * found.surface.coefficients)
    assert (scaled.outcome, scaled.error) == (found.outcome, size * found.error)
    assert scaled.rms == pytest.approx(size * found.rms, rel=1e-12)


def test_too_few_samples_end_the_fit():
    u, v = np.random.default_rng(0).random((2, 500))
    found = fit(tensor(3, 6), Samples(u, v, bump(u, v)), 1e-3)
    assert found.outcome == "too few samples"
    assert found.surface.space.dim == found.history[-1].dim == 81
    with pytest.raises(Underdetermined):
        fit(tensor(3, 6), Samples(u[:60], v[:60], u[:60]), 1e-3)


@given(knot_vectors(max_degree=6, scales=(1.0,)), knot_vectors(max_degree=6, scales=(1.0,)), seeds())
def test_surroundings_make_room_for_functions_of_the_next_level(kv_u, kv_v, rng):
    space = THBSpace(kv_u, kv_v)
    k = [rng.integers(len(space.cells))]
    finer = space.refine(surroundings(space, space.cells[k]))
    u0, u1, v0, v1 = space.boxes[k].T
    u, v = (u0 + u1) / 2, (v0 + v1) / 2
    new = finer.functions[:, 0] == 1
    assert (finer.collocation(u, v).toarray()[0, new] > 0).any()


def test_surroundings_across_levels_take_the_coarser_cells_and_not_the_finer():
    space = refined(3, 8, 4)
    near = surroundings(space, np.array([[1, 7, 7]]))
    assert {level: cells.tolist() for level, cells in near.items()} == {
        0: [[3, 4], [4, 3], [4, 4]],
        1: [[6, 6], [6, 7], [7, 6], [7, 7]],
    }
    outside = surroundings(space, np.array([[0, 4, 4]]))
    assert outside[0].tolist() == [[3, 4], [3, 5], [4, 3], [4, 4], [4, 5], [5, 3], [5, 4], [5, 5]]
    assert list(outside) == [0]


def test_bad_input_is_refused():
    g = np.linspace(0, 1, 9)
    samples = Samples.grid(g, g, np.zeros((9, 9)))
    for level in (-1, 25, 2.0, None):
        with pytest.raises(ValueError, match="max_level must be an integer from 0 to 24, got"):
            fit(tensor(2, 3), samples, 1e-3, max_level=level)
    few = Samples(samples.u, samples.v, samples.values, np.arange(81) < 2)
    for two in (samples[:2], few):
        with pytest.raises(ValueError, match="at least 3 samples of positive weight, got 2"):
            fit(tensor(2, 3), two, 1e-3)
    for keywords in ({"smoothing": "auto"}, {"robust": True}):
        with pytest.raises(ValueError, match="chosen smoothing and robust weights need samples"):
            fit(tensor(2, 3), bump, 1e-3, **keywords)


# ---- the example ----


@pytest.mark.slow
def test_the_height_map_example(tmp_path):
    spec = importlib.util.spec_from_file_location("height_map", EXAMPLE)
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    table = example.main(tmp_path / "picture.png")
    dims, errors, uniform, _ = zip(*table)
    assert uniform == (100, 289, 961, 3481, 13225)
    # level 4 of the THB fit has the error of uniform level 3 divided by five, with fewer control points
    assert dims[-1] == 2224
    assert errors[-1] < table[3][3] / 5
    assert (tmp_path / "picture.png").stat().st_size > 20_000
