"""Bodies that leave a mould: a lens with drafted walls from a parting line, and with a flat land round the
smaller surface."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np

from thbcad.certified import greatest_slope, minimum, value_range
from thbcad.checks import Floats
from thbcad.lens import Lens, require_sound, segment
from thbcad.moulds.body_walls import (
    BodyOptions,
    inner_wall,
    least_support,
    middle_of_rims,
    outline_and_smaller,
)
from thbcad.moulds.drafted_walls import DraftedWall, Foot
from thbcad.moulds.inserts import FACES
from thbcad.moulds.rolling_ball import RoundedEdge, rounded_edge
from thbcad.outlines import LEAST_SIZE, RELATIVE, Outline
from thbcad.sags import gap_graph

ROUGH = 1e-2  # relative, of bounds that need no more
SMALLER = (0.9, 0.75, 0.5, 0.35, 0.2, 0.1)  # of edge_radius, tried where it does not fit


@dataclass(frozen=True, eq=False)
class MouldedBody:
    """A lens with drafted walls, proven.

    lens : Lens
    walls : below and above the parting line, towards front and rear
    inner : the wall between the land and the smaller surface, whose level is the land; None without land
    small : 0 where the front is the smaller surface, 1 where the rear is; None without land
    edge_radius : mm, round the rims of the surfaces that meet the outer walls
    """

    lens: Lens
    walls: tuple[DraftedWall, DraftedWall]
    inner: DraftedWall | None
    small: int | None
    edge_radius: float

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
        body._require_parting()
        body._require_glass()
        if body.edge_radius:
            body._require_radius()
        if clear is not None:
            body.require_clear(clear)
        return body

    @property
    def index(self) -> float:
        """Of refraction."""
        return self.lens.index

    @property
    def thickness(self) -> float:
        """That of the lens, mm."""
        return self.lens.thickness

    @property
    def parting(self) -> float:
        """The z of the parting line, mm."""
        return self.walls[0].level

    @property
    def outline(self) -> Outline:
        """The outline of the larger surface."""
        return self.walls[0].outline

    def wall(self, number: int) -> DraftedWall:
        """Return the wall that trims the front (0) or the rear (1)."""
        return self.inner if self.inner is not None and self.small == number else self.walls[number]

    @cached_property
    def feet(self) -> tuple[Foot, Foot]:
        """Where walls meet front and rear."""
        return self.wall(0).foot(self.lens, 0), self.wall(1).foot(self.lens, 1)

    def ends(self, number: int) -> tuple[Foot, Foot]:
        """Return where the front (0) or the rear (1) ends, and where the wall next to it does: on their rim, or
        along the rounding between them."""
        edge = self.rounded_edges.get(number)
        return (edge.on_surface, edge.on_wall) if edge is not None else (self.feet[number],) * 2

    @property
    def stepped(self) -> bool:
        """Whether a wall leads from the land to the smaller surface."""
        if self.inner is None or self.small is None:
            return False
        level = self.feet[self.small].level
        return level is None or abs(level - self.inner.level) >= LEAST_SIZE

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
    def rounded(self) -> tuple[int, ...]:
        """Which of front (0) and rear (1) meet the outer wall in an edge that is rounded."""
        return tuple(k for k in (0, 1) if self.edge_radius and k != self.small)

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
        """Return how far walls and rounded edges reach into the outline of front or rear at most, mm."""
        return self.least_inset[number] + (self._radius_reach(number)[0] if number in self.rounded else 0.0)

    def _radius_reach(self, number: int) -> tuple[float, float]:
        """Return bounds of how far a rounded edge reaches in from the wall, and down it from the rim, mm.

        A ball of radius r that rolls along wall and surface, of draft d and slopes up to tan(s), touches the
        surface at most a = r (1 / cos d + sin s) from the wall, where it is at most a tan(s) lower than its
        rim; it touches the wall at most r + a tan(s) below the rim.
        """
        surface, graph = (self.lens.front, self.lens.rear)[number], self.lens.graphs()[number]
        slope = greatest_slope(graph, ROUGH, surface.outline).upper
        draft, radius = np.radians(self.walls[0].draft), self.edge_radius
        across = radius * (1 / np.cos(draft) + np.sin(np.arctan(slope)))
        return float(across * (1 + np.tan(draft) * slope)), float(radius + across * slope)

    @cached_property
    def rounded_edges(self) -> dict[int, RoundedEdge]:
        """The rounded edges by 0 for the front and 1 for the rear."""
        return {k: rounded_edge(self.walls[k], self.lens, k, self.edge_radius) for k in self.rounded}

    def _require_radius(self) -> None:
        """Raise ValueError where a rounded edge does not fit between its rim and the next edge."""
        if self.outline.is_rectangle:
            raise ValueError(
                "edge_radius needs an outline without sharp corners, round which no ball rolls: take "
                'lens.outline = "rounded" or edge_radius 0'
            )
        unfit = self._unfit()
        if not unfit:
            return
        for share in SMALLER:
            radius = float(f"{share * self.edge_radius:.2g}")
            if not replace(self, edge_radius=radius)._unfit():
                raise ValueError(f"edge_radius = {self.edge_radius:g} mm: {unfit}; {radius:g} mm fits")
        raise ValueError(f"edge_radius = {self.edge_radius:g} mm: {unfit}; take edge_radius 0")

    def _unfit(self) -> str:
        """Return why edges cannot be rounded, "" where they can."""
        for k in self.rounded:
            try:
                reached = self.rounded_edges[k].on_wall.heights[1 - k]
            except ValueError as error:
                return f"at the {FACES[k]} {error}"
            side = 2 * k - 1
            if self.walls[k].draft:
                end, place = self.parting, "the parting line"
            elif 1 - k in self.rounded:
                end, place = (
                    self.rounded_edges[1 - k].on_wall.heights[k],
                    f"the rounding of the {FACES[1 - k]}",
                )
            elif self.inner is not None:
                end, place = self.inner.level, "the land"
            else:
                end, place = self.feet[1 - k].heights[k], f"the rim of the {FACES[1 - k]}"
            if side * (reached - end) < LEAST_SIZE:
                return (
                    f"the rounding of the {FACES[k]} reaches z = {reached:.6g} mm on the wall, and {place} "
                    f"z = {end:.6g} mm"
                )
        return ""

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

    def _require_parting(self) -> None:
        """Raise ValueError where the parting line is not proven to lie between both ends of the walls."""
        for k, word in enumerate(FACES):
            side = 2 * k - 1
            if self.small == k and self.inner is not None:
                beyond, place = side * (self.inner.level - self.parting), "land"
                least = 0.0
            else:
                heights = self.feet[k].heights
                beyond, place = side * (heights[1 - k] - self.parting), f"{word}'s rim"
                least = LEAST_SIZE
            for z in self.feet[k].heights:
                self.wall(k).at(z)  # something is left of its corners
            if beyond < least:
                raise ValueError(
                    f"the parting line at z = {self.parting:.9g} mm must lie {'below' if k else 'above'} the "
                    f"{place}, which reaches z = {self.parting + side * beyond:.9g} mm; change "
                    "lens.body.parting"
                )

    def _require_glass(self) -> None:
        """Raise ValueError where the surfaces, or the land and the larger one, are not proven apart."""
        lens, small = self.lens, self.small
        if self.inner is None or small is None:
            require_sound(lens)
            return
        side, land = self.inner.side, self.inner.level
        if self.stepped and min(side * (z - land) for z in self.feet[small].heights) < LEAST_SIZE:
            raise ValueError(
                f"the land at z = {land:.9g} mm meets the drafted rim of the {FACES[small]}; change "
                "lens.body.land"
            )
        width = least_support(self.walls[small].at(land), self.inner.outline)
        if width < LEAST_SIZE:
            raise ValueError(
                f"the land at z = {land:.9g} mm has no width: the drafted wall leaves {width:.3g} mm round "
                f"the {FACES[small]}; make lens.body.draft smaller"
            )
        graphs = list(lens.graphs())
        half = list((lens.front, lens.rear)[small].half_width)
        graphs[1 - small] = segment(graphs[1 - small], half)
        least = minimum(gap_graph(graphs[0], graphs[1], lens.thickness))
        if least.lower < LEAST_SIZE:
            raise ValueError(
                f"at x = {least.u:.6g}, y = {least.v:.6g} mm front and rear are {least.value:.6g} mm apart; "
                "raise lens.thickness"
            )
        other = value_range(lens.graphs()[1 - small], outline=self.outline)
        nearest = lens.thickness + other[0].lower if small == 0 else other[1].upper
        room = (nearest - self.inner.level) * (1 if small == 0 else -1)
        if room < LEAST_SIZE:
            raise ValueError(
                f"the land at z = {self.inner.level:.9g} mm must lie outside of the {FACES[1 - small]}, "
                f"which reaches z = {nearest:.9g} mm; raise lens.thickness or change lens.body.annulus"
            )


Solid: TypeAlias = Lens | MouldedBody  # what a lens is made as
