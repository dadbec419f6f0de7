"""What makes a lens a body that leaves a mould, in numbers, and where its walls stand: its outline, the wall
round the smaller surface, the parting line.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from thbcad.checks import require_number, shown
from thbcad.lens import Lens
from thbcad.moulds.drafted_walls import DraftedWall
from thbcad.moulds.inserts import FACES
from thbcad.outlines import LEAST_SIZE, RELATIVE, Outline

MOST_DRAFT = 45.0  # degrees
LAND_STEP = 0.1  # mm between a rim that is not level and its land: what a mould can still hold


@dataclass(frozen=True)
class BodyOptions:
    """What makes a lens a body that leaves a mould.

    draft : degrees by which the walls taper, 0 to 45
    parting : z of the parting line, mm, where the body has the outline of its larger surface; None is the
        land, else the middle between the rims of front and rear
    annulus : whether a flat land joins the smaller surface to the outline of the larger
    land : z of that land, mm; None is the smaller surface's rim, 0.1 mm outside of it where it is not level
    edge_radius : mm, between the wall and the surfaces that it meets at the body's outline; 0 is sharp

    Raises ValueError : numbers out of range; a land without an annulus.
    """

    draft: float = 0.0
    parting: float | None = None
    annulus: bool = False
    land: float | None = None
    edge_radius: float = 0.0

    def __post_init__(self) -> None:
        for name in ("draft", "edge_radius"):
            require_number(f"lens.body.{name}", getattr(self, name), least=0.0, finite=True)
        if self.draft > MOST_DRAFT:
            raise ValueError(f"lens.body.draft must be at most {MOST_DRAFT:g} degrees, got {self.draft:g}")
        for name in ("parting", "land"):
            if getattr(self, name) is not None:
                require_number(f"lens.body.{name}", getattr(self, name), finite=True)
        if not isinstance(self.annulus, bool):
            raise ValueError(f"lens.body.annulus must be true or false, got {shown(self.annulus)}")
        if self.land is not None and not self.annulus:
            raise ValueError("a land needs annulus = true, got its z alone")

    def scaled(self, factor: float) -> BodyOptions:
        """Return the options of the body enlarged by a factor in x, y and z."""
        parting, land = (None if z is None else factor * z for z in (self.parting, self.land))
        return replace(self, parting=parting, land=land, edge_radius=factor * self.edge_radius)


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
        land = (low, high)[small] + (2 * small - 1) * LAND_STEP if level is None else level
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
