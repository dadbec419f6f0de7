"""The outline of an optical surface, seen along the axis: a rectangle, with round corners or not, an ellipse,
or another.

A rectangle of half-widths h with quarter circles of radius c in its corners has the area
A = 4 hx hy - (4 - pi) c^2, which gives c.  Points of the rim decide which outline it is.
"""

from dataclasses import dataclass

import numpy as np

from thbcad.checks import Floats
from thbcad.outlines import Outline

SHARP = 1e-6  # relative: how well an outline must be a rectangle
ROUND = 1e-4  # the same of the others: a chamfer ends in splines that are 1e-5 off the circle of a sphere
CIRCLE = 1e-7  # relative: semi-axes of an ellipse that differ by less are those of a circle
UNSURE = 4  # times what a rim is off its ellipse: how far the semi-axes may be wrong
NEARLY_ROUND = 1e-2  # the same of a rim that a chamfer leaves of a wavy surface: the largest ellipse within


@dataclass(frozen=True, eq=False)
class FaceOutline:
    """An outline around the middle of its box, mm.

    word : "rectangle", "rounded", "ellipse" or "other".  nearest : the Outline that it is or is nearest to
    apart : mm, how far points of the rim are from that at most.  at : (x, y) of the farthest, from the middle
    least : gauge of the rim's innermost point in `nearest`.  area : mm^2
    """

    word: str
    nearest: Outline
    apart: float
    at: tuple[float, float]
    least: float
    area: float

    @property
    def is_nearly_round(self) -> bool:
        """Whether it is an ellipse, or off one by less than a chamfer of a wavy surface leaves."""
        half = min(self.nearest.half_width)
        return self.word == "ellipse" or (self.nearest.is_ellipse and self.apart < NEARLY_ROUND * half)

    @property
    def within(self) -> Outline:
        """The largest ellipse within one that is nearly round, else the outline that it is."""
        if self.word in ("rectangle", "rounded"):
            return self.nearest
        axes = np.array(self.nearest.half_width) * (1.0 if self.word == "ellipse" else self.least)
        unsure = min(ROUND * float(axes.max()), UNSURE * self.apart)
        if np.ptp(axes) <= max(CIRCLE * float(axes.max()), unsure):
            axes = np.full(2, axes.min())
        return Outline.ellipse((float(axes[0]), float(axes[1])))


def face_outline(rim: Floats, half_width: Floats, area: float) -> FaceOutline:
    """Return the FaceOutline of points of a rim, (n, 2), around the middle of its box of half-widths (2,)."""
    half = (float(half_width[0]), float(half_width[1]))
    corner = float(np.sqrt(max(0.0, (4 * half[0] * half[1] - area) / (4 - np.pi))))
    outlines = {"rectangle": Outline(half), "ellipse": Outline(half, half)}
    if SHARP * min(half) < corner < min(half):
        outlines["rounded"] = Outline(half, (corner, corner))
    found = []
    for word, outline in outlines.items():
        gauge = outline.gauge(*rim.T)
        apart = abs(gauge - 1) * np.hypot(*rim.T)
        far = int(np.argmax(apart))
        if word == "rectangle":
            fits = apart[far] < SHARP * min(half) and _has_corners(rim / half_width)
        else:
            fits = apart[far] < ROUND * min(half)
        x, y = rim[far].tolist()
        least = float(gauge.min())
        one = FaceOutline(word if fits else "other", outline, float(apart[far]), (x, y), least, area)
        if fits:
            return one
        found.append(one)
    return min(found, key=lambda one: (not one.is_nearly_round, one.apart))


def _has_corners(relative: Floats) -> bool:
    """Return whether a rim in the box [-1, 1] x [-1, 1] has points in all of its corners."""
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    return bool(np.linalg.norm(relative[:, None] - corners, axis=2).min(axis=0).max() < SHARP)
