"""Watertight meshes of a lens with an elliptic aperture, with a flange, or with both, with a proven chord
error; those of polygons are next door.

Front and rear are grids of n x n cells over a plan: the rectangle, or the ellipse by the concentric map, with
|t| <= |s|

    (x, y) = s (a cos f, b sin f),    f = pi t / (4 s),    and likewise with s and t exchanged.

The error over a triangle of the plan is that of `plans`.  A chord of the ellipse over the angle d lies within
e = max(a, b) d^2 / 8 of it; a wall point is then within e (1 + |grad z|) and the error in z of the wall.

Source: P. Shirley, K. Chiu, A low distortion map between disk and square, 1997.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from thbcad.checks import Floats, require_number
from thbcad.lens import (
    LEAST_CHORD,
    MOST_TRIANGLES,
    SIDES,
    Flange,
    Lens,
    Tessellation,
    closed_triangles,
    require_apart,
    require_aperture,
    require_clear,
    require_sound,
    rim_indices,
    tessellated,
)
from thbcad.meshes.plans import Bounds, bounds_of, greatest_circle, on_surfaces, too_many
from thbcad.meshes.polygon_bodies import polygon_mesh

STEPS = ("front", "flange front", "flange side", "flange rear", "rear")  # of a wall with a flange


def body_mesh(
    lens: Lens,
    chord: float,
    aperture: tuple[float, float] | None = None,
    flange: Flange | None = None,
    single: bool = False,
    polygon: Sequence[tuple[float, float]] | None = None,
) -> Tessellation:
    """Return a mesh of the lens, cut to an elliptic aperture and with a flange, or cut to a polygon.

    chord : mm, the error that it may have.  aperture : semi-axes (a, b), mm.  single : round the vertices to
    float32; the chord error includes what that adds.  polygon : corners (x, y), mm.

    Raises
    ------
    ValueError : as `tessellated`, `require_aperture`, `require_clear` and `require_polygon`; a polygon beside
        an aperture or a flange; a flange round a rectangular lens whose front and rear differ in size.
    """
    if aperture is None and flange is None and polygon is None:
        return tessellated(lens, chord, single)
    require_number("chord", chord, least=LEAST_CHORD, finite=True)
    require_sound(lens)
    if polygon is not None:
        if aperture is not None or flange is not None:
            raise ValueError("a polygon is an outline by itself: leave out aperture and flange")
        return polygon_mesh(lens, chord, polygon, single)
    if aperture is not None:
        require_aperture(lens, aperture)
    elif lens.front.half_width != lens.rear.half_width:
        raise ValueError(
            "the edges of a flange are meshed where front and rear have one size; cut both by an "
            "aperture, or export step"
        )
    if flange is not None:
        require_clear(lens, flange, aperture)
    half = np.array(lens.front.half_width if aperture is None else aperture)
    outer = half + (flange.width if flange else 0.0)
    bounds = bounds_of(lens, float(outer.max()))
    added = bounds.rounding(single)
    cells, bound = _cells(half, outer.max(), aperture is not None, bounds, chord - added)
    vertices = _vertices(lens, _plan(half, cells, aperture is not None), outer / half, flange)
    if single:
        vertices = vertices.astype(np.float32).astype(np.float64)
    triangles, strips = closed_triangles(cells, cells, 5 if flange else 1)
    require_apart(vertices, triangles)
    return Tessellation(vertices, triangles, strips, bound + added, _names(flange is not None))


def _cells(half: Floats, reach: float, round_: bool, bounds: Bounds, chord: float) -> tuple[int, float]:
    """Return how many cells the plan has along each side, and the chord error that they keep.

    reach : the greatest semi-axis of a round wall, mm.
    """
    cells = 1
    while 4 * cells**2 <= MOST_TRIANGLES:
        plan = _plan(half, cells, round_)
        sag = reach * (np.pi / (2 * cells)) ** 2 / 8 if round_ else 0.0
        a, b, c, d = plan[:-1, :-1], plan[1:, :-1], plan[1:, 1:], plan[:-1, 1:]
        circle = max(greatest_circle(a, b, c), greatest_circle(a, c, d))
        bound = bounds.bend * circle / 2 + sag * (1 + bounds.slope)
        if bound <= chord:
            return cells, bound
        cells = max(cells + 1, int(np.ceil(cells * np.sqrt(bound / chord))) if chord > 0 else 2 * cells)
    raise too_many(chord)


def _plan(half: Floats, cells: int, round_: bool) -> Floats:
    """Return the positions (x, y) of a grid over a rectangle or an ellipse, (cells + 1, cells + 1, 2)."""
    s, t = np.meshgrid(*2 * (np.linspace(-1, 1, cells + 1),), indexing="ij")
    if not round_:
        return np.stack([s, t], axis=-1) * half
    flat = np.abs(t) <= np.abs(s)
    long, short = np.where(flat, s, t), np.where(flat, t, s)
    angle = np.pi / 4 * np.divide(short, long, out=np.zeros_like(s), where=long != 0)
    along, across = long * np.cos(angle), long * np.sin(angle)
    return np.stack([np.where(flat, along, across), np.where(flat, across, along)], axis=-1) * half


def _vertices(lens: Lens, plan: Floats, growth: Floats, flange: Flange | None) -> Floats:
    """Return front and rear grids and the rings of a flange between them, (n, 3)."""
    positions = plan.reshape(-1, 2)
    levels = on_surfaces(lens, positions)
    if flange is not None:
        inner = positions[rim_indices(*plan.shape[:2])]
        outer = inner * growth
        for ring, z in ((inner, flange.low), (outer, flange.low), (outer, flange.high), (inner, flange.high)):
            levels.append(np.column_stack([ring, np.full(len(ring), z)]))
    vertices: Floats = np.concatenate(levels)
    return vertices


def _names(flanged: bool) -> tuple[str, ...]:
    """Return the names of the faces in the order of `closed_triangles`."""
    sides = [side.name for side in SIDES]
    if not flanged:
        return ("front", "rear", *sides)
    rows = []
    for step in STEPS:
        prefix = step if step.startswith("flange") else "edge"
        suffix = "" if step.startswith("flange") else f" {step}"
        rows += [f"{prefix} {side.removeprefix('edge ')}{suffix}" for side in sides]
    return ("front", "rear", *rows)
