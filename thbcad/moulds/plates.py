"""Plates: like lenses side by side, joined by a flat land between the planes z = low and z = high.

The rims of all fronts lie below the land, those of all rears above it, so that each lens stands out of it on
both sides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import TypeAlias

import numpy as np

from thbcad.checks import Floats
from thbcad.lens import Flange, Lens, edge_names, flanged_volume, require_sound, rim_gap, walls_of
from thbcad.moulds.moulded_body import Solid
from thbcad.outlines import LEAST_SIZE, Outline

BESIDE = 0.25  # of the room between the rims: what the land leaves to the walls on either side


@dataclass(frozen=True, eq=False)
class Plate:
    """Like lenses on one plate, proven apart.

    lens : the first of them, in its own frame, which is that of the plate.
    counts, pitch : of all lenses, and mm between their axes, in x and y.
    low, high : z of the planes of the land, mm.
    """

    lens: Lens
    counts: tuple[int, int]
    pitch: tuple[float, float]
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
        return cls(lens, counts, pitch, top + beside, bottom - beside)

    @cached_property
    def places(self) -> Floats:
        """The axes of all lenses, (n, 2), mm; the first at (0, 0), the others by their distance from it."""
        x, y = (step * (np.arange(n) - (n - 1) // 2) for n, step in zip(self.counts, self.pitch))
        places = np.array([(a, b) for b in y for a in x])
        return np.asarray(places[np.argsort(np.hypot(*places.T), kind="stable")])

    @property
    def outline(self) -> Outline:
        """The outline of the land, round `middle`."""
        (columns, rows), (x, y) = self.counts, self.pitch
        return Outline((columns * x / 2, rows * y / 2))

    @property
    def index(self) -> float:
        """Of refraction."""
        return self.lens.index

    @property
    def middle(self) -> tuple[float, float]:
        """The middle of all lenses, mm."""
        x, y = (step * ((n - 1) / 2 - (n - 1) // 2) for n, step in zip(self.counts, self.pitch))
        return x, y

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
        around = flange.around(walls_of(self.lens, None)).area
        outside = flanged_volume(self.lens, flange) - depth * around
        return len(self.places) * outside + depth * prod(2 * h for h in self.outline.half_width)


Made: TypeAlias = Solid | Plate  # the solid of a file


def lens_of(solid: Made) -> Lens:
    """Return the lens that is made as a solid, the first of a plate."""
    return solid if isinstance(solid, Lens) else solid.lens


def named_on_plate(names: Sequence[str], number: int) -> list[str]:
    """Return the names of faces of lens `number` of a plate, counted from 0; the first has no number."""
    return [f"{name} {number + 1}" if number else name for name in names]
