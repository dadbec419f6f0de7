"""Plates: like lenses side by side, joined by a flat land between the planes z = low and z = high.

The rims of all fronts lie below the land, those of all rears above it, so that each lens stands out of it on
both sides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod
from typing import TypeAlias

import numpy as np

from thbcad.checks import Floats
from thbcad.lens import Flange, Lens, edge_names, flanged_volume, require_sound, rim_gap
from thbcad.moulds.moulded_body import MouldedBody
from thbcad.outlines import LEAST_SIZE, Outline

BESIDE = 0.25  # of the room between the rims: what the land leaves to the walls on either side


@dataclass(frozen=True, eq=False)
class Plate:
    """Like lenses on one plate, proven apart.

    lens : the first of them, in its own frame, which is that of the plate.
    places : (n, 2), mm, of the axes of all lenses, the first at (0, 0).
    outline : of the land, round the middle of all lenses.
    low, high : z of the planes of the land, mm.
    """

    lens: Lens
    places: Floats
    outline: Outline
    low: float
    high: float

    @classmethod
    def of(cls, lens: Lens, counts: tuple[int, int], pitch: tuple[float, float]) -> Plate:
        """Return the plate of counts[0] x counts[1] lenses, pitch[0] and pitch[1] mm apart in x and y.

        The first lens is the one nearest to the middle, towards -x and -y.  The land is half as thick as the
        room between the rims of front and rear, and reaches half a pitch beyond the outer axes.

        Raises ValueError : as `require_sound`; lenses that touch; rims without room between them.
        """
        require_sound(lens)
        for axis, (step, *halves) in enumerate(zip(pitch, lens.front.half_width, lens.rear.half_width)):
            if step < 2 * max(halves) + LEAST_SIZE:
                raise ValueError(
                    f"lenses {2 * max(halves):g} mm wide in {'xy'[axis]} cannot lie {step:g} mm apart: make "
                    "the pitch larger, so that there is land between them"
                )
        top, bottom = rim_gap(lens)
        beside = BESIDE * (bottom - top)
        if beside < LEAST_SIZE:
            raise ValueError(
                f"the land needs room between the rims: the front's reaches up to z = {top:.6g} mm, the "
                f"rear's down to {bottom:.6g} mm; make the lens thicker by more than {top - bottom:.6g} mm"
            )
        x, y = (step * (np.arange(n) - (n - 1) // 2) for n, step in zip(counts, pitch))
        places = np.array([(a, b) for b in y for a in x])
        order = np.argsort(np.hypot(*places.T), kind="stable")
        outline = Outline((counts[0] * pitch[0] / 2, counts[1] * pitch[1] / 2))
        return cls(lens, places[order], outline, top + beside, bottom - beside)

    @property
    def index(self) -> float:
        """Of refraction."""
        return self.lens.index

    @property
    def thickness(self) -> float:
        """That of each lens, mm."""
        return self.lens.thickness

    @property
    def middle(self) -> tuple[float, float]:
        """The middle of all lenses, mm."""
        x, y = (self.places.min(axis=0) + self.places.max(axis=0)) / 2
        return float(x), float(y)

    @property
    def rounded(self) -> tuple[int, ...]:
        """As of `MouldedBody`: its edges are sharp."""
        return ()

    @property
    def face_count(self) -> int:
        """How many faces its solid has: those of all lenses, with two walls on every edge, and the land's."""
        return len(self.places) * (2 + 2 * len(edge_names(self.lens))) + 6

    def volume(self) -> float:
        """Return the volume, mm^3: that of every lens without what lies in the land, and the land."""
        flange = Flange(1.0, self.low, self.high)
        depth = self.high - self.low
        outside = flanged_volume(self.lens, flange) - depth * flange.around(self.lens.rear.outline).area
        return len(self.places) * outside + depth * prod(2 * h for h in self.outline.half_width)


Solid: TypeAlias = Lens | MouldedBody | Plate  # what a lens is made as


def lens_of(solid: Solid) -> Lens:
    """Return the lens that is made as a solid, the first of a plate."""
    return solid if isinstance(solid, Lens) else solid.lens


def named_on_plate(names: Sequence[str], number: int) -> list[str]:
    """Return the names of faces of lens `number` of a plate, counted from 0; the first has no number."""
    return [f"{name} {number + 1}" if number else name for name in names]
