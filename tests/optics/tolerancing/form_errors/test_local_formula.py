"""The local formula against closed forms, against Snell's law in numpy, and against the exact trace."""

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.tolerancing.form_errors import local_formula_of
from optics.tolerancing.perturbations import HeightSum, Power, Sine
from tests.optics.tolerancing.form_errors.cases import (
    COUNTS,
    FAR,
    PLATE,
    POINT,
    relative_error,
    system_and_lens,
)

INDEX, THICKNESS = 1.5, 6.0
SIDES = ("front", "rear")


def formula_of(folder, backend, side="rear", changes=None, bumps=0.0, counts=COUNTS):
    system, lens = system_and_lens(folder, changes, bumps)
    return local_formula_of(system.with_lens(lens), side, backend, counts)


def tangent(slope):
    """Return the tangents of light along z in the glass that leaves a rear of that slope, (2, ...)."""
    normal = np.stack([-slope[0], -slope[1], np.ones_like(slope[0])]) / np.sqrt(1 + (slope**2).sum(axis=0))
    cos_t = np.sqrt(1 - INDEX**2 * (1 - normal[2] ** 2))
    out = (cos_t - INDEX * normal[2]) * normal
    return out[:2] / (out[2] + INDEX)


def snell_jacobian(slope, step=1e-6):
    """Return dtan / dslope, (2, 2, ...), by central differences of Snell's law in numpy."""
    columns = [(tangent(slope + d) - tangent(slope - d)) / (2 * step) for d in _steps(slope, step)]
    return np.stack(columns, axis=1)


def _steps(slope, step):
    for k in (0, 1):
        d = np.zeros_like(slope)
        d[k] = step
        yield d


@pytest.mark.parametrize(("side", "throw"), [("rear", 200.0), ("front", -(200.0 + THICKNESS / INDEX))])
def test_a_slope_on_a_plate_turns_light_by_n_minus_1(tmp_path, backend, side, throw):
    """Light of a front's error is turned the other way, and walks on its way to the rear."""
    formula = formula_of(tmp_path, backend, side, PLATE)
    wanted = throw * (INDEX - 1) * np.eye(2)[:, :, None, None] + np.zeros_like(formula.by_slope)
    np.testing.assert_allclose(formula.by_slope, wanted, rtol=1e-7, atol=1e-5)
    np.testing.assert_allclose(formula.by_height, 0, atol=1e-6)


@pytest.mark.parametrize("period", [5.0, 2.0])
def test_on_a_plate_the_linear_change_is_the_laplacian_times_the_mtf_of_the_pixels(tmp_path, backend, period):
    """dE / E = -L (n - 1) laplace(dh), and a pixel of width p leaves sinc(p / period) of it."""
    formula = formula_of(tmp_path, backend, "rear", PLATE, counts=(224, 224))
    error, image = Sine(1e-6, period, 0.0, 0.3), formula.irradiance
    x, _ = formula.screen.centres
    rate = 2 * np.pi / period
    mtf = np.sinc(formula.screen.pitch[0] / period)
    wanted = 200 * (INDEX - 1) * rate**2 * 1e-6 * np.sin(rate * x + 0.3) * mtf
    lit = slice(4, -4)  # light ends at 9.5 of 10 mm
    for found in (formula.linear_change(error), formula.change(error)):
        assert relative_error((found[lit, lit] / image[lit, lit]), np.tile(wanted, (48, 1))[lit, lit]) < 1e-2


