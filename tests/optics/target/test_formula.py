"""Targets by formula: what a text means, that it is never executed, and every sentence with which one is
refused."""

from __future__ import annotations

import inspect
import operator
import re
import sys

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from optics.commands import main
from optics.problem import load_problem, problem_to_toml
from optics.runtime import LONGEST, UserError
from optics.system import target_irradiance, target_light, target_screen
from optics.target.formula import ALLOWED, BAND_POINTS, MAX_DEPTH, MAX_LENGTH, SUBPOINTS, formula_light
from optics.target.regions import uniform_region
from tests.optics.cases import write_problem

EXAMPLE = "exp(-(x^2 + y^2) / 0.1) * (1 + 0.5 * cos(8 * pi * x))"
FEW = settings(deadline=None, derandomize=True, max_examples=100)
MANY = settings(deadline=None, derandomize=True, max_examples=300)


def means(function, pixels, subpoints=SUBPOINTS):
    """Return the pixel means of function(x, y), relative to the brightest: the slow twin."""
    columns, rows = pixels
    x, y = ((2 * np.arange(n * subpoints) + 1) / (n * subpoints) - 1 for n in pixels)
    with np.errstate(all="ignore"):
        values = np.broadcast_to(function(x[None, :], -y[:, None]), (len(y), len(x)))
    light = (values / values.max()).reshape(rows, subpoints, columns, subpoints).mean(axis=(1, 3))
    return light / light.max()


def refusal(text, pixels=(4, 4)):
    with pytest.raises(UserError) as caught:
        formula_light(text, pixels)
    return str(caught.value)


# What a formula means

PLAIN = {
    EXAMPLE: lambda x, y: np.exp(-(x**2 + y**2) / 0.1) * (1 + 0.5 * np.cos(8 * np.pi * x)),
    "2": lambda x, y: np.float64(2),
    "1 + x": lambda x, y: 1 + x,
    "1.5 + y": lambda x, y: 1.5 + y,
    "r": lambda x, y: np.hypot(x, y),
    "4 - r ^ 2 * 2": lambda x, y: 4 - 2 * (x**2 + y**2),
    "-x^2 + 1": lambda x, y: 1 - x**2,
    "2^x^2": lambda x, y: 2 ** (x**2),
    "2**-x": lambda x, y: 2.0**-x,
    "8 - 2 - 3 + x": lambda x, y: 3 + x,
    "8 / 4 / 2 + x * 2 / 4": lambda x, y: 1 + x / 2,
    "1e-3 + .5*(x > 0.25)": lambda x, y: 1e-3 + 0.5 * (x > 0.25),
    "-0.5 < x <= 0.25": lambda x, y: (x > -0.5) & (x <= 0.25),
    "(x == y) + (x != y) + (x >= 0) + (y < 0)": lambda x, y: 1.0 + (x >= 0) + (y < 0),
    "(abs(x) < 0.5) * (abs(y) < 0.25)": lambda x, y: (np.abs(x) < 0.5) * (np.abs(y) < 0.25),
    "sqrt(1 + x)": lambda x, y: np.sqrt(1 + x),
    "log(3 + x)": lambda x, y: np.log(3 + x),
    "2 + sin(x) * tan(y) * tanh(3*x)": lambda x, y: 2 + np.sin(x) * np.tan(y) * np.tanh(3 * x),
    "4 + atan2(y, x)": lambda x, y: 4 + np.arctan2(y, x),
    "hypot(x, 2*y)": lambda x, y: np.hypot(x, 2 * y),
    "1 + min(x, y, 0.5)": lambda x, y: 1 + np.minimum(np.minimum(x, y), 0.5),
    "max(0, x, y)": lambda x, y: np.maximum(np.maximum(x, y), 0),
    "where(x > 0, sqrt(x), 0)": lambda x, y: np.where(x > 0, np.sqrt(x), 0),
    "where(x, 2, 3)": lambda x, y: np.where(x != 0, 2, 3),
    "1 +\n\t  x": lambda x, y: 1 + x,
    "1 / (1 + exp(5000 * (r - 0.5)))": lambda x, y: 1 / (1 + np.exp(5000 * (np.hypot(x, y) - 0.5))),
}


