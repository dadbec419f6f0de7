"""The sides of a lens, or the pieces of its outline, the rims of its surfaces there, and the ruled edges
between them.

Sides and corners are counted counter-clockwise as seen from +z: side k runs from corner k to corner k + 1.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thbcad.checks import Floats, Integers
from thbcad.outlines import UPRIGHT, Path, RimPiece, fitted_curve, matched_rims, rim_curve
from thbcad.sags import PlacedConic, graph_poles
from thbcad.splines import UNIT, BSplineSurface, KnotVector

if TYPE_CHECKING:  # tensor-product modules do not load the hierarchy
    from thbcad.lens.freeform_surface import FreeformSurface
    from thbcad.lens.lens import Lens

Corner = tuple[int, int]  # the indices, 0 or -1, of the pole in the corner
Surfaces = tuple[BSplineSurface, BSplineSurface]
OpticalForm = BSplineSurface | PlacedConic
Rim = tuple[KnotVector, Floats]  # knots and poles (x, y, z), (n, 3), mm


@dataclass(frozen=True)
class Side:
    """A side of the rectangle under front and rear.

    name : of the edge face on this side
    axis : int, 0 where the side runs along x, 1 where it runs along y
    end : int, 0 on the low and -1 on the high side of the other axis: the index of its poles
    """

    name: str
    axis: int
    end: int

    @property
    def start(self) -> Corner:
        """The corner from which x or y rises along the side."""
        return (0, self.end) if self.axis == 0 else (self.end, 0)

    @property
    def stop(self) -> Corner:
        """The corner up to which x or y rises along the side."""
        return (-1, self.end) if self.axis == 0 else (self.end, -1)

    @property
    def clockwise(self) -> bool:
        """Whether x or y rises clockwise along the side."""
        return (self.axis == 0) == (self.end == -1)


SIDES = (Side("edge -y", 0, 0), Side("edge +x", 1, -1), Side("edge +y", 0, -1), Side("edge -x", 1, 0))
CORNERS: tuple[Corner, ...] = ((0, 0), (-1, 0), (-1, -1), (0, -1))


def placed_surfaces(lens: Lens) -> Surfaces:
    """Return front and rear as BSplineSurfaces with poles (x, y, z) in the lens's frame, mm.

    Both are parametrised over the rear's rectangle, so that their rims can be ruled.
    """
    return _placed(lens.graphs(), lens.thickness)


def optical_forms(lens: Lens) -> tuple[OpticalForm, OpticalForm]:
    """Return front and rear as CAD files hold them, in the lens's frame, mm.

    A plane, a sphere and another conic without sag is a PlacedConic, all else a BSplineSurface as of
    `placed_surfaces` in the degrees of its own sag: paraboloids, and conics that a file would not hold
    exactly.
    """
    front = _placed_conic(lens.front, 0.0)
    rear = _placed_conic(lens.rear, lens.thickness)
    if front is not None and rear is not None:
        return front, rear
    splines = _placed(lens.own_graphs(), lens.thickness)
    return front or splines[0], rear or splines[1]


def _placed(graphs: tuple[BSplineSurface, BSplineSurface], thickness: float) -> Surfaces:
    front, rear = graphs
    return graph_poles(front, 0.0, rear), graph_poles(rear, thickness, rear)


def _placed_conic(surface: FreeformSurface, vertex: float) -> PlacedConic | None:
    """Return a surface as a PlacedConic, None where a spline holds it better."""
    if surface.sag is not None:
        return None
    placed = PlacedConic(surface.conic, vertex, surface.half_width)
    return placed if placed.exact else None


def rim(surface: BSplineSurface, side: Side) -> tuple[KnotVector, Floats]:
    """Return knots and poles, (n, ...), of the boundary curve of a surface on a side, x or y rising."""
    net = surface.coefficients
    return (surface.kv_u, surface.kv_v)[side.axis], net[:, side.end] if side.axis == 0 else net[side.end]


def rim_parameter(surface: BSplineSurface, side: Side) -> float:
    """Return the parameter that is constant along a side: v on those along x, u on those along y."""
    kv = (surface.kv_v, surface.kv_u)[side.axis]
    return kv.start if side.end == 0 else kv.stop


def ruled_edge(surfaces: Surfaces, side: Side) -> BSplineSurface:
    """Return the ruled surface between the rims of front (v = 0) and rear (v = 1) on a side, mm.

    surfaces : as `placed_surfaces`.  The first parameter is that of the rims, on the knots of both.
    """
    front, rear = (rim(surface, side) for surface in surfaces)
    kv = front[0].merge(rear[0])
    return BSplineSurface(
        kv, UNIT, np.stack([own.prolongation(kv) @ poles for own, poles in (front, rear)], axis=1)
    )


def ruled_edges(lens: Lens) -> list[BSplineSurface]:
    """Return the edges of a lens: of a rectangle in the order of SIDES, as `ruled_edge`; else above the
    pieces of its outline, as `matched_rims`, from front (v = 0) to rear (v = 1), mm."""
    if lens.rear.outline.is_rectangle:
        surfaces = placed_surfaces(lens)
        return [ruled_edge(surfaces, side) for side in SIDES]
    edges = []
    for pair in zip(*rim_pieces(lens)):
        kv, poles = matched_rims(lens.own_graphs(), pair)
        vertices = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, lens.thickness]])
        edges.append(BSplineSurface(kv, UNIT, poles.reshape(-1, 2, 3) + vertices))
    return edges


def edge_names(lens: Lens) -> tuple[str, ...]:
    """Return the names of the edges in the order of `ruled_edges`."""
    outline = lens.rear.outline
    if outline.is_rectangle:
        return tuple(side.name for side in SIDES)
    return tuple(f"edge {k + 1}" for k in range(len(outline.pieces)))


def rim_pieces(lens: Lens) -> tuple[tuple[RimPiece, ...], tuple[RimPiece, ...]]:
    """Return the pieces of the outlines of front and rear, of equal relative position at equal parameters."""
    rear = lens.rear.outline.pieces
    return tuple(piece.scaled(lens.taper) for piece in rear) if lens.taper != UPRIGHT else rear, rear


def outline_rims(lens: Lens, k: int, pieces: Sequence[RimPiece]) -> list[Rim]:
    """Return the rims of the front (k = 0) or the rear (k = 1) above the pieces of an outline, as
    `rim_curve`; on a PlacedConic as `fitted_curve`."""
    surface = optical_forms(lens)[k]
    if isinstance(surface, PlacedConic):
        once = np.ones(2, dtype=np.int64)
        return [fitted_curve(above(surface, piece), np.array(piece.ends), once) for piece in pieces]
    vertex = np.array([0.0, 0.0, k * lens.thickness])
    curves = (rim_curve(lens.own_graphs()[k], piece) for piece in pieces)
    return [(kv, poles + vertex) for kv, poles in curves]


def above(conic: PlacedConic, piece: Path) -> Callable[[Floats], Floats]:
    """Return the curve of a conic above a piece of an outline: t (n,) to points (n, 3), mm."""

    def points(t: Floats) -> Floats:
        x, y = piece(t)
        return np.column_stack([x, y, conic(x, y) + 0 * x])

    return points


def rim_indices(nx: int, ny: int) -> Integers:
    """Return the numbers of the points on the rim of a grid of nx x ny points, y first, counter-clockwise."""
    grid = np.arange(nx * ny).reshape(nx, ny)
    return np.concatenate([grid[:-1, 0], grid[-1, :-1], grid[:0:-1, -1], grid[0, :0:-1]])
