"""Bodies that leave a mould: a lens with drafted walls from a parting line, and with a flat land round the
smaller surface."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from thbcad.certified import greatest_slope
from thbcad.checks import Floats
from thbcad.lens import Lens
from thbcad.moulds.body_proofs import require_glass, require_parting, require_radius
from thbcad.moulds.body_shape import BodyShape
from thbcad.moulds.body_walls import (
    BodyOptions,
    inner_wall,
    least_support,
    middle_of_rims,
    outline_and_smaller,
)
from thbcad.moulds.drafted_walls import DraftedWall
from thbcad.moulds.inserts import FACES
from thbcad.outlines import RELATIVE, Outline
from thbcad.splines import KnotVector

ROUGH = 1e-2  # relative, of bounds that need no more
SHORT_SPANS = 4096  # of a piece of a rim: their hulls exceed a circle of radius r by less than 3e-7 r


class MouldedBody(BodyShape):
    """A `BodyShape`, proven."""

    @classmethod
    def of(
        cls, lens: Lens, options: BodyOptions, clear: tuple[Outline, Outline] | None = None
    ) -> MouldedBody:
        """Return the body of a lens.

        clear : the outlines that front and rear must leave free; None asks for nothing

        It is proven that every ray of the wall meets a surface once (slope tan(draft) < 1), that the parting
        line lies between the rims, that the land lies outside of the glass, and that the rims lie around the
        clear aperture.

        Raises ValueError : an annulus of like surfaces, unlike ones without; an outline that cannot have
            draft; what cannot be proven.
        """
        outline, small = outline_and_smaller(lens, options)
        for word, graph, surface in zip(FACES, lens.graphs(), (lens.front, lens.rear)):
            steepest = greatest_slope(graph, ROUGH, surface.outline).upper
            if steepest * np.tan(np.radians(options.draft)) >= 1:
                raise ValueError(
                    f"walls with a draft of {options.draft:g} degrees may not meet the {word}, whose slope "
                    f"is up to {steepest:.6g}; make lens.body.draft smaller"
                )
        inner = None if small is None else inner_wall(lens, options, small)
        parting = options.parting
        if parting is None:
            parting = inner.level if inner is not None else middle_of_rims(lens, outline)
        pair = tuple(DraftedWall(outline, float(parting), options.draft, side) for side in (-1, 1))
        body = cls(lens, (pair[0], pair[1]), inner, small, options.edge_radius)
        require_parting(body)
        require_glass(body)
        if body.edge_radius:
            require_radius(body)
        if clear is not None:
            body.require_clear(clear)
        return body

    @property
    def least_inset(self) -> tuple[float, float]:
        """How far the rims of front and rear lie within their outlines at most, mm."""
        front, rear = (
            max(0.0, *(wall.inset(z) for z in foot.heights))
            for wall, foot in zip((self.wall(0), self.wall(1)), self.feet)
        )
        return front, rear

    def volume(self) -> float:
        """Return the volume, mm^3, by Gauss rules along the rims."""
        held = [self.wall(k).volume(self.lens, k, *self.ends(k)) for k in (0, 1)]
        rounded = sum(
            (2 * k - 1) * edge.volume_above(self.walls[k].level) for k, edge in self.rounded_edges.items()
        )
        if self.inner is None or self.small is None:
            return rounded + held[1] - held[0]
        land, across = self.inner.level, self.walls[self.small]
        areas = [across.at(z).area for z in (land, (land + self.parting) / 2, self.parting)]
        frustum = abs(land - self.parting) * (areas[0] + 4 * areas[1] + areas[2]) / 6
        return frustum + rounded + held[1] - held[0]

    @property
    def face_count(self) -> int:
        """How many faces its solid has."""
        around = len(self.outline.pieces)
        land = 0 if self.inner is None else 1 + self.stepped * around
        return 2 + land + around * (1 + self.has_ridge + len(self.rounded))

    @property
    def has_ridge(self) -> bool:
        """Whether its walls taper to both sides of the parting line."""
        return self.walls[0].draft > 0 and (self.inner is None or self.inner.level != self.parting)

    @property
    def level_edges(self) -> list[tuple[Outline, float]]:
        """Outlines and z, mm, of the level edges between the rims of front and rear, in this order."""
        ridge = [(self.outline, self.parting)] * self.has_ridge
        if self.inner is None or self.small is None:
            return ridge
        hole, z = [(self.inner.outline, self.inner.level)] * self.stepped, self.inner.level
        land = [*hole, (self.walls[self.small].at(z), z)]
        return [*land, *ridge] if self.small == 0 else [*ridge, *land[::-1]]

    @property
    def free(self) -> tuple[Outline, Outline]:
        """Outlines on front and rear that walls and rounded edges are proven to leave free.

        An outline scaled by 1 - d / min(hx, hy) lies a depth d within.
        """

        def within(number: int) -> Outline:
            outline = self.wall(number).outline
            half = np.array(outline.half_width)
            return outline.scaled(half * (1 - self._depth(number) / half.min()))

        return within(0), within(1)

    def _depth(self, number: int) -> float:
        """Return how far walls and rounded edges reach into the outline of front or rear at most, mm.

        A curve lies in the hull of the poles of each of its spans, which lies beyond their least support in
        a direction n.  An outline of less support there does not meet it.
        """
        if number not in self.rounded:
            return self.least_inset[number]
        return max(
            _reach(self.outline, piece.kv, piece.on_surface[:, :2])
            for piece in self.rounded_edges[number].pieces
        )

    def require_clear(self, clear: tuple[Outline, Outline]) -> None:
        """Raise ValueError unless walls and rounded edges lie, proven, around outlines of front and rear.

        Of two convex outlines one lies a depth within the other where its support function is everywhere less
        by that depth.  A whole outline into which no wall reaches needs no such proof.
        """
        for number, word in enumerate(FACES):
            depth, outline = self._depth(number), self.wall(number).outline
            asked, all_of_it = ((*o.half_width, *o.corners) for o in (clear[number], outline))
            whole = depth == 0 and np.allclose(asked, all_of_it, rtol=RELATIVE, atol=0.0)
            if not whole and least_support(outline, clear[number]) < depth:
                raise ValueError(
                    f"the wall of the {word} comes {depth:.6g} mm within its outline, and eats the clear "
                    f"aperture, {clear[number].text()}; make lens.body.draft or edge_radius smaller"
                )

    def off_walls(self, x: Floats, y: Floats, z: Floats) -> float:
        """Return the greatest distance of points from the one wall, or the land, on which they lie, mm."""
        off = [abs(wall.beside(x, y, z)).max() for wall in (*self.walls, self.inner) if wall is not None]
        off += [abs(z - self.inner.level).max()] if self.inner is not None else []
        return float(min(off))


def _reach(outline: Outline, kv: KnotVector, poles: Floats) -> float:
    """Return the greatest depth within an outline, mm, of a counter-clockwise curve of poles (n, 2)."""
    fine = kv
    while fine.spans < SHORT_SPANS:
        fine = fine.bisect()
    poles = kv.prolongation(fine) @ poles
    first = np.flatnonzero(np.diff(fine.knots) > 0) - fine.degree
    hulls = poles[first[:, None] + np.arange(fine.degree + 1)]  # (spans, degree + 1, 2)
    u, v = (hulls[:, -1] - hulls[:, 0]).T / np.linalg.norm(hulls[:, -1] - hulls[:, 0], axis=1)
    n = np.stack([v, -u])
    depths = outline.support(n) - np.einsum("ks,spk->sp", n, hulls).min(axis=1)
    return max(0.0, float(depths.max()))


Solid: TypeAlias = Lens | MouldedBody  # what a lens is made as
