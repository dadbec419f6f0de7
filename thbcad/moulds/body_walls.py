"""Where the walls of a body stand: its outline, the wall round the smaller surface, the parting line."""

from __future__ import annotations

import numpy as np

from thbcad.lens import Lens
from thbcad.moulds.body_options import BodyOptions
from thbcad.moulds.drafted_walls import DraftedWall
from thbcad.moulds.inserts import FACES
from thbcad.outlines import LEAST_SIZE, RELATIVE, Outline

STEP = 0.1  # mm between a rim that is not level and its land: what a mould can still hold


def outline_and_smaller(lens: Lens, options: BodyOptions) -> tuple[Outline, int | None]:
    """Return the outline of the larger surface, and which is the smaller where a land joins it."""
    ratios = lens.taper
    alike = all(abs(r - 1) <= RELATIVE for r in ratios)
    if alike and options.annulus:
        raise ValueError("an annulus joins a smaller surface to a larger, and front and rear have one size")
    if alike:
        return lens.rear.outline, None
    if not options.annulus:
        raise ValueError(
            "front and rear of unlike half-widths have a ruled wall of their own draft: add annulus, or "
            "leave out draft, parting and edge_radius"
        )
    if min(ratios) < 1 < max(ratios) or min(abs(r - 1) for r in ratios) <= RELATIVE:
        raise ValueError(
            f"an annulus needs one surface that is smaller in x and in y, got half-widths "
            f"{lens.front.half_width} and {lens.rear.half_width} mm"
        )
    return (lens.rear.outline, 0) if max(ratios) < 1 else (lens.front.outline, 1)


def inner_wall(lens: Lens, options: BodyOptions, small: int) -> DraftedWall:
    """Return the wall from the land to the smaller surface."""
    outline = (lens.front, lens.rear)[small].outline
    upright = DraftedWall(outline, 0.0, 0.0, 1)
    low, high = upright.rough_heights(lens, small)
    level = upright.level_rim(lens, small)
    land = options.land
    if land is None:
        land = (low, high)[small] + (2 * small - 1) * STEP if level is None else level
    if level is not None and abs(land - level) < LEAST_SIZE:
        land = level  # no step so low
    elif low <= land <= high:
        raise ValueError(
            f"the land at z = {land:.9g} mm crosses the rim of the {FACES[small]}, which lies between z = "
            f"{low:.9g} and {high:.9g} mm; change lens.body.land"
        )
    return DraftedWall(outline, float(land), options.draft, -1 if land > high else 1)


def middle_of_rims(lens: Lens, outline: Outline) -> float:
    """Return the z midway between the highest point of the front's rim and the lowest of the rear's."""
    upright = DraftedWall(outline, 0.0, 0.0, 1)
    return (upright.rough_heights(lens, 0)[1] + upright.rough_heights(lens, 1)[0]) / 2


def least_support(held: Outline, clear: Outline) -> float:
    """Return a lower bound of the least difference of two support functions, mm."""
    count = 4096
    angle = np.linspace(0, np.pi / 2, count + 1)
    n = np.array([np.cos(angle), np.sin(angle)])

    # second derivatives are at most the radii of curvature and the sides
    bend = 2 * sum(max(outline.half_width) ** 2 / min(outline.half_width) for outline in (held, clear))
    difference = held.support(n) - clear.support(n)
    return float(difference.min() - bend * (np.pi / 2 / count) ** 2 / 8)
