"""Watertight meshes of a lens within an outline, its own or an elliptic aperture, with a flange or without,
with a proven chord error; those of polygons are next door.

Where front and rear differ in size they have one plan, scaled.  Of the rims F(w) and R(w) a wall is ruled,
(1 - v) F + v R.  With a bound M of |F''| and |R''| it lies within M d^2 / 8 of the bilinear patches between
chords over d in w.

A patch with the sides E and G = E + T lies within |N| / 4 max(1, |E|^2 / (E.G)) of its triangle over E, where
N is the part of T across E: with T = a E + N and s' = (s + v a) / (1 + v a) points of triangle and patch
differ by v (1 - s') N.  Likewise of the triangle over G.  T falls as the wall is cut into rows.
"""

from collections.abc import Sequence

import numpy as np

from thbcad.checks import Floats, require_number
from thbcad.lens import (
    EDGES,
    LEAST_CHORD,
    MOST_TRIANGLES,
    SIDES,
    Flange,
    Lens,
    Tessellation,
    closed_triangles,
    require_clear,
    require_sound,
    rim_indices,
    tessellated,
    told_apart,
    walls_of,
)
from thbcad.meshes.plans import (
    Bounds,
    bounds_of,
    on_surfaces,
    plan_error,
    plan_within,
    too_many,
    turning,
    unit_plan,
)
from thbcad.meshes.polygon_bodies import polygon_mesh
from thbcad.outlines import UPRIGHT, Outline

# the names of the faces of a wall with a flange, from front to rear
STEPS = ("edge {} front", "flange front {}", "flange side {}", "flange rear {}", "edge {} rear")


def tapered_mesh(lens: Lens, chord: float, single: bool = False) -> Tessellation:
    """Return a mesh of a lens with an outline; its faces have the names of `tessellated`.

    lens : a sound one.  chord : mm, the error that it may have.  single : round the vertices to float32.
    """
    shapes = lens.front.outline, lens.rear.outline
    bounds = bounds_of(lens, max(max(shape.half_width) for shape in shapes), shapes)
    added = bounds.rounding(single)
    plan, bound, chords = _plan(shapes, bounds, chord - added)
    front, rear = on_surfaces(lens, *((plan * shape.half_width).reshape(-1, 2) for shape in shapes))
    cells = len(plan) - 1
    ring = rim_indices(*plan.shape[:2])
    rows, twist = 1, np.inf
    while chords + twist > chord - added:
        levels = front[ring] + (np.arange(rows + 1) / rows)[:, None, None] * (rear - front)[ring]
        twist = _twist(levels)
        needed = 4 * cells * (cells + 2 * rows)
        if needed > MOST_TRIANGLES or chords >= chord - added:
            raise too_many(chord)
        rows = max(rows + 1, int(np.ceil(rows * min(twist / (chord - added - chords), MOST_TRIANGLES))))
    triangles, strips = closed_triangles(cells, cells, len(levels) - 1)
    vertices = told_apart(np.concatenate([front, rear, *levels[1:-1]]), triangles, single)
    faces = np.where(strips < EDGES[0], strips, EDGES[0] + (strips - EDGES[0]) % len(EDGES))
    return Tessellation(vertices, triangles, faces, max(bound, chords + twist) + added)


def _plan(shapes: tuple[Outline, Outline], bounds: Bounds, chord: float) -> tuple[Floats, float, float]:
    """Return the unit plan with the fewest cells that keep a chord error, on the walls but for their twist
    half of it, and both errors."""
    bend = max(max(shape.corners) * turning(shape) ** 2 for shape in shapes) * (1 + bounds.slope)
    speed = max(max(shape.corners) * turning(shape) for shape in shapes)
    cells = 1
    while 4 * cells**2 <= MOST_TRIANGLES:
        plan = unit_plan(shapes[1], cells)
        pairs = zip(bounds.bends, shapes)
        bound = max(plan_error(bends, plan * shape.half_width) for bends, shape in pairs)
        bound += bend / cells**2 / 2
        chords = (bend + bounds.bend * speed**2) / cells**2 / 2
        if max(bound, 2 * chords) <= chord:
            return plan, bound, chords
        much = max(bound, 2 * chords) / chord if chord > 0 else 4.0
        cells = max(cells + 1, int(np.ceil(cells * np.sqrt(much))))
    raise too_many(chord)


