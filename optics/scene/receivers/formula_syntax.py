"""The text of a formula as a syntax tree in which everything is allowed; nothing of it is executed."""

from __future__ import annotations

import ast
import operator
import re
import warnings
from collections.abc import Callable, Iterator
from math import isfinite
from typing import Any

import numpy as np

from optics.base.runtime import UserError

MAX_LENGTH = 2000  # characters
MAX_DEPTH = 100  # levels of operators and functions within each other

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


def parsed_formula(text: str) -> ast.expr:
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
    for node, depth in expressions(tree):
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


def expressions(tree: ast.expr) -> Iterator[tuple[ast.expr, int]]:
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
        case ast.UnaryOp(op=ast.USub() | ast.UAdd()):
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
