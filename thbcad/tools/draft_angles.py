"""Draft angles of a lens for moulding: between the pull along z and its faces, in degrees."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from thbcad.certified import Enclosure, greatest_slope
from thbcad.checks import EPS
from thbcad.lens import Lens, edge_names, ruled_edges

ANGLES = 1e-5  # relative tolerance of slopes
ALONG, ACROSS = 257, 5  # positions on each wall, from rim to rim


@dataclass(frozen=True)
class WallDraft:
    """The least draft of a wall, degrees, and its position, mm; sampled."""

    name: str
    angle: float
    x: float
    y: float


@dataclass(frozen=True)
class Draft:
    """The least draft angles of a lens, degrees: certified for front and rear, sampled for the walls."""

    front: Enclosure
    rear: Enclosure
    walls: tuple[WallDraft, ...]


def draft(lens: Lens) -> Draft:
    """Return the least draft angles against a pull along z: 90 degrees less the greatest slope.

    A wall between rims of equal size is parallel to the pull: its draft is 0.  Otherwise a wall leans, and
    leaves a mould that opens towards the smaller rim.
    """
    outlines = lens.front.outline, lens.rear.outline
    front, rear = (
        _least_draft(greatest_slope(graph, ANGLES, outline))
        for graph, outline in zip(lens.own_graphs(), outlines)
    )
    return Draft(front, rear, tuple(_walls(lens)))


def _walls(lens: Lens) -> Iterator[WallDraft]:
    """Yield the least angle between each wall and the pull: arcsin |n_z| of its unit normal n."""
    for name, wall in zip(edge_names(lens), ruled_edges(lens)):
        u, v = np.linspace(wall.kv_u.start, wall.kv_u.stop, ALONG), np.linspace(0, 1, ACROSS)
        points, along, across = (wall.grid(u, v, orders) for orders in ((0, 0), (1, 0), (0, 1)))
        normal = np.cross(along, across)
        lean = np.abs(normal[..., 2]) / np.linalg.norm(normal, axis=-1)
        at = np.unravel_index(int(np.argmin(lean)), lean.shape)
        x, y, _ = map(float, points[at])
        yield WallDraft(name, float(np.degrees(np.arcsin(lean[at]))), x, y)


def _least_draft(slope: Enclosure) -> Enclosure:
    """Return 90 degrees - arctan(slope); its roundings are less than 4 EPS of 90 degrees."""
    lower, value, upper = (
        90 - float(np.degrees(np.arctan(s))) for s in (slope.upper, slope.value, slope.lower)
    )
    slack = 4 * 90 * EPS
    return replace(slope, lower=max(lower - slack, 0.0), value=value, upper=min(upper + slack, 90.0))