@pytest.mark.parametrize("text", PLAIN)
def test_formulas_are_as_numpy_computes_them(text):
    """To 1e-12 of the brightest pixel: terms of size 4 at most, a few thousand roundings of 1e-16."""
    np.testing.assert_allclose(formula_light(text, (24, 14)), means(PLAIN[text], (24, 14)), atol=1e-12)


INFIX = {
    "+": (1, operator.add),
    "-": (1, operator.sub),
    "*": (2, operator.mul),
    "/": (2, operator.truediv),
    "^": (4, operator.pow),
    "**": (4, operator.pow),
    "<": (0, operator.lt),
    "<=": (0, operator.le),
    ">": (0, operator.gt),
    ">=": (0, operator.ge),
    "==": (0, operator.eq),
    "!=": (0, operator.ne),
}
CALLS = {
    "sqrt": (np.sqrt, 1),
    "exp": (np.exp, 1),
    "log": (np.log, 1),
    "sin": (np.sin, 1),
    "cos": (np.cos, 1),
    "tan": (np.tan, 1),
    "tanh": (np.tanh, 1),
    "abs": (np.abs, 1),
    "min": (np.minimum, 2),
    "max": (np.maximum, 2),
    "hypot": (np.hypot, 2),
    "atan2": (np.arctan2, 2),
    "where": (np.where, 3),
}
LEAVES = {
    "x": lambda x, y: x,
    "y": lambda x, y: y,
    "r": lambda x, y: np.hypot(x, y),
    "pi": lambda x, y: np.float64(np.pi),
}
EVEN = {
    "x^2": lambda x, y: x * x,
    "abs(x)": lambda x, y: abs(x),
    "cos(9*x)": lambda x, y: np.cos(9 * x),
    "y^2": lambda x, y: y * y,
    "r": lambda x, y: np.hypot(x, y),
    "abs(y)": lambda x, y: abs(y),
}


def literals():
    texts = st.sampled_from(["0", "1", "2", "3.5", "0.125", ".25", "1e-3", "7.", "40"])
    return texts.map(lambda text: (text, 5, lambda x, y: np.float64(text)))


def leaves(named):
    return st.one_of(
        literals(),
        st.sampled_from(list(named)).map(lambda name: (name, 4 if "^" in name else 5, named[name])),
    )


def extended(parts):
    """Return expressions made of smaller ones, each as (text, how strongly it binds, function of x and y)."""
    calls = st.sampled_from(list(CALLS)).flatmap(
        lambda name: st.tuples(st.just(name), st.tuples(*[parts] * CALLS[name][1]))
    )
    return st.one_of(
        st.tuples(st.sampled_from(list(INFIX)), parts, parts).map(infix),
        calls.map(called),
        parts.map(lambda part: ("-" + bound(part, 3), 3, lambda x, y: -(part[2](x, y)))),
    )


def infix(parts):
    """Return two expressions joined, with parentheses only where the precedence asks for them."""
    sign, left, right = parts
    strength, function = INFIX[sign]
    if strength == 4:  # a power is read from the right, and takes a minus in its exponent
        text = f"{bound(left, 5)} {sign}{bound(right, 3)}"
    else:
        text = f"{bound(left, strength + (strength == 0))}{sign} {bound(right, strength + 1)}"
    return text, strength, lambda x, y: number(function(left[2](x, y), right[2](x, y)))


def called(parts):
    name, arguments = parts
    return (
        f"{name}({', '.join(a[0] for a in arguments)})",
        5,
        lambda x, y: CALLS[name][0](*(a[2](x, y) for a in arguments)),
    )


def bound(part, strength):
    return part[0] if part[1] >= strength else f"({part[0]})"


def number(value):
    """Return 1.0 and 0.0 for true and false."""
    return value * np.float64(1)


def expressions(named=LEAVES):
    return st.recursive(leaves(named), extended, max_leaves=12).filter(
        lambda part: len(part[0]) < MAX_LENGTH - 10
    )


