"""Formulas that are refused, and formulas in problem files."""

import inspect
import re
import sys

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.base.runtime import LONGEST, UserError
from optics.interface.commands import main
from optics.scene.problem import load_problem
from optics.scene.receivers.formula import formula_light, require_quick
from optics.scene.receivers.formula_syntax import ALLOWED, MAX_DEPTH, MAX_LENGTH
from optics.scene.system import System, target_irradiance
from tests.cases import examples
from tests.optics.cases import write_problem
from tests.optics.scene.problem.cases import load_text
from tests.optics.scene.receivers.cases import CALLS, EXAMPLE, MANY, expressions, refusal

pytestmark = pytest.mark.usefixtures("coarse_concentration")

# ---- what is refused ----


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
    "0": r"is 0 everywhere on the target; make it greater than 0 where you want light",
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
@examples(600)
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


# ---- the problem file ----


def formula_file(folder, changes=None, drop=("target.image",)):
    return write_problem(
        folder, {"target.kind": "function", "target.formula": EXAMPLE} | (changes or {}), drop=drop
    )


def test_a_formula_needs_no_picture_and_survives_being_written(tmp_path):
    problem = load_problem(formula_file(tmp_path, {"target.formula": "1 +\n\t0.5 * (x < 0.25)^2"}))
    assert load_text(tmp_path, problem.to_toml()) == problem
    light = System(problem).target.light
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


@pytest.mark.parametrize(
    "kind",
    [{"target.formula": "1 + x"}, {"target.kind": "tophat", "target.formula": "", "target.shape": "ellipse"}],
    ids=["formula", "region"],
)
def test_light_that_is_made_on_the_pixels_is_not_fitted(tmp_path, kind):
    """Cropping and padding suit pictures: they would cut a formula or a region on pixels that are not
    square."""
    oblong = {"target.half_width": [20.0, 10.0], "target.pixels": [32, 32]}
    problem = load_problem(formula_file(tmp_path, oblong | kind))
    light = System(problem).target.light
    target = target_irradiance(light, System(problem).target.screen(), problem.target.placing, 1.0)
    np.testing.assert_allclose(target / target.max(), light / light.max(), rtol=1e-13)


def test_light_narrower_than_its_samples_is_refused_for_that_reason():
    """At 48 x 48 pixels the points nearest to the middle are 1/384 of it away, where exp is 0 in float64."""
    told = refusal("exp(-1e9*r*r)", (48, 48))
    assert told.startswith("target.formula is greater than 0 only between its 384 x 384 sample points")
    assert "narrower than they are apart" in told
    assert formula_light("exp(-1e7*r*r)", (48, 48)).max() == 1.0  # e^-136 is not 0


def test_a_formula_that_takes_minutes_is_refused_with_the_pixels_that_do_not(capsys):
    """Operations count that vary in both directions: those of x or y alone cost next to nothing."""

    def summed(terms):
        middle = len(terms) // 2
        return f"({summed(terms[:middle])} + {summed(terms[middle:])})" if middle else terms[0]

    waves = summed([f"sin({k}*x*y)" for k in range(90)])
    with pytest.raises(UserError) as caught:
        require_quick(waves, (1024, 1024))
    told = str(caught.value)
    assert re.search(r"8192 x 8192 sample points take about \d+ s, and at most 60 s are allowed; take", told)
    fewer = tuple(int(n) for n in re.search(r"target\.pixels = \[(\d+), (\d+)\]", told).groups())
    require_quick(waves, fewer)
    assert "take about 60 s" in capsys.readouterr().err
    for text, pixels in ((waves.replace("*y", ""), (1024, 1024)), (waves, (256, 256)), ("x*y", (1024, 1024))):
        require_quick(text, pixels)
    assert not capsys.readouterr().err


def test_check_takes_a_formula(tmp_path, capsys):
    assert main(["check", str(formula_file(tmp_path))]) == 0
    assert "problem is valid" in capsys.readouterr().out
