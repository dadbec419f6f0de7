"""The shape of a body that leaves a mould: its walls, where they meet front and rear, its rounded edges."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from thbcad.lens import Lens
from thbcad.moulds.drafted_walls import DraftedWall
from thbcad.moulds.rolling_ball import RoundedEdge, rounded_edge
from thbcad.moulds.wall_rims import Foot
from thbcad.outlines import LEAST_SIZE, Outline


@dataclass(frozen=True, eq=False)
class BodyShape:
    """A lens with drafted walls, of which nothing is proven.

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

    @property
    def rounded(self) -> tuple[int, ...]:
        """Which of front (0) and rear (1) meet the outer wall in an edge that is rounded."""
        return tuple(k for k in (0, 1) if self.edge_radius and k != self.small)

    @cached_property
    def rounded_edges(self) -> dict[int, RoundedEdge]:
        """The rounded edges by 0 for the front and 1 for the rear."""
        return {k: rounded_edge(self.walls[k], self.lens, k, self.edge_radius) for k in self.rounded}

    def ends(self, number: int) -> tuple[Foot, Foot]:
        """Return where the front (0) or the rear (1) ends, and where the wall next to it does: on their rim,
        or along the rounding between them."""
        edge = self.rounded_edges.get(number)
        return (edge.on_surface, edge.on_wall) if edge is not None else (self.feet[number],) * 2

    @property
    def stepped(self) -> bool:
        """Whether a wall leads from the land to the smaller surface."""
        if self.inner is None or self.small is None:
            return False
        level = self.feet[self.small].level
        return level is None or abs(level - self.inner.level) >= LEAST_SIZE
