"""Watertight meshes of a lens within an outline, its own or an elliptic aperture, with a flange or without,
with a proven chord error; those of polygons are next door.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from thbcad.checks import Floats, require_number
from thbcad.lens import (
    LEAST_CHORD,
    SIDES,
    Flange,
    Lens,
    Tessellation,
    closed_triangles,
    require_apart,
    require_clear,
    require_sound,
    rim_indices,
    tessellated,
    walls_of,
)
from thbcad.meshes.plans import bounds_of, on_surfaces, plan_within, unit_plan
from thbcad.meshes.polygon_bodies import polygon_mesh
from thbcad.meshes.tapered_bodies import tapered_mesh
from thbcad.outlines import UPRIGHT, Outline

STEPS = ("front", "flange front", "flange side", "flange rear", "rear")  # of a wall with a flange


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

    Raises
    ------
    ValueError : as `tessellated`, `require_aperture`, `require_clear` and `require_polygon`; a polygon beside
        an aperture or a flange; a flange round a lens whose front and rear differ in size.
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
    vertices = _vertices(lens, plan, shape, outer, flange)
    if single:
        vertices = vertices.astype(np.float32).astype(np.float64)
    cells = len(plan) - 1
    triangles, strips = closed_triangles(cells, cells, 5 if flange else 1)
    require_apart(vertices, triangles)
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
