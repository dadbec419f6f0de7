"""A drawing sheet as lines, arrowheads and texts in mm on paper, from the lower left corner."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import Floats
from thbcad.drawings.curves import Style, View

TEXT = 3.5  # mm, height of capitals (ISO 3098)
SMALL = 2.5  # mm
ASPECT = 0.62  # of the height: the mean width of a letter
ARROW = (3.0, 0.5)  # mm: length, half the width (ISO 129)


@dataclass(frozen=True, eq=False)
class Stroke:
    """A line through points (n, 2), or with `filled` the inside of its polygon."""

    points: Floats
    style: Style
    filled: bool = False


@dataclass(frozen=True)
class Label:
    """A text whose base line starts, has its middle or ends (anchor) at a position; angle in degrees."""

    text: str
    position: tuple[float, float]
    height: float = SMALL
    anchor: str = "start"
    angle: float = 0.0

    @property
    def length(self) -> float:
        """About the length of the text, mm."""
        return ASPECT * self.height * len(self.text)


@dataclass(frozen=True, eq=False)
class PlacedView:
    """A View whose point (0, 0) lies at `origin` on the paper, at a scale."""

    view: View
    origin: Floats
    scale: float

    def at(self, points: Floats) -> Floats:
        """Return points of the view, mm, on the paper."""
        return self.origin + self.scale * points

    @property
    def frame(self) -> Floats:
        """The corners of the view on the paper, (2, 2)."""
        return self.at(self.view.box())


@dataclass(frozen=True, eq=False)
class Sheet:
    """What a drawing shows.

    name : of the lens.  size : (width, height), mm.
    scale : float, mm on paper per mm of the lens
    bound : float, mm; no point of a curve of the views is farther from the lens
    views : PlacedView.  strokes, labels : everything else
    """

    name: str
    size: tuple[float, float]
    scale: float
    bound: float
    views: tuple[PlacedView, ...]
    strokes: tuple[Stroke, ...]
    labels: tuple[Label, ...]


def line(*points: ArrayLike, style: Style = Style.DIMENSION) -> Stroke:
    """Return the line through points on the paper."""
    return Stroke(np.array(points, dtype=np.float64), style)


def rectangle(low: ArrayLike, high: ArrayLike, style: Style = Style.FRAME) -> Stroke:
    """Return the outline of a rectangle."""
    (x0, y0), (x1, y1) = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    return line((x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0), style=style)


def arrowhead(tip: ArrayLike, direction: ArrayLike) -> Stroke:
    """Return a filled arrowhead with its tip at a point; direction : (2,) float, a unit vector."""
    tip, along = np.asarray(tip, dtype=np.float64), np.asarray(direction, dtype=np.float64)
    length, half = ARROW
    side = np.array([-along[1], along[0]]) * half
    base = tip - length * along
    return Stroke(np.array([tip, base + side, base - side, tip]), Style.DIMENSION, filled=True)


def number(value: float) -> str:
    """Return a length in mm with at most four decimals, or where those are too few with four digits."""
    text = f"{value:.4f}".rstrip("0").rstrip(".")
    return f"{value:.4g}" if value and abs(value) < 1e-2 else text