@given(part=expressions(), pixels=st.tuples(st.integers(2, 6), st.integers(2, 6)))
@MANY
def test_random_formulas_are_as_an_independent_evaluator_has_them(part, pixels):
    """The same operations in the same order at every place: only the means are rounded otherwise."""
    text, _, function = part
    columns, rows = pixels
    x, y = ((2 * np.arange(n * SUBPOINTS) + 1 - n * SUBPOINTS) / (n * SUBPOINTS) for n in pixels)
    with np.errstate(all="ignore"):
        values = np.broadcast_to(
            np.abs(function(x[None, :], -y[:, None])), (rows * SUBPOINTS, columns * SUBPOINTS)
        )
    text = f"abs({text})"
    if not np.isfinite(values).all():
        assert re.match(r"target\.formula is (not a number|infinite) at x = ", refusal(text, pixels))
    elif not values.any():
        assert "0 everywhere" in refusal(text, pixels)
    else:
        assume(values.max() > 1e-290)  # below, numbers have fewer digits
        light = (values / values.max()).reshape(rows, SUBPOINTS, columns, SUBPOINTS).mean(axis=(1, 3))
        np.testing.assert_allclose(formula_light(text, pixels), light / light.max(), rtol=1e-13, atol=1e-300)


# Where it is


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
    light = target_light(problem)
    screen = target_screen(problem)
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


# How well a pixel's mean is known


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


# Any scale


@pytest.mark.parametrize("scale", ["1e-300", "1e308", "1e-12", "3e7"])
def test_the_scale_does_not_matter(scale):
    light = formula_light(f"{scale} * (1 + 0.5 * cos(9 * x))", (20, 10))
    np.testing.assert_allclose(light, formula_light("1 + 0.5 * cos(9 * x)", (20, 10)), rtol=1e-13)
    assert light.max() == 1


# What is refused

