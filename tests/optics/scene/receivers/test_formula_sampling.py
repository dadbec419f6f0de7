"""What a formula means over the target: position, the mean over a pixel, any scale."""

import re

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

from optics.base.runtime import UserError
from optics.scene.problem import load_problem
from optics.scene.receivers.formula import BAND_POINTS, SUBPOINTS, formula_light, formula_pixels
from optics.scene.receivers.formula_syntax import MAX_LENGTH
from optics.scene.receivers.regions import uniform_region
from optics.scene.system import System, target_irradiance
from tests.cases import examples
from tests.optics.cases import write_problem
from tests.optics.scene.receivers.cases import EVEN, EXAMPLE, MANY, PLAIN, expressions, means, refusal

FEW = examples(100)


# ---- where it is ----


def test_row_0_is_the_top_and_column_0_the_left():
    light = formula_light("(y > 0.5) * (x < -0.75)", (8, 4))
    wanted = np.zeros((4, 8))
    wanted[0, 0] = 1.0
    np.testing.assert_array_equal(light, wanted)


def test_the_target_shows_the_formula_upright(tmp_path):
    """Light at the upper right, on a target twice as wide as high."""
    changes = {
        "target.half_width": [20.0, 10.0],
        "target.pixels": [32, 16],
        "target.formula": "(x > 0.5) * (y > 0)",
    }
    problem = load_problem(
        write_problem(tmp_path, {"target.kind": "function"} | changes, drop=("target.image",))
    )
    light = System(problem).target.light
    screen = System(problem).target.screen()
    target = target_irradiance(light, screen, problem.target.placing, 3.0)
    assert light.shape == target.shape == (16, 32)
    wanted = np.zeros((16, 32))
    wanted[:8, 24:] = 3.0 / (64 * screen.pixel_area)
    np.testing.assert_allclose(target, wanted, rtol=1e-14)


@given(
    part=expressions(EVEN),
    pixels=st.tuples(st.integers(2, 45), st.integers(2, 45)),
    subpoints=st.sampled_from([1, 3, 5, SUBPOINTS]),
)
@FEW
def test_symmetric_formulas_give_symmetric_light_bit_for_bit(part, pixels, subpoints):
    try:
        light = formula_light(f"abs({part[0]})", pixels, subpoints)
    except UserError:
        assume(False)
    np.testing.assert_array_equal(light, light[:, ::-1])
    np.testing.assert_array_equal(light, light[::-1])


@pytest.mark.parametrize("pixels", [(37, 41), (160, 160), (255, 130)])
def test_the_example_is_symmetric_bit_for_bit_over_many_bands(pixels):
    light = formula_light(EXAMPLE, pixels)
    assert light.size * SUBPOINTS**2 > BAND_POINTS
    np.testing.assert_array_equal(light, light[:, ::-1])
    np.testing.assert_array_equal(light, light[::-1])


def test_bands_make_up_the_whole():
    pixels = (90, 70)
    np.testing.assert_allclose(formula_light(EXAMPLE, pixels), means(PLAIN[EXAMPLE], pixels), atol=1e-14)


# ---- how well a pixel's mean is known ----


def test_means_of_smooth_light_converge_with_the_square_of_the_points():
    """The mean of cos(a x) over a pixel of width w is cos(a x) sin(a w / 2) / (a w / 2) at its middle."""
    n, a = 40, 8 * np.pi
    middles = (2 * np.arange(n) + 1) / n - 1
    exact = 1 + 0.5 * np.cos(a * middles) * np.sinc(a / n / np.pi)
    errors = []
    for subpoints in (1, 2, 4, 8):
        light = formula_light("1 + 0.5 * cos(8 * pi * x)", (n, n), subpoints)[0]
        errors.append(
            np.abs(light / light.mean() - exact).max()
        )  # whole waves: the mean over the target is 1
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(rates, 2, atol=0.1)  # (a w)^2 / 40, the next term of the series, is 0.04
    assert errors[-1] < 1e-3


