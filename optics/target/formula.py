"""Targets by formula: light as a function of place, from text that is parsed and walked, never executed.

The coordinates x and y run from -1 to 1 over the target, y upward; r = sqrt(x^2 + y^2).  All numbers are
floats, so that 9^9^9 is infinity and takes no time; comparisons give 0 or 1.
"""

from __future__ import annotations

import ast
import operator
import re
import warnings
from collections.abc import Iterator, Mapping
from functools import reduce
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from optics.runtime import UserError

MAX_LENGTH = 2000  # characters
MAX_DEPTH = 100  # levels of operators and functions within each other
SUBPOINTS = (
    8  # per pixel in each direction: the edge of a disk on 160 x 160 pixels is then known to 0.2 % (L2)
)
BAND_POINTS = 1 << 16  # evaluated together, unless a row of pixels has more

Values = NDArray[np.float64] | np.float64

NAMES = ("x", "y", "r", "pi")
FUNCTIONS = {
    "sqrt": (np.sqrt, 1),
    "exp": (np.exp, 1),
    "log": (np.log, 1),
    "sin": (np.sin, 1),
    "cos": (np.cos, 1),
    "tan": (np.tan, 1),
    "tanh": (np.tanh, 1),
    "abs": (np.abs, 1),
    "hypot": (np.hypot, 2),
    "atan2": (np.arctan2, 2),
    "where": (np.where, 3),
}
EXTREMES = {"min": np.minimum, "max": np.maximum}  # of two values or more
OPERATORS = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
COMPARISONS = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
ALLOWED = (
    f"it takes numbers, {', '.join(NAMES)}, + - * / ^, comparisons and {', '.join([*FUNCTIONS, *EXTREMES])}"
)
STRANGE = re.compile(r"[^\w\s.,+\-*/^()<>=!]", re.ASCII)