def _twist(levels: Floats) -> float:
    """Return how far the bilinear patches between rings lie from their triangles at most, mm.

    levels : (rows + 1, n, 3)
    """
    sides = np.roll(levels, -1, axis=1) - levels
    greatest = 0.0
    for own, other in ((sides[:-1], sides[1:]), (sides[1:], sides[:-1])):
        square, along = (own**2).sum(axis=-1), (own * other).sum(axis=-1)
        if (along <= 0).any():
            return np.inf
        across = np.linalg.norm(other - own * (along / square)[..., None], axis=-1)
        greatest = max(greatest, float((across / 4 * np.maximum(1.0, square / along)).max()))
    return greatest


def body_mesh(
    lens: Lens,
    chord: float,
    aperture: tuple[float, float] | None = None,
    flange: Flange | None = None,
    single: bool = False,
    polygon: Sequence[tuple[float, float]] | None = None,
) -> Tessellation:
    """Return a mesh of the lens, whole or cut to an elliptic aperture, with a flange or without, or cut to a
    polygon.

    chord : mm, the error that it may have.  aperture : semi-axes (a, b), mm.  single : round the vertices to
    float32; the chord error includes what that adds.  polygon : corners (x, y), mm.

    Raises ValueError : as `tessellated`, `require_aperture`, `require_clear` and `require_polygon`; a polygon
        beside an aperture or a flange; a flange round a lens whose front and rear differ in size.
    """
    require_number("chord", chord, least=LEAST_CHORD, finite=True)
    require_sound(lens)
    if polygon is not None:
        if aperture is not None or flange is not None:
            raise ValueError("a polygon is an outline by itself: leave out aperture and flange")
        return polygon_mesh(lens, chord, polygon, single)
    shape = walls_of(lens, aperture)
    if flange is None and shape.is_rectangle:
        return tessellated(lens, chord, single)
    if aperture is None and lens.taper != UPRIGHT:
        if flange is None:
            return tapered_mesh(lens, chord, single)
        raise ValueError(
            "the edges of a flange are meshed where front and rear have one size; cut both by an "
            "aperture, or export step"
        )
    if flange is not None:
        require_clear(lens, flange, aperture)
    outer = shape if flange is None else flange.around(shape)
    bounds = bounds_of(lens, max(outer.half_width), (shape, shape))
    added = bounds.rounding(single)
    plan, bound = plan_within(shape, outer, bounds, chord - added)
    cells = len(plan) - 1
    triangles, strips = closed_triangles(cells, cells, 5 if flange else 1)
    vertices = told_apart(_vertices(lens, plan, shape, outer, flange), triangles, single)
    return Tessellation(vertices, triangles, strips, bound + added, _names(flange is not None))


def _vertices(lens: Lens, plan: Floats, shape: Outline, outer: Outline, flange: Flange | None) -> Floats:
    """Return front and rear grids and the rings of a flange between them, (n, 3)."""
    positions = (plan * shape.half_width).reshape(-1, 2)
    levels = on_surfaces(lens, positions, positions)
    if flange is not None:
        ring = rim_indices(*plan.shape[:2])
        inner = positions[ring]
        beyond = (unit_plan(outer, len(plan) - 1) * outer.half_width).reshape(-1, 2)[ring]
        for around, z in (
            (inner, flange.low),
            (beyond, flange.low),
            (beyond, flange.high),
            (inner, flange.high),
        ):
            levels.append(np.column_stack([around, np.full(len(around), z)]))
    return np.concatenate(levels)


def _names(flanged: bool) -> tuple[str, ...]:
    """Return the names of the faces in the order of `closed_triangles`."""
    sides = [side.name for side in SIDES]
    if not flanged:
        return ("front", "rear", *sides)
    places = [side.removeprefix("edge ") for side in sides]
    return ("front", "rear", *(step.format(place) for step in STEPS for place in places))