def test_edges_are_known_to_a_fraction_of_a_percent():
    """Beside the region of the same shape, which is exact along y: points of a grid within a curve converge
    faster than 1 / n."""
    exact = uniform_region("ellipse", (160, 160), (0.75, 0.75))
    one, two, many = (
        np.linalg.norm(formula_light("x^2 + y^2 <= 0.75^2", (160, 160), n) - exact) / np.linalg.norm(exact)
        for n in (1, 2, SUBPOINTS)
    )
    assert two < one / 2
    assert many < two / (SUBPOINTS / 2)
    assert many < 2.5e-3


# ---- any scale ----


@pytest.mark.parametrize("scale", ["1e-300", "1e308", "1e-12", "3e7"])
def test_the_scale_does_not_matter(scale):
    light = formula_light(f"{scale} * (1 + 0.5 * cos(9 * x))", (20, 10))
    np.testing.assert_allclose(light, formula_light("1 + 0.5 * cos(9 * x)", (20, 10)), rtol=1e-13)
    assert light.max() == 1


@pytest.mark.parametrize("text", PLAIN)
def test_formulas_are_as_numpy_computes_them(text):
    """To 1e-12 of the brightest pixel: terms of size 4 at most, a few thousand roundings of 1e-16."""
    np.testing.assert_allclose(formula_light(text, (24, 14)), means(PLAIN[text], (24, 14)), atol=1e-12)


def test_a_plus_sign_changes_nothing():
    np.testing.assert_array_equal(formula_light("+(2 + x)", (9, 5)), formula_light("2 + x", (9, 5)))


@given(part=expressions(), pixels=st.tuples(st.integers(2, 6), st.integers(2, 6)))
@MANY
def test_random_formulas_are_as_an_independent_evaluator_has_them(part, pixels):
    """The same operations in the same order at every place: only the means are rounded otherwise."""
    text, _, function = part
    columns, rows = pixels
    counts = [n * SUBPOINTS for n in pixels]

    def values_at(x, y):
        with np.errstate(all="ignore"):
            return np.broadcast_to(np.abs(function(x[None, :], -y[:, None])), (y.size, x.size))

    values = values_at(*((2 * np.arange(n) + 1 - n) / n for n in counts))
    text = f"abs({text})"
    if not np.isfinite(values).all():
        assert re.match(r"target\.formula is (not a number|infinite) at x = ", refusal(text, pixels))
    elif not values.any():
        between = (values_at(*(np.linspace(-1, 1, n + 1) for n in counts)) > 0).any()
        assert ("only between" if between else "0 everywhere") in refusal(text, pixels)
    else:
        assume(values.max() > 1e-290)  # below, numbers have fewer digits
        light = (values / values.max()).reshape(rows, SUBPOINTS, columns, SUBPOINTS).mean(axis=(1, 3))
        np.testing.assert_allclose(formula_light(text, pixels), light / light.max(), rtol=1e-13, atol=1e-300)


def test_pixels_are_lit_wholly_where_no_sample_point_is_dark():
    """A disk that is shifted; of a pixel outside the disk or on its rim the farthest sample point is out."""
    pixels, text = (30, 20), "where(hypot(x - 0.1, y - 0.2) < 0.7, 3, 0)"
    ends = [
        np.abs((2 * np.arange(n) + 1) / n - 1 - at) + (1 - 1 / SUBPOINTS) / n
        for n, at in zip(pixels, (0.1, -0.2))
    ]
    wanted = np.hypot(ends[0][None, :], ends[1][:, None]) < 0.7
    assert 50 < wanted.sum() < (formula_light(text, pixels) > 0).sum()
    np.testing.assert_array_equal(formula_pixels(text, pixels), wanted)


def test_the_longest_formula_has_pixels_too():
    text = "1" + "+ 1" * ((MAX_LENGTH - 1) // 60) + " " * 2000
    assert formula_pixels(text[:MAX_LENGTH], (4, 3)).all()
