"""Targets by formula: light as a function of position, from text that is parsed and walked, never executed.

The coordinates x and y run from -1 to 1 over the target, y upward; r = sqrt(x^2 + y^2).  All numbers are
floats, so that 9^9^9 is infinity and takes no time; comparisons give 0 or 1.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from functools import reduce

import numpy as np

from optics.base.runtime import UserError, note
from optics.scene.receivers.formula_syntax import (
    COMPARISONS,
    EXTREMES,
    FUNCTIONS,
    OPERATORS,
    expressions,
    parsed_formula,
)
from thbcad.checks import Bools, Floats

SUBPOINTS = 8  # per pixel in each direction: the edge of a disk on 160 x 160 pixels is right to 0.2 % (L2)
BAND_POINTS = 1 << 16  # evaluated together, unless a row of pixels has more
# ns of one core per sample point: of the mean, of a function or a power, and of others
MEAN_NS, FUNCTION_NS, OTHER_NS = 25, 10, 1
LONGEST, NOTED = 60.0, 5.0  # seconds that a formula may take, and from where on it is said

Values = Floats | np.float64


def formula_light(text: str, pixels: tuple[int, int], subpoints: int = SUBPOINTS) -> Floats:
    """Return the mean of a formula over every pixel, relative to the brightest pixel.

    The result is (rows, columns), row 0 at +y.  The mean is that of subpoints x subpoints midpoints (the
    midpoint rule).  A formula whose values are mirror symmetric gives light that is so bit for bit.

    pixels : (columns, rows).

    Raises UserError : text that is no formula, or light that is negative, not finite, or 0 everywhere.
    """
    tree = parsed_formula(text)
    light = _means(tree, pixels, subpoints)
    if not light.any():
        raise UserError(_darkness(tree, pixels, subpoints))
    return light / light.max()


def require_quick(text: str, pixels: tuple[int, int], subpoints: int = SUBPOINTS) -> None:
    """Refuse a formula that takes minutes at so many sample points, and say how long a slow one takes.

    The time is that of the operations whose value varies in both directions, estimated for one core.

    Raises UserError : it would take more than `LONGEST`; says how many pixels do not.
    """
    nodes = [node for node, _ in expressions(parsed_formula(text)) if _axes(node) == {"x", "y"}]
    slow = sum(isinstance(n, ast.Call) or isinstance(getattr(n, "op", None), ast.Pow) for n in nodes)
    each = MEAN_NS + FUNCTION_NS * slow + OTHER_NS * (len(nodes) - slow)
    columns, rows = pixels
    seconds = 1e-9 * each * columns * rows * subpoints**2
    took = f"{columns * subpoints} x {rows * subpoints} sample points take about {seconds:.0f} s"
    if seconds > LONGEST:
        fewer = [int(n * (LONGEST / seconds) ** 0.5) for n in pixels]
        raise UserError(
            f"target.formula takes too long on so many pixels: {took}, and at most {LONGEST:.0f} s are "
            f"allowed; take target.pixels = {fewer}{', or a shorter formula' if nodes else ''}"
        )
    if seconds > NOTED:
        note(f"target.formula: {took}")


def _axes(node: ast.expr) -> set[str]:
    """Return the directions, x and y, in which the value of a part of a formula varies."""
    if isinstance(node, ast.Name):
        return {"x": {"x"}, "y": {"y"}, "r": {"x", "y"}}.get(node.id, set())
    children = (child for child in ast.iter_child_nodes(node) if isinstance(child, ast.expr))
    return set[str]().union(*map(_axes, children))


def _darkness(tree: ast.expr, pixels: tuple[int, int], subpoints: int) -> str:
    """Return why a formula that is 0 at all its sample points asks for no light."""
    columns, rows = (n * subpoints for n in pixels)
    x, y = np.linspace(-1, 1, columns + 1), np.linspace(1, -1, rows + 1)
    if any((_values(tree, x, y[k : k + subpoints]) > 0).any() for k in range(0, rows + 1, subpoints)):
        return (
            f"target.formula is greater than 0 only between its {columns} x {rows} sample points: its light "
            "is narrower than they are apart; make it wider, or take more target.pixels"
        )
    return "target.formula is 0 everywhere on the target; make it greater than 0 where you want light"


def formula_pixels(text: str, pixels: tuple[int, int]) -> Bools:
    """Return the pixels at all of whose sample points a formula is greater than 0, (rows, columns).

    Arguments and errors are those of `formula_light`.
    """
    tree = ast.Compare(parsed_formula(text), [ast.Gt()], [ast.Constant(0.0)])
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
    values = _values(tree, x, y)
    good = (values >= 0) & (values < np.inf)
    if not good.all():
        row, column = np.unravel_index(np.argmin(good), good.shape)
        raise UserError(_complaint(values[row, column], x[column], y[row]))
    # divided before they are summed, because a sum can overflow; opposite points in pairs, because a + b is
    # b + a but sums of more depend on their order
    weighted = (values / (2 * subpoints) ** 2).reshape(-1, subpoints, len(x) // subpoints, subpoints)
    by_column = (weighted + weighted[..., ::-1]).sum(axis=3)
    return (by_column + by_column[:, ::-1]).sum(axis=1)


def _values(tree: ast.expr, x: Floats, y: Floats) -> Floats:
    """Return the values of a formula at all x and y, (len(y), len(x))."""
    along, down = x[None, :], y[:, None]
    names: dict[str, Values] = {"x": along, "y": down, "r": np.hypot(along, down), "pi": np.float64(np.pi)}
    with np.errstate(all="ignore"):
        return np.broadcast_to(_value(tree, names), (len(y), len(x)))


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
        case ast.UnaryOp(op=op, operand=operand):
            value = _value(operand, names)
            return -value if isinstance(op, ast.USub) else value
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
