"""Dimension lines, marks of section planes, centre lines and hatching."""

from __future__ import annotations

import numpy as np

from thbcad.checks import Floats
from thbcad.drawings.curves import Style
from thbcad.drawings.sheets import ARROW, TEXT, Label, Stroke, arrowhead, line

EXTENSION = (1.0, 2.0)  # mm: before and beyond an extension line
OVERHANG = 4.0  # mm of a centre line beyond the outline
MARK = 9.0  # mm of a section mark beyond the outline
SPACING = 3.0  # mm between the lines of a hatching

Marks = list[Stroke | Label]


def dimension(points: Floats, level: float, axis: int, text: str) -> Marks:
    """Return the dimension of the distance of two points, (2, 2), along an axis of the paper.

    level : the position of the dimension line across the axis, mm.  The text stands over the line, where the
    line is too short beside it, with the arrows outside.
    """
    across = 1 - axis
    ends = []
    marks: Marks = []
    for point in points[np.argsort(points[:, axis])]:
        end = point.copy()
        end[across] = level
        sign = np.sign(level - point[across])
        unit = np.eye(2)[across] * sign
        marks.append(line(point + EXTENSION[0] * unit, end + EXTENSION[1] * unit))
        ends.append(end)
    low, high = ends
    along = np.eye(2)[axis]
    label = Label(text, (0.0, 0.0), TEXT)
    room = float(high[axis] - low[axis])
    if room > label.length + 2 * ARROW[0]:
        marks += [line(low, high), arrowhead(low, -along), arrowhead(high, along)]
        base = (low + high) / 2
        anchor = "middle"
    else:
        tail = high + (2 * ARROW[0] + label.length + 1) * along
        marks += [line(low - 2 * ARROW[0] * along, tail), arrowhead(low, along), arrowhead(high, -along)]
        base = high + 2 * ARROW[0] * along
        anchor = "start"
    base = base + (np.array([0.0, 0.8]) if axis == 0 else np.array([-0.8, 0.0]))
    marks.append(Label(text, (float(base[0]), float(base[1])), TEXT, anchor, 90.0 * axis))
    return marks


def centre_line(first: Floats, second: Floats) -> Stroke:
    """Return the centre line between two points of the outline, with its overhang."""
    unit = (second - first) / np.linalg.norm(second - first)
    return line(first - OVERHANG * unit, second + OVERHANG * unit, style=Style.CENTRE)


def section_mark(ends: Floats, sight: Floats, letter: str) -> Marks:
    """Return the marks of a section plane at both ends of its line: arrows along the sight, and a letter.

    ends : (2, 2) float, mm on the paper.  sight : (2,) float, unit vector on the paper.
    """
    first, second = ends
    unit = (second - first) / np.linalg.norm(second - first)
    marks: Marks = []
    for end, out in ((first, -unit), (second, unit)):
        inner, outer = end + OVERHANG * out, end + MARK * out
        tip = outer + 2 * ARROW[0] * sight
        marks += [line(inner, outer, style=Style.OUTLINE), line(outer, tip), arrowhead(tip, sight)]
        place = outer + out * 2.5 - np.array([0.0, TEXT / 2])
        marks.append(Label(letter, (float(place[0]), float(place[1])), TEXT, "middle"))
    return marks


def hatching(outline: Floats) -> list[Stroke]:
    """Return lines at 45 degrees inside a closed polygon (n, 2).

    Where a line crosses the polygon, it enters or leaves (even-odd rule).
    """
    turn = np.array([[1.0, -1.0], [1.0, 1.0]]) / np.sqrt(2)
    turned = outline @ turn
    start, stop = turned, np.roll(turned, -1, axis=0)
    rows = np.arange(turned[:, 1].min() + SPACING / 2, turned[:, 1].max(), SPACING)
    lines = []
    for row in rows:
        cut = (start[:, 1] <= row) != (stop[:, 1] <= row)
        a, b = start[cut], stop[cut]
        x = np.sort(a[:, 0] + (row - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0]))
        for low, high in zip(x[::2], x[1::2]):
            lines.append(line(turn @ [low, row], turn @ [high, row], style=Style.HATCH))
    return lines