PLACE = r"at x = -?[\d.e-]+, y = -?[\d.e-]+; "
WHAT = re.escape(ALLOWED)
REFUSED = {
    "x": r"is -0\.969 at x = -0\.9688, y = 0\.9688; light cannot be negative, and max\(0, \.\.\.\) cuts it "
    r"off",
    "0.5 - r": rf"is -0\.\d+ {PLACE}light cannot be negative",
    "min(x, y)": rf"is -0\.\d+ {PLACE}light cannot be negative",
    "(r > 0.5) - 1e-300": rf"is -1e-300 {PLACE}light cannot be negative",
    "sqrt(x)": rf"is not a number {PLACE}look for 0 / 0 and for roots, powers or logarithms of negative "
    "values",
    "log(x)": rf"is not a number {PLACE}look for",
    "x^0.5": rf"is not a number {PLACE}look for",
    "0 / 0": rf"is not a number {PLACE}look for",
    "1 / 0": rf"is infinite {PLACE}light must be finite",
    "9^9^9": rf"is infinite {PLACE}light must be finite",
    "9**9**9": rf"is infinite {PLACE}light must be finite",
    "exp(800 * r)": rf"is infinite {PLACE}light must be finite",
    "0": r"is 0 everywhere on the target; it asks for no light",
    "x > 1": r"is 0 everywhere on the target",
    " \n": r"is empty",
    "exp(-z)": rf": unknown name 'z'; {WHAT}",
    "True": rf": unknown name 'True'; {WHAT}",
    "X": rf": unknown name 'X'; {WHAT}",
    "__import__": rf": unknown name '__import__'; {WHAT}",
    "__import__(x)": rf": unknown function '__import__'; {WHAT}",
    "eval(x)": rf": unknown function 'eval'; {WHAT}",
    "sinh(x)": rf": unknown function 'sinh'; {WHAT}",
    "x(1)": rf": unknown function 'x'; {WHAT}",
    "exp": r": the function exp needs its values in parentheses",
    "max + 1": r": the function max needs its values in parentheses",
    "exp(x, 2)": r": the function exp takes 1 value, got 2",
    "exp()": r": the function exp takes 1 value, got 0",
    "where(x > 0, 1)": r": the function where takes 3 values, got 2",
    "min(x)": r": the function min takes 2 or more values, got 1",
    "1e999": r": the number '1e999' is too large",
    "x + " + "9" * 400: r": the number '9{37}\.\.\.' is too large",
    "1j": rf": '1j' is not allowed; {WHAT}",
    "None": rf": 'None' is not allowed; {WHAT}",
    "x // 2": rf": 'x // 2' is not allowed; {WHAT}",
    "+x": rf": '\+x' is not allowed; {WHAT}",
    "not x": rf": 'not x' is not allowed; {WHAT}",
    "1 + (x and y^2)": rf": 'x and y\^2' is not allowed; {WHAT}",
    "x if y else 2": rf": 'x if y else 2' is not allowed; {WHAT}",
    "x in y": rf": 'x in y' is not allowed; {WHAT}",
    "x < y is x": rf": 'x < y is x' is not allowed; {WHAT}",
    "x, y": rf": 'x, y' is not allowed; {WHAT}",
    "x.real": rf": 'x\.real' is not allowed; {WHAT}",
    "x.__class__()": rf": 'x\.__class__\(\)' is not allowed; {WHAT}",
    "exp(x)(y)": rf": 'exp\(x\)\(y\)' is not allowed; {WHAT}",
    "max(*x, y)": rf": '\*x' is not allowed; {WHAT}",
    "exp(x=1)": rf": 'exp\(x=1\)' is not allowed; {WHAT}",
    "max(x for x in y)": rf"(: the function max takes 2|: .* is not allowed; {WHAT})",
    "x[0]": rf"holds the character '\['; {WHAT}",
    "lambda: x": rf"holds the character ':'; {WHAT}",
    "'x'": rf"holds the character \"'\"; {WHAT}",
    "x; y": rf"holds the character ';'; {WHAT}",
    "x # y": rf"holds the character '#'; {WHAT}",
    "x % 2": rf"holds the character '%'; {WHAT}",
    "2 * π": rf"holds the character 'π'; {WHAT}",
    "x\0": rf"holds the character '\\x00'; {WHAT}",
    "x²": rf"holds the character '²'; {WHAT}",
    "x y": rf"cannot be understood from '.*y' on; {WHAT}",
    "2x": rf"cannot be understood from '.*x' on; {WHAT}",
    "(x": rf"cannot be understood .*; {WHAT}",
    "x ^": rf"cannot be understood .*; {WHAT}",
    "x = 2": rf"cannot be understood from .*; {WHAT}",
    "x^^2": rf"cannot be understood from .*; {WHAT}",
    "1" + " + r" * MAX_DEPTH: rf"is nested more than {MAX_DEPTH} levels deep; write it in a simpler way",
    "-" * MAX_LENGTH: r"cannot be understood|is nested more than",
    "-" * (MAX_LENGTH - 1) + "x": r"is nested more than",
    "(" * 1000 + "x" + ")" * 999: r"cannot be understood|is nested more than",
    "x" + "^x" * 999: r"is nested more than",
    "1" * (MAX_LENGTH + 1): r"has 2001 characters; at most 2000 are allowed",
}


@pytest.mark.parametrize("text", REFUSED, ids=lambda text: text[:24])
def test_bad_formulas_are_refused_with_a_sentence(text):
    message = refusal(text)
    assert re.match(r"target\.formula ?" + REFUSED[text], message)
    assert "\n" not in message
    assert len(message) < LONGEST  # never cut off


def test_what_is_just_allowed():
    """One level or one character more is refused above."""
    for text in ("1" + " + 0*r" * (MAX_DEPTH - 2), "max(" + "x, " * 600 + "1)", "1".ljust(MAX_LENGTH)):
        np.testing.assert_array_equal(formula_light(text, (2, 2)), np.ones((2, 2)))


def test_a_parser_short_of_stack_is_no_crash():
    """How deep the parser itself can go depends on Python's version and on the calls that wait."""

    def below(calls):
        return below(calls - 1) if calls else refusal("-" * (MAX_LENGTH - 1) + "x")

    waiting = len(inspect.stack(0))
    assert "is nested more than" in below(sys.getrecursionlimit() - waiting - 150)


