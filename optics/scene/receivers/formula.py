"""Targets by formula: light as a function of position, from text that is parsed and walked, never executed.

The coordinates x and y run from -1 to 1 over the target, y upward; r = sqrt(x^2 + y^2).  All numbers are
floats, so that 9^9^9 is infinity and takes no time; comparisons give 0 or 1.
"""

from __future__ import annotations

import ast
import operator
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from functools import reduce
from math import isfinite
from typing import Any

import numpy as np

from optics.base.runtime import UserError
from thbcad.checks import Bools, Floats

MAX_LENGTH = 2000  # characters
MAX_DEPTH = 100  # levels of operators and functions within each other
SUBPOINTS = 8  # per pixel in each direction: the edge of a disk on 160 x 160 pixels is right to 0.2 % (L2)
BAND_POINTS = 1 << 16  # evaluated together, unless a row of pixels has more

Values = Floats | np.float64

NAMES = ("x", "y", "r", "pi")
FUNCTIONS: dict[str, tuple[Callable[..., Any], int]] = {
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
EXTREMES: dict[str, Callable[[Any, Any], Any]] = {"min": np.minimum, "max": np.maximum}  # of two or more
OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
COMPARISONS: dict[type[ast.cmpop], Callable[[Any, Any], Any]] = {
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
REFUSED = re.compile(r"[^\w\s.,+\-*/^()<>=!]", re.ASCII)


def formula_light(text: str, pixels: tuple[int, int], subpoints: int = SUBPOINTS) -> Floats:
    """Return the mean of a formula over every pixel, relative to the brightest pixel.

    The result is (rows, columns), row 0 at +y.  The mean is that of subpoints x subpoints midpoints (the
    midpoint rule).  A formula whose values are mirror symmetric gives light that is so bit for bit.

    pixels : (columns, rows).

    Raises UserError : text that is no formula, or light that is negative, not finite, or 0 everywhere.
    """
    light = _means(_formula(text), pixels, subpoints)
    if not light.any():
        raise UserError("target.formula is 0 everywhere on the target; it asks for no light")
    return light / light.max()


def formula_pixels(text: str, pixels: tuple[int, int]) -> Bools:
    """Return the pixels at all of whose sample points a formula is greater than 0, (rows, columns).

    Arguments and errors are those of `formula_light`.
    """
    tree = ast.Compare(_formula(text), [ast.Gt()], [ast.Constant(0.0)])
    return _means(tree, pixels, SUBPOINTS) > 1 - 0.5 / SUBPOINTS**2  # one dark point makes 1 / SUBPOINTS^2


def _means(tree: ast.expr, pixels: tuple[int, int], subpoints: int) -> Floats:
    """Return the mean of a formula over every pixel, (rows, columns)."""
    columns, rows = pixels
    x, y = _midpoints(columns * subpoints), -_midpoints(rows * subpoints)
    step = max(1, BAND_POINTS // (subpoints**2 * columns))
    parts = (y[k * subpoints : (k + step) * subpoints] for k in range(0, rows, step))
    return np.concatenate([_band(tree, x, part, subpoints) for part in parts])


def _midpoints(count: int) -> Floats:
    """Return the middles of equal intervals over [-1, 1].

    The k-th from either end differ in nothing but their sign.
    """
    return np.arange(1 - count, count, 2) / count


def _band(tree: ast.expr, x: Floats, y: Floats, subpoints: int) -> Floats:
    """Return the mean over the pixels of some rows.

    x, y : coordinates of the columns and of the rows of midpoints.
    """
    along, down = x[None, :], y[:, None]
    names: dict[str, Values] = {"x": along, "y": down, "r": np.hypot(along, down), "pi": np.float64(np.pi)}
    with np.errstate(all="ignore"):
        values = np.broadcast_to(_value(tree, names), (len(y), len(x)))
    good = (values >= 0) & (values < np.inf)
    if not good.all():
        row, column = np.unravel_index(np.argmin(good), good.shape)
        raise UserError(_complaint(values[row, column], x[column], y[row]))
    # divided before they are summed, because a sum can overflow; opposite points in pairs, because a + b is
    # b + a but sums of more depend on their order
    weighted = (values / (2 * subpoints) ** 2).reshape(-1, subpoints, len(x) // subpoints, subpoints)
    by_column = (weighted + weighted[..., ::-1]).sum(axis=3)
    return (by_column + by_column[:, ::-1]).sum(axis=1)


def _complaint(value: float, x: float, y: float) -> str:
    where = f"at x = {x:.4g}, y = {y:.4g}"
    if np.isnan(value):
        return (
            f"target.formula is not a number {where}; look for 0 / 0 and for roots, powers or logarithms "
            "of negative values"
        )
    if np.isinf(value):
        return f"target.formula is infinite {where}; light must be finite"
    return f"target.formula is {value:.3g} {where}; light cannot be negative, and max(0, ...) cuts it off"


def _value(node: ast.expr, names: Mapping[str, Values]) -> Values:
    """Return the value of a part of the formula at all points; names : the values of `NAMES`."""
    match node:
        case ast.Constant(value=int() | float() as number):
            return np.float64(number)
        case ast.Name(id=name):
            return names[name]
        case ast.UnaryOp(operand=operand):
            return -_value(operand, names)
        case ast.BinOp(left=left, op=op, right=right):
            return OPERATORS[type(op)](_value(left, names), _value(right, names))
        case ast.Compare(left=left, ops=ops, comparators=others):
            terms = [_value(term, names) for term in (left, *others)]
            holds: Values = np.float64(1)
            for comparison, first, second in zip(ops, terms, terms[1:]):
                holds = holds * COMPARISONS[type(comparison)](first, second)
            return holds
        case ast.Call(func=ast.Name(id=name), args=arguments):
            values = (_value(a, names) for a in arguments)
            return reduce(EXTREMES[name], values) if name in EXTREMES else FUNCTIONS[name][0](*values)
    raise AssertionError(f"{type(node).__name__} was not refused")


def _formula(text: str) -> ast.expr:
    """Return the syntax tree of a formula in which everything is allowed."""
    if len(text) > MAX_LENGTH:
        raise UserError(f"target.formula has {len(text)} characters; at most {MAX_LENGTH} are allowed")
    if refused := REFUSED.search(text):
        raise UserError(f"target.formula holds the character {refused[0]!r}; {ALLOWED}")
    source = " ".join(text.split()).replace("^", "**")
    if not source:
        raise UserError("target.formula is empty")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)
            warnings.simplefilter("ignore", DeprecationWarning)  # "2if"
            tree = ast.parse(source, mode="eval").body
    except SyntaxError as error:
        rest = source[(error.offset or 1) - 1 :]
        where = f"from {_brief(rest)} on" if rest else "at its end"
        raise UserError(f"target.formula cannot be understood {where}; {ALLOWED}") from None
    except (RecursionError, MemoryError):  # which of them, and from what depth on, is Python's choice
        raise UserError(_TOO_DEEP) from None
    for node, depth in _nodes(tree):
        if depth > MAX_DEPTH:
            raise UserError(_TOO_DEEP)
        if fault := _fault(node, source):
            raise UserError(f"target.formula: {fault}")
    return tree


_TOO_DEEP = f"target.formula is nested more than {MAX_DEPTH} levels deep; write it in a simpler way"


def _brief(code: str) -> str:
    """Return a piece of the formula for a message, as the user may have written it."""
    code = code.replace("**", "^")
    return repr(code if len(code) <= 40 else code[:37] + "...")


def _nodes(tree: ast.expr) -> Iterator[tuple[ast.expr, int]]:
    """Yield every expression but the names of functions, with its depth.

    A loop, because the tree can be too deep for recursion.
    """
    waiting: list[tuple[ast.expr, int]]
    waiting = [(tree, 1)]
    while waiting:
        node, depth = waiting.pop()
        yield node, depth
        if isinstance(node, ast.Call):
            children = node.args
        else:
            children = [c for c in ast.iter_child_nodes(node) if isinstance(c, ast.expr)]
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
            count = len(node.args)
            if name in EXTREMES:
                return "" if count >= 2 else f"the function {name} takes 2 or more values, got {count}"
            if name not in FUNCTIONS:
                return f"unknown function {_brief(name)}; {ALLOWED}"
            if count == (wanted := FUNCTIONS[name][1]):
                return ""
            return f"the function {name} takes {wanted} value{'s' * (wanted > 1)}, got {count}"
    return f"{code} is not allowed; {ALLOWED}"


def _is_finite(number: float) -> bool:
    try:
        return isfinite(number)
    except OverflowError:  # a whole number beyond the floats
        return False