def formula_light(text: str, pixels: tuple[int, int], subpoints: int = SUBPOINTS) -> NDArray[np.float64]:
    """Return the mean of a formula over every pixel relative to the brightest pixel, (rows, columns), row 0
    at +y.

    The mean is that of subpoints x subpoints midpoints (the midpoint rule).  A formula whose values are
    mirror symmetric gives light that is so bit for bit.  pixels : (columns, rows).

    Raises
    ------
    UserError : text that is no formula, or light that is negative, not finite, or 0 everywhere.
    """
    tree = _formula(text)
    columns, rows = pixels
    x, y = _midpoints(columns * subpoints), -_midpoints(rows * subpoints)
    step = max(1, BAND_POINTS // (subpoints**2 * columns))
    bands = [
        _band(tree, x, y[k * subpoints : (k + step) * subpoints], subpoints) for k in range(0, rows, step)
    ]
    light = np.concatenate(bands)
    if not light.any():
        raise UserError("target.formula is 0 everywhere on the target; it asks for no light")
    return light / light.max()


def _midpoints(count: int) -> NDArray[np.float64]:
    """Return the middles of equal intervals over [-1, 1]; the k-th from either end differ in nothing but
    their sign."""
    return np.arange(1 - count, count, 2) / count


def _band(
    tree: ast.expr, x: NDArray[np.float64], y: NDArray[np.float64], subpoints: int
) -> NDArray[np.float64]:
    """Return the mean over the pixels of some rows; x, y : coordinates of the columns and rows of
    midpoints."""
    along, down = x[None, :], y[:, None]
    places = {"x": along, "y": down, "r": np.hypot(along, down), "pi": np.float64(np.pi)}
    with np.errstate(all="ignore"):
        values = np.broadcast_to(_value(tree, places), (len(y), len(x)))
    good = (values >= 0) & (values < np.inf)
    if not good.all():
        row, column = np.unravel_index(np.argmin(good), good.shape)
        raise UserError(_complaint(values[row, column], x[column], y[row]))
    # a share of each, because a sum can overflow; opposite points in pairs, because a + b is b + a but sums
    # of more depend on their order
    shares = (values / (2 * subpoints) ** 2).reshape(-1, subpoints, len(x) // subpoints, subpoints)
    by_column = (shares + shares[..., ::-1]).sum(axis=3)
    return (by_column + by_column[:, ::-1]).sum(axis=1)


def _complaint(value: float, x: float, y: float) -> str:
    place = f"at x = {x:.4g}, y = {y:.4g}"
    if np.isnan(value):
        return (
            f"target.formula is not a number {place}; look for 0 / 0 and for roots, powers or logarithms "
            "of negative values"
        )
    if np.isinf(value):
        return f"target.formula is infinite {place}; light must be finite"
    return f"target.formula is {value:.3g} {place}; light cannot be negative, and max(0, ...) cuts it off"


def _value(node: ast.expr, places: Mapping[str, Values]) -> Values:
    """Return the value of a part of the formula at all places."""
    match node:
        case ast.Constant(value=number):
            return np.float64(number)
        case ast.Name(id=name):
            return places[name]
        case ast.UnaryOp(operand=operand):
            return -_value(operand, places)
        case ast.BinOp(left=left, op=op, right=right):
            return OPERATORS[type(op)](_value(left, places), _value(right, places))
        case ast.Compare(left=left, ops=ops, comparators=others):
            holds, first = np.float64(1), _value(left, places)
            for op, other in zip(ops, others):
                second = _value(other, places)
                holds, first = holds * COMPARISONS[type(op)](first, second), second
            return holds
        case ast.Call(func=ast.Name(id=name), args=arguments):
            values = (_value(a, places) for a in arguments)
            return reduce(EXTREMES[name], values) if name in EXTREMES else FUNCTIONS[name][0](*values)
    raise AssertionError(f"{type(node).__name__} was not refused")


def _formula(text: str) -> ast.expr:
    """Return the syntax tree of a formula in which everything is allowed."""
    if len(text) > MAX_LENGTH:
        raise UserError(f"target.formula has {len(text)} characters; at most {MAX_LENGTH} are allowed")
    if strange := STRANGE.search(text):
        raise UserError(f"target.formula holds the character {strange[0]!r}; {ALLOWED}")
    source = " ".join(text.split()).replace("^", "**")
    if not source:
        raise UserError("target.formula is empty")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)
            warnings.simplefilter("ignore", DeprecationWarning)  # "2if"
            tree = ast.parse(source, mode="eval").body
    except SyntaxError as error:
        raise UserError(
            f"target.formula cannot be understood {_whereabouts(source, error.offset)}; {ALLOWED}"
        ) from None
    except (RecursionError, MemoryError):  # which of them, and from what depth on, is Python's choice
        raise UserError(_TOO_DEEP) from None
    for node, depth in _nodes(tree):
        if depth > MAX_DEPTH:
            raise UserError(_TOO_DEEP)
        if fault := _fault(node, source):
            raise UserError(f"target.formula: {fault}")
    return tree


_TOO_DEEP = f"target.formula is nested more than {MAX_DEPTH} levels deep; write it in a simpler way"


def _whereabouts(source: str, offset: int | None) -> str:
    rest = source[(offset or 1) - 1 :]
    return f"from {_brief(rest)} on" if rest else "at its end"


def _brief(code: str) -> str:
    """Return a piece of the formula for a message, as the user may have written it."""
    code = code.replace("**", "^")
    return repr(code if len(code) <= 40 else code[:37] + "...")


def _nodes(tree: ast.expr) -> Iterator[tuple[ast.expr, int]]:
    """Yield every expression but the names of functions, with its depth; a loop, because the tree can be too
    deep for recursion."""
    waiting = [(tree, 1)]
    while waiting:
        node, depth = waiting.pop()
        yield node, depth
        children = (
            node.args
            if isinstance(node, ast.Call)
            else [c for c in ast.iter_child_nodes(node) if isinstance(c, ast.expr)]
        )
        waiting += [(child, depth + 1) for child in reversed(children)]


def _fault(node: ast.expr, source: str) -> str:
    """Return what is wrong with a node itself, or an empty text."""
    code = _brief(source[node.col_offset : node.end_col_offset])
    match node:
        case ast.Constant(value=bool()):
            return f"unknown name {code}; {ALLOWED}"
        case ast.Constant(value=int() | float() as number):
            return "" if _is_finite(number) else f"the number {code} is too large"
        case ast.Name(id=name):
            if name in FUNCTIONS or name in EXTREMES:
                return f"the function {name} needs its values in parentheses"
            return "" if name in NAMES else f"unknown name {code}; {ALLOWED}"
        case ast.UnaryOp(op=ast.USub()):
            return ""
        case ast.BinOp(op=op) if type(op) in OPERATORS:
            return ""
        case ast.Compare(ops=ops) if all(type(op) in COMPARISONS for op in ops):
            return ""
        case ast.Call(func=ast.Name(id=name), keywords=[]):
            return _call_fault(name, len(node.args))
    return f"{code} is not allowed; {ALLOWED}"


def _is_finite(number: float) -> bool:
    try:
        return isfinite(number)
    except OverflowError:  # a whole number beyond the floats
        return False


def _call_fault(name: str, count: int) -> str:
    """Return what is wrong with a call of a function with `count` values, or an empty text."""
    if name in EXTREMES:
        return "" if count >= 2 else f"the function {name} takes 2 or more values, got {count}"
    if name not in FUNCTIONS:
        return f"unknown function {_brief(name)}; {ALLOWED}"
    wanted = FUNCTIONS[name][1]
    return (
        ""
        if count == wanted
        else f"the function {name} takes {wanted} value{'s' * (wanted > 1)}, got {count}"
    )