TOKENS = [
    *"xyr+-*/^()<>=!,. \n",
    "pi",
    "**",
    "<=",
    "==",
    "1",
    "2.5",
    "9",
    "1e9",
    "e",
    "j",
    "_",
    "if",
    "else",
    "not",
    "lambda",
    "for",
    "in",
]
CALLED = [f"{name}(" for name in CALLS]


def outcome(text):
    """Return the light and "", or a dark pixel and the reason for which the text is refused."""
    try:
        return formula_light(text, (3, 2)), ""
    except UserError as error:
        return np.ones((2, 3)), str(error)


@given(
    text=st.one_of(st.text(max_size=60), st.lists(st.sampled_from(TOKENS + CALLED), max_size=60).map("".join))
)
@settings(MANY, max_examples=600)
def test_any_text_gives_light_or_a_user_error(text):
    light, message = outcome(text)
    assert light.shape == (2, 3)
    assert light.min() >= 0
    assert light.max() == 1
    assert "\n" not in message
    assert len(message) <= LONGEST


@given(part=expressions(), at=st.integers(0, 300), letter=st.sampled_from([*TOKENS, ""]))
@MANY
def test_damaged_formulas_give_light_or_a_user_error(part, at, letter):
    at %= len(part[0])
    light, _ = outcome(part[0][:at] + letter + part[0][at + 1 :])
    assert np.isfinite(light).all()


# The problem file


def formula_file(folder, changes=None, drop=("target.image",)):
    return write_problem(
        folder, {"target.kind": "function", "target.formula": EXAMPLE} | (changes or {}), drop=drop
    )


def test_a_formula_needs_no_picture_and_survives_being_written(tmp_path):
    problem = load_problem(formula_file(tmp_path, {"target.formula": "1 +\n\t0.5 * (x < 0.25)^2"}))
    again = tmp_path / "again.toml"
    again.write_text(problem_to_toml(problem), "utf-8")
    assert load_problem(again) == problem
    light = target_light(problem)
    assert light.shape == problem.target.pixels[::-1]
    assert light[0, 0] == 1
    assert light[0, -1] == pytest.approx(1 / 1.5, rel=1e-15)


def test_a_missing_formula_is_named(tmp_path):
    with pytest.raises(UserError, match=r"problem\.toml: the key target\.formula is missing"):
        load_problem(formula_file(tmp_path, drop=("target.image", "target.formula")))


@pytest.mark.parametrize("bad", [3, True, ["x"], 1.5])
def test_a_formula_is_a_text(tmp_path, bad):
    with pytest.raises(UserError, match=r"target\.formula must be a string"):
        load_problem(formula_file(tmp_path, {"target.formula": bad}))


@pytest.mark.parametrize("fit", ["crop", "pad", "stretch"])
@pytest.mark.parametrize(
    "kind",
    [{"target.formula": "1 + x"}, {"target.kind": "tophat", "target.shape": "ellipse"}],
    ids=["formula", "region"],
)
def test_light_that_is_made_on_the_pixels_is_not_fitted(tmp_path, fit, kind):
    """Cropping and padding suit pictures: they would cut a formula or a region on pixels that are not
    square."""
    oblong = {"target.half_width": [20.0, 10.0], "target.pixels": [32, 32], "target.fit": fit}
    problem = load_problem(formula_file(tmp_path, oblong | kind))
    light = target_light(problem)
    target = target_irradiance(light, target_screen(problem), problem.target.placing, 1.0)
    np.testing.assert_allclose(target / target.max(), light / light.max(), rtol=1e-13)


def test_check_takes_a_formula(tmp_path, capsys):
    assert main(["check", str(formula_file(tmp_path))]) == 0
    assert "the problem is sound" in capsys.readouterr().out


@pytest.mark.parametrize(
    "bad", ["exp(-z)", "x", "1 +", "0", "sqrt(x)", "9^9^9", "__import__(x)", "exp(x, y)"]
)
@pytest.mark.parametrize("command", ["check", "design"])
def test_the_commands_refuse_bad_formulas(tmp_path, capsys, command, bad):
    assert main([command, str(formula_file(tmp_path, {"target.formula": bad}))]) == 2
    message = capsys.readouterr().err
    assert message.startswith("thbcad: target.formula")
    assert message.count("\n") == 1