def test_behind_a_paraboloid_the_throw_is_the_local_one_and_the_slope_turns_by_snell(tmp_path, backend):
    formula = formula_of(tmp_path, backend, changes={"lens.rear.radius": 30.0})
    x = formula.points
    throw = 60.0 - (x**2).sum(axis=0) / 60.0  # from the rear, whose height is r^2 / (2 R), to the target
    wanted = throw * snell_jacobian(x / 30.0)
    np.testing.assert_allclose(formula.by_slope, wanted, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(formula.by_height, -tangent(x / 30.0), rtol=1e-6, atol=1e-6)


def test_at_a_slope_of_a_third_light_turns_by_more_than_n_minus_1():
    jacobian = snell_jacobian(np.array([[0.33], [0.0]]))[:, :, 0]
    assert jacobian[0, 0] == pytest.approx(0.57, abs=1e-3)
    assert jacobian[0, 0] > jacobian[1, 1] > INDEX - 1


def test_the_map_of_a_paraboloid_is_known_in_closed_form(tmp_path, backend):
    """X = x + (L - z) tan(x / R) along the middle line."""
    formula = formula_of(tmp_path, backend, changes={"lens.rear.radius": 30.0})
    middle = COUNTS[1] // 2
    x, step = formula.points[0, :, middle], 1e-5

    def landing(at):
        slope = np.stack([at / 30.0, np.zeros_like(at)])
        return at + (60.0 - at**2 / 60.0) * tangent(slope)[0]

    wanted = (landing(x + step) - landing(x - step)) / (2 * step)
    np.testing.assert_allclose(formula.by_source[0, 0, :, middle], wanted, rtol=1e-7)
    np.testing.assert_allclose(formula.nominal.landing[0, :, middle], landing(x), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("side", "changes"),
    [
        ("rear", None),
        ("front", None),
        ("rear", POINT),
        ("front", POINT | {"lens.front.radius": 80.0}),
        ("rear", FAR),
    ],
    ids=("rear", "front", "rear, point", "curved front, point", "rear, far field"),
)
def test_moved_cells_make_the_light_of_the_exact_trace(tmp_path, backend, side, changes):
    formula = formula_of(tmp_path, backend, side, changes, bumps=0.02)
    error = HeightSum(((1.0, Sine(2e-4, 4.0, 30.0, 0.3)), (1.0, Power(3e-6)), (1.0, Sine(1e-4, 1.5, 100.0))))
    exact = formula.traced_irradiance(error)
    assert relative_error(exact, formula.irradiance) > 0.01  # the error is seen
    assert (
        relative_error(formula.moved_irradiance(error) - formula.irradiance, exact - formula.irradiance)
        < 1e-3
    )


@pytest.mark.parametrize("side", SIDES)
def test_the_linear_change_is_the_limit_of_small_errors(tmp_path, backend, side):
    formula = formula_of(tmp_path, backend, side, bumps=0.02)
    error = Sine(1e-6, 3.0, 60.0)
    up, down = (formula.traced_irradiance(HeightSum(((sign, error),))) for sign in (1, -1))
    assert relative_error(formula.linear_change(error), (up - down) / 2) < 1e-2


@pytest.mark.parametrize("period", [5.0, 2.0])
def test_curvature_and_transport_term_are_the_change_where_the_light_is_smooth(tmp_path, backend, period):
    formula = formula_of(tmp_path, backend, "rear", counts=(224, 224))
    error = Sine(1e-6, period, 25.0, 0.7)
    dark = formula.irradiance < 0.5 * formula.irradiance.mean()
    wide = np.pad(dark, 4, constant_values=True)
    inside = ~np.any([np.roll(wide, (i, j), (0, 1)) for i in range(-4, 5) for j in range(-4, 5)], axis=0)[
        4:-4, 4:-4
    ]
    exact = formula.linear_change(error)
    assert relative_error(formula.change(error)[inside], exact[inside]) < 0.1


def test_a_side_that_is_none_is_refused(tmp_path, backend):
    with pytest.raises(UserError, match='must be "front" or "rear", got \'edge\''):
        formula_of(tmp_path, backend, "edge")


@pytest.mark.parametrize(
    "changes",
    [
        {"source.divergence": 0.5},
        {"lens.rear.slope_rms": 0.001},
        {"source.kind": "lambertian", "source.distance": 30.0, "source.half_width": [1.0, 1.0]},
    ],
)
def test_blurred_light_is_refused_in_a_sentence(tmp_path, backend, changes):
    with pytest.raises(UserError, match=r"sharp light.*take a point or a parallel beam"):
        formula_of(tmp_path, backend, changes=changes)
