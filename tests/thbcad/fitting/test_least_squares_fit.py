"""Interpolation and least squares against scipy; the order of convergence of all fits."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from scipy.interpolate import LSQBivariateSpline, make_interp_spline, make_lsq_spline

from oracles.spline_definitions import gamma, gauss
from tests.cases import examples, slow_unless
from tests.thbcad.cases import knot_vectors, scipy_twin, seeds, spaces
from tests.thbcad.fitting.cases import everywhere, refined, smooth, tensor
from thbcad.fitting.adaptive_fit import fit
from thbcad.fitting.least_squares_fit import Samples, least_squares
from thbcad.fitting.normal_equations import Underdetermined, thin_plate
from thbcad.fitting.quasi_interpolant import quasi_interpolate
from thbcad.hierarchy import THBSpace
from thbcad.splines import KnotVector, interpolate
from thbcad.surfaces import THBSurface

EPS = np.finfo(float).eps


# ---- interpolation ----


@given(knot_vectors(max_degree=6), knot_vectors(max_degree=6), seeds())
def test_interpolation_takes_the_values_and_agrees_with_scipy(kv_u, kv_v, rng):
    values = rng.uniform(-1, 1, (kv_u.dim, kv_v.dim, 2))
    surface = interpolate(kv_u, kv_v, values)
    u, v = kv_u.greville(), kv_v.greville()
    size = np.abs(surface.coefficients).max()
    # backward stable solves: the residual is small against matrix (norm 1) times coefficients
    assert abs(surface.grid(u, v) - values).max() <= float(gamma(8 * (kv_u.dim + kv_v.dim))) * size
    by_u = make_interp_spline(u, values, kv_u.degree, kv_u.knots).c
    twin = make_interp_spline(v, by_u.swapaxes(0, 1), kv_v.degree, kv_v.knots).c.swapaxes(0, 1)
    inverses = [
        np.linalg.norm(np.linalg.inv(kv.collocation(x).toarray()), np.inf) for kv, x in ((kv_u, u), (kv_v, v))
    ]
    assert abs(surface.coefficients - twin).max() <= float(gamma(8 * (kv_u.dim + kv_v.dim))) * size * np.prod(
        inverses
    )


def test_interpolation_reproduces_splines_from_functions():
    kv_u, kv_v = KnotVector(3, [0, 0, 0, 0, 1, 1.5, 1.5, 3, 3, 3, 3]), KnotVector.uniform(2, 4)
    surface = interpolate(kv_u, kv_v, lambda u, v: np.stack([u**3 - v, u * v**2], axis=1))
    assert surface.coefficients.shape == (7, 6, 2)
    again = interpolate(kv_u, kv_v, surface)
    assert (
        abs(again.coefficients - surface.coefficients).max() <= 1e-13 * 27
    )  # the greatest coefficient, the condition is below 100
    u, v = np.array([0.2, 2.9]), np.array([0.7, 0.1])
    assert surface(u, v) == pytest.approx(np.stack([u**3 - v, u * v**2], axis=1), abs=1e-13)


# ---- order of convergence ----


def by_least_squares(space):
    u, v, weights, _ = space.quadrature()
    return least_squares(space, Samples(u, v, smooth(u, v), weights))


METHODS = {
    "interpolate": lambda space: interpolate(space.kv_u, space.kv_v, smooth),
    "quasi_interpolate": lambda space: quasi_interpolate(space, smooth),
    "least_squares": by_least_squares,
}


@pytest.mark.every(5)
@pytest.mark.parametrize("degree", slow_unless((1, 2, 3, 4).count, range(1, 6)))
@pytest.mark.parametrize("method", METHODS)
def test_the_error_falls_with_order_p_plus_1(method, degree):
    u, v = everywhere(np.random.default_rng(0))
    spans = np.array([16, 32, 64])
    errors = [abs(METHODS[method](tensor(degree, n))(u, v) - smooth(u, v)).max() for n in spans]
    slope = np.polyfit(np.log(spans), np.log(errors), 1)[0]
    # orders are whole numbers; what is not yet asymptotic at 64 spans is far below a half
    assert slope == pytest.approx(-(degree + 1), abs=0.25)


# ---- least squares ----


@given(spaces(max_degree=4, max_spans=4), seeds())
def test_least_squares_gives_splines_of_the_space_back(space, rng):
    surface = THBSurface(space, rng.uniform(-1, 1, (space.dim, 3)))
    u, v, _, _ = space.quadrature()
    found = least_squares(space, Samples(u, v, surface(u, v)))
    a = space.collocation(u, v).toarray()
    scaled = a / np.linalg.norm(a, axis=0)
    # two solves of the scaled normal equations are as good as an orthogonal factorisation: the error grows
    # with the condition only
    condition = np.linalg.cond(scaled) * np.linalg.norm(a, axis=0).max() / np.linalg.norm(a, axis=0).min()
    assert abs(found.coefficients - surface.coefficients).max() <= 10 * len(u) * EPS * condition


def test_least_squares_of_a_grid_is_scipy_in_both_directions():
    kv_u, kv_v = KnotVector.uniform(3, 6), KnotVector(2, [0, 0, 0, 0.3, 0.3, 0.6, 1, 1, 1])
    x, y = np.linspace(0, 1, 31), np.linspace(0, 1, 23)
    values = np.random.default_rng(0).normal(size=(31, 23))
    space = THBSpace(kv_u, kv_v)
    found = least_squares(space, Samples.grid(x, y, values)).coefficients.reshape(kv_u.dim, kv_v.dim)
    by_u = make_lsq_spline(x, values, kv_u.knots, 3).c
    twin = make_lsq_spline(y, by_u.T, kv_v.knots, 2).c.T
    assert abs(found - twin).max() <= 1e-12


def test_weighted_least_squares_of_scattered_points_is_fitpack():
    rng = np.random.default_rng(1)
    u, v = rng.random((2, 600))
    values, weights = rng.normal(size=600), rng.uniform(0.1, 2, 600)
    kv = KnotVector.uniform(3, 5)
    inner = kv.breaks[1:-1]
    # FITPACK's weights multiply the residuals
    twin = LSQBivariateSpline(u, v, values, inner, inner, np.sqrt(weights), [0, 1, 0, 1], 3, 3, eps=1e-15)
    found = least_squares(THBSpace(kv, kv), Samples(u, v, values, weights))
    assert (
        abs(found.coefficients - twin.get_coeffs()).max() <= 1e-10
    )  # the condition is about 100, FITPACK's knots agree


def test_weights_move_the_solution():
    space = refined(2)
    u, v, _, _ = space.quadrature()
    both = Samples(np.tile(u, 2), np.tile(v, 2), np.repeat([0.0, 1.0], len(u)), np.repeat([1.0, 3.0], len(u)))
    assert least_squares(space, both).coefficients == pytest.approx(0.75, abs=1e-12)
    late = Samples(both.u, both.v, both.values, np.repeat([0.0, 3.0], len(u)))
    assert least_squares(space, late).coefficients == pytest.approx(1.0, abs=1e-12)


@given(spaces(max_degree=4, max_spans=3, deepest=2), seeds())
@examples(20)
def test_thin_plate_energy_against_scipy_derivatives(space, rng):
    """c^T E c is the integral of the squared second derivatives, by finer quadrature of scipy's
    derivatives."""
    surface = THBSurface(space, rng.uniform(-1, 1, space.dim))
    flat = surface.to_bspline()
    (u, wu), (v, wv) = (gauss(kv.breaks, kv.degree + 3) for kv in flat.knot_vectors)
    twin = scipy_twin(flat)
    at = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1)
    parts = [
        factor * twin(at, nu=nu) ** 2
        for nu, factor in (((2, 0), 1), ((1, 1), 2), ((0, 2), 1))
        if nu[0] <= flat.kv_u.degree and nu[1] <= flat.kv_v.degree
    ]
    want = np.einsum("i,j,ij", wu, wv, sum(parts))
    c, energy = surface.coefficients, thin_plate(space)
    assert c @ (energy @ c) == pytest.approx(want, rel=1e-10, abs=1e-12)
    plane = quasi_interpolate(space, lambda u, v: 1 + 2 * u - 3 * v).coefficients
    assert abs(energy @ plane).max() <= 1e-12 * abs(energy).max() * abs(plane).max()


def test_the_energy_of_a_polynomial():
    """s = u^2 v on the unit square: s_uu = 2 v, s_uv = 2 u, the integral of 4 v^2 + 8 u^2 is 4."""
    space = refined(3)
    c = quasi_interpolate(space, lambda u, v: u**2 * v).coefficients
    assert c @ (thin_plate(space) @ c) == pytest.approx(4, rel=1e-12)


def test_smoothing_against_dense_least_squares():
    """The stationary point of the penalised problem, from stacked residuals with a square root of the
    energy."""
    space, rng = refined(3), np.random.default_rng(2)
    u, v = rng.random((2, 150))  # too few points without smoothing
    values, smoothing = rng.normal(size=150), 1e-4
    eigenvalues, vectors = np.linalg.eigh(thin_plate(space).toarray())
    root = np.sqrt(np.maximum(eigenvalues, 0) * smoothing)[:, None] * vectors.T
    stacked = np.vstack([space.collocation(u, v).toarray(), root])
    want = np.linalg.lstsq(stacked, np.r_[values, np.zeros(space.dim)])[0]
    # eigh is exact to eps |E|, which acts on the smooth part like noise
    assert least_squares(space, Samples(u, v, values), smoothing).coefficients == pytest.approx(
        want, abs=1e-7
    )


def test_great_smoothing_gives_the_least_squares_plane():
    g = (np.arange(30) + 0.5) / 30
    heights = Samples.grid(g, g, np.sin(3 * g)[:, None] + g**2)
    columns = np.column_stack([np.ones(900), heights.u, heights.v])
    plane = columns @ np.linalg.lstsq(columns, heights.values)[0]
    errors = [
        abs(least_squares(refined(3), heights, s)(heights.u, heights.v) - plane).max()
        for s in (1e3, 1e4, 1e5)
    ]
    assert errors[0] < 2e-3
    # what is left falls with 1 / smoothing
    assert np.array(errors[:-1]) / errors[1:] == pytest.approx(10, rel=0.02)


@pytest.mark.parametrize("size", [2.0**-900, 2.0**600, 2.0**1000])
def test_values_and_weights_of_any_size_give_the_same_digits(size):
    space, rng = refined(3), np.random.default_rng(0)
    u, v = everywhere(rng, 1000)
    samples = Samples(u, v, rng.uniform(-1, 1, 1000), rng.uniform(0.5, 1, 1000))
    for smoothing in (0.0, 1e-3):
        found = least_squares(space, samples, smoothing).coefficients
        great = Samples(u, v, size * samples.values, samples.weights)
        assert np.array_equal(least_squares(space, great, smoothing).coefficients, size * found)
        heavy = Samples(u, v, samples.values, size * samples.weights)
        assert np.array_equal(least_squares(space, heavy, size * smoothing).coefficients, found)


# ---- samples that do not determine the spline ----


def test_a_function_without_samples_is_named():
    space = refined(3)
    u, v, _, _ = space.quadrature()
    far = (u > 0.25) | (v > 0.2)
    with pytest.raises(
        Underdetermined, match=r"functions have no sample in their support.*\(level, i, j\) = \(1, 0, 0\)"
    ):
        least_squares(space, Samples(u[far], v[far], u[far]))


@pytest.mark.parametrize("robust", [False, True])
@pytest.mark.parametrize("samples", [Samples([], [], []), Samples([0.1], [0.1], [1.0], [0.0])], ids=len)
def test_samples_without_weight_determine_nothing(samples, robust):
    with pytest.raises(Underdetermined, match="25 of 25 functions have no sample in their support"):
        least_squares(tensor(2, 3), samples, robust=robust)


def test_a_function_with_too_few_samples_is_named():
    """Functions 4 and 5 in u live where all samples lie on one line: only their sum there is known."""
    u, v, _, _ = tensor(2, 4).quadrature()
    u = np.where(u > 0.5, 0.9, u)
    with pytest.raises(
        Underdetermined, match=r"do not determine function \d+ \(level, i, j\) = \(0, [45], \d\) apart from"
    ):
        least_squares(tensor(2, 4), Samples(u, v, v))


@given(seeds())
def test_underdetermined_exactly_when_the_rank_is_short(rng):
    space = refined(int(rng.integers(1, 5)), 4, 3)
    u, v = rng.random((2, int(space.dim * rng.uniform(1, 6))))
    a = space.collocation(u, v).toarray()
    least = np.linalg.svd(a / np.maximum(np.linalg.norm(a, axis=0), EPS), compute_uv=False)[-1]
    samples = Samples(u, v, np.ones(len(u)))
    # the normal equations see squares: they lose a singular value at the root of dim eps
    edge = np.sqrt(space.dim * EPS)
    if least < edge / 2:
        with pytest.raises(Underdetermined):
            least_squares(space, samples)
    elif least > 2 * edge:
        assert abs(least_squares(space, samples)(u, v) - 1).max() <= 1e-6
    with pytest.raises(Underdetermined):
        least_squares(space, samples[: space.dim - 1])


def test_three_points_and_smoothing_determine_a_plane_two_do_not():
    space = refined(2)
    u, v, z = np.array([[0.1, 0.9, 0.4], [0.2, 0.3, 0.8], [1.0, 2.0, -1.0]])
    surface = least_squares(space, Samples(u, v, z), 1e-3)
    assert surface(u, v) == pytest.approx(z, abs=1e-9)
    with pytest.raises(Underdetermined):
        least_squares(space, Samples(u[:2], v[:2], z[:2]), 1e-3)


# ---- bad input ----


def test_functions_with_wrong_values_are_refused():
    space = tensor(2, 3)
    for method in (
        quasi_interpolate,
        lambda s, f: interpolate(s.kv_u, s.kv_v, f),
        partial(fit, tolerance=1e-3),
    ):
        with pytest.raises(ValueError, match=r"the function is not finite at u = 0\.\d+, v = "):
            method(space, lambda u, v: np.where(u > 0.4, np.nan, u))
        with pytest.raises(ValueError, match=r"must return .* got shape \(\)"):
            method(space, lambda u, v: 1.0)


def test_interpolation_refuses_bad_values():
    kv = KnotVector.uniform(2, 3)
    with pytest.raises(ValueError, match=r"shape \(5, 5\)"):
        interpolate(kv, kv, np.zeros((4, 5)))
    with pytest.raises(ValueError, match="finite"):
        interpolate(kv, kv, np.full((5, 5), np.nan))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0.1, 0.2], [0.1], [1.0, 2.0]), r"got shapes u \(2,\), v \(1,\), values \(2,\), weights \(2,\)"),
        (([0.1], [0.1], 1.0), r"values \(\)"),
        (([0.1], [0.1], [[[1.0]]]), r"values \(1, 1, 1\)"),
        (([0.1], [0.1], [1.0], [1.0, 2.0]), r"weights \(2,\)"),
        (([0.1, np.nan], [0.1, 0.1], [1.0, 2.0]), r"u\[1\] is not finite"),
        (([0.1, 0.1], [0.1, 0.1], [[1.0, 2.0], [3.0, np.inf]]), r"values\[1\] is not finite"),
        (([0.1, 0.2], [0.1, 0.2], [1.0, 2.0], [1.0, -2.0]), r"got weights\[1\] = -2.0"),
    ],
)
def test_bad_samples_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        Samples(*arguments)


def test_other_bad_input_is_refused():
    g = np.linspace(0, 1, 9)
    with pytest.raises(ValueError, match=r"needs values \(n_u, n_v\), got shape \(9, 8\)"):
        Samples.grid(g, g, np.zeros((9, 8)))
    with pytest.raises(ValueError, match=r"u = 1\.5 lies outside the domain"):
        least_squares(tensor(2, 3), Samples([0.1, 1.5], [0.1, 0.2], [0.0, 0.0]))


def test_least_squares_keeps_its_digits_at_degree_10():
    """With columns of length 1, A has the condition 8e5 and A^T A its square: the coefficients settle after
    four corrections."""
    space = refined(10, 12, 9)
    u, v = everywhere(np.random.default_rng(0), 8 * space.dim)
    surface = THBSurface(space, np.random.default_rng(1).uniform(-1, 1, space.dim))
    found = least_squares(space, Samples(u, v, surface(u, v)))
    # the condition of A times some EPS in the samples
    assert abs(found.coefficients - surface.coefficients).max() <= 8e5 * 10 * EPS


def test_the_advice_knows_that_smoothing_is_there():
    space = tensor(3, 4)
    u, v = everywhere(np.random.default_rng(0), 400)
    samples = Samples(u, v, smooth(u, v))
    with pytest.raises(Underdetermined, match=r"refine less, or choose another smoothing than 1e\+300"):
        least_squares(space, samples, 1e300)
