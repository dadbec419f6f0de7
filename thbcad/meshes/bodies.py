"""Watertight meshes of a lens with an elliptic aperture, with a flange, or with both, with a proven chord
error.

Front and rear are grids of n x n cells over a plan: the rectangle, or the ellipse by the concentric map, with
|t| <= |s|

    (x, y) = s (a cos f, b sin f),    f = pi t / (4 s),    and likewise with s and t exchanged.

On a triangle of the plan within a circle of radius R linear interpolation of a function errs by at most
M R^2 / 2, M a bound of its second derivatives in any direction.  By Gershgorin's theorem
M = max(|z_xx|, |z_yy|) + |z_xy|.  A chord of the ellipse over the angle d lies within
e = max(a, b) d^2 / 8 of it; a wall point is then within e (1 + |grad z|) and the error in z of the wall.

Sources: P. Shirley, K. Chiu, A low distortion map between disk and square, 1997; S. Waldron, The error in
linear interpolation at the vertices of a simplex, SIAM J. Numer. Anal. 35 (1998), theorem 2.1.
"""

from __future__ import annotations

import numpy as np

from thbcad.certified import cell_bounds
from thbcad.checks import Floats, require_number
from thbcad.lens import (
    ALLOWANCE,
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
from thbcad.splines import BSplineSurface

SINGLE = 2.0**-24  # relative rounding of float32
STEPS = ("front", "flange front", "flange side", "flange rear", "rear")  # of a wall with a flange


def body_mesh(
    lens: Lens,
    chord: float,
    aperture: tuple[float, float] | None = None,
    flange: Flange | None = None,
    single: bool = False,
) -> Tessellation:
    """Return a mesh of the lens, cut to an elliptic aperture and with a flange if they are given.

    chord : mm, the error that it may have.  aperture : semi-axes (a, b), mm.  single : round the vertices to
    float32; the chord error includes what that adds.

    Raises
    ------
    ValueError : as `tessellated`, `require_aperture` and `require_clear`; a flange round a rectangular lens
        whose front and rear differ in size.
    """
    if aperture is None and flange is None:
        return tessellated(lens, chord, single)
    require_number("chord", chord, least=LEAST_CHORD, finite=True)
    require_sound(lens)
    if aperture is not None:
        require_aperture(lens, aperture)
    elif lens.front.half_width != lens.rear.half_width:
        raise ValueError(
            "the edges of a flange are meshed where front and rear have one size; cut both by an "
            "aperture, or export step"
        )
    if flange is not None:
        require_clear(lens, flange, aperture)
    bend, slope = _bends(lens.graphs())
    half = np.array(lens.front.half_width if aperture is None else aperture)
    outer = half + (flange.width if flange else 0.0)
    size = max(outer.max(), *(abs(graph.coefficients).max() for graph in lens.graphs())) + lens.thickness
    added = ALLOWANCE + (2 * SINGLE * size * (1 + slope) if single else 0.0)
    cells, bound = _cells(half, outer.max(), aperture is not None, (bend, slope), chord - added)
    vertices = _vertices(lens, _plan(half, cells, aperture is not None), outer / half, flange)
    if single:
        vertices = vertices.astype(np.float32).astype(np.float64)
    triangles, strips = closed_triangles(cells, cells, 5 if flange else 1)
    require_apart(vertices, triangles)
    return Tessellation(vertices, triangles, strips, bound + added, _names(flange is not None))


def _bends(graphs: tuple[BSplineSurface, BSplineSurface]) -> tuple[float, float]:
    """Return bounds of the second derivatives and of the slope of both graphs in any direction."""
    bends, slopes = [], []
    for graph in graphs:
        xx, xy, yy, x, y = cell_bounds(graph, ((2, 0), (1, 1), (0, 2), (1, 0), (0, 1)))
        bends.append(float((np.maximum(xx, yy) + xy).max()))
        slopes.append(float(np.hypot(x, y).max()))
    return max(bends), max(slopes)


def _cells(
    half: Floats, reach: float, round_: bool, bounds: tuple[float, float], chord: float
) -> tuple[int, float]:
    """Return how many cells the plan has along each side, and the chord error that they keep.

    reach : the greatest semi-axis of a round wall, mm.  bounds : of second derivatives and slopes.
    """
    bend, slope = bounds
    cells = 1
    while 4 * cells**2 <= MOST_TRIANGLES:
        plan = _plan(half, cells, round_)
        sag = reach * (np.pi / (2 * cells)) ** 2 / 8 if round_ else 0.0
        bound = bend * _greatest_circle(plan) / 2 + sag * (1 + slope)
        if bound <= chord:
            return cells, bound
        cells = max(cells + 1, int(np.ceil(cells * np.sqrt(bound / chord))) if chord > 0 else 2 * cells)
    raise ValueError(
        f"a chord error of {chord:.3g} mm needs more than {MOST_TRIANGLES:,} triangles; allow a greater one"
    )


def _greatest_circle(plan: Floats) -> float:
    """Return R^2 of the greatest of the least circles round the triangles of a plan (n + 1, n + 1, 2)."""
    a, b, c, d = plan[:-1, :-1], plan[1:, :-1], plan[1:, 1:], plan[:-1, 1:]
    greatest = 0.0
    for corners in ((a, b, c), (a, c, d)):
        squares = np.sort(
            [((p - q) ** 2).sum(axis=-1) for p, q in zip(corners, (*corners[1:], corners[0]))], 0
        )
        u, v = corners[1] - corners[0], corners[2] - corners[0]
        double_area = np.abs(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])
        blunt = squares[2] >= squares[0] + squares[1]
        around = squares.prod(axis=0) / (4 * double_area**2)  # the circle through the corners
        greatest = max(greatest, float(np.where(blunt, squares[2] / 4, around).max()))
    return greatest * (1 + 1e-12)  # the rounding of these few operations


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
    levels = []
    for graph, vertex in zip(lens.graphs(), (0.0, lens.thickness)):
        x, y = (np.clip(row, kv.start, kv.stop) for row, kv in zip(positions.T, (graph.kv_u, graph.kv_v)))
        levels.append(np.column_stack([positions, vertex + graph(x, y)]))
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
