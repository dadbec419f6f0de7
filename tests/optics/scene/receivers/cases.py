"""Formulas, their meaning, and random expressions."""

import operator

import numpy as np
import pytest
from hypothesis import strategies as st

from optics.base.runtime import UserError
from optics.scene.receivers import formula_light
from optics.scene.receivers.formula import SUBPOINTS
from optics.scene.receivers.formula_syntax import MAX_LENGTH
from tests.cases import examples

EXAMPLE = "exp(-(x^2 + y^2) / 0.1) * (1 + 0.5 * cos(8 * pi * x))"
MANY = examples(300)


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
