"""Watertight triangle meshes of a lens with a proven chord error.

Front and rear are sampled at the same relative positions, a product grid that holds all knots of
both.  With bounds M of the second derivatives on a cell, linear interpolation on a right triangle
with the legs h and k along the parameters is wrong by at most

    (h^2 M_uu + 2 h k M_uv + k^2 M_vv) / 8;

x and y are linear in the parameters, so that this is the error in z at given (x, y) and the distance
is no greater.  The edges are rows of triangles between the rims.  Where front and rear are of equal
size they are plane and one row is exact but for the chords of the rims; else they are ruled,
(1 - w) F(u) + w R(u) with M_ww = 0 and M_uw <= |R' - F'|, and the same bound, taken of vectors, says
how many rows they need.

Source: D. Filip, R. Magedson, R. Markot, Surface algorithms using bounds on derivatives, CAGD 3 (1986),
theorem 1.
"""

from dataclasses import dataclass

import numpy as np

from thbcad.certified import Orders, cell_bounds
from thbcad.checks import Floats, Integers, read_only, require_number, require_type
from thbcad.lens.lens import Lens
from thbcad.lens.rims import SIDES, placed_surfaces, rim_indices
from thbcad.lens.soundness import require_sound
from thbcad.sags import gap_graph
from thbcad.splines import BSplineSurface
from thbcad.values import Value

MOST_TRIANGLES = 20_000_000
LEAST_CHORD = 1e-8  # mm
ALLOWANCE = 1e-10  # mm; what conics as splines (1e-11 mm) and the rounding of vertices within 10 m add
FRONT = 0
REAR = 1
EDGES = (2, 3, 4, 5)  # in the order of SIDES
LENS_FACES = ("front", "rear", *(side.name for side in SIDES))


@dataclass(frozen=True, eq=False)
class Tessellation(Value):
    """A closed mesh; seen from outside, the vertices of every triangle run counter-clockwise.

    vertices : (n, 3) float, mm
    triangles : (t, 3) int, vertex numbers; the front comes first, then the rear, then the edges
    faces : (t,) int, the face of each triangle: 0 front, 1 rear, 2 to 5 the edges in the order of SIDES; of
        other bodies as in `names`
    chord : float, mm, bound of the distance of any point of the mesh from its face; on front and rear also of
        the error in z
    names : of the faces
    """

    vertices: Floats
    triangles: Integers
    faces: Integers
    chord: float
    names: tuple[str, ...] = LENS_FACES

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", read_only(self.vertices))
        for name in ("triangles", "faces"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.int64))


def tessellated(lens: Lens, chord: float, single: bool = False) -> Tessellation:
    """Return a mesh of a rectangular lens whose chord error is at most `chord`, mm; `thbcad.body_mesh` also
    meshes others.

    single : round the vertices to float32; the chord error includes what that adds.

    Raises ValueError : as `require_sound`; a lens with an outline; a chord below 1e-8 mm, or too small for
        float32; more than 20 million triangles; vertices that float32 does not tell apart.
    """
    require_type("lens", lens, Lens)
    require_number("chord", chord, least=LEAST_CHORD, finite=True)
    surfaces = placed_surfaces(require_sound(lens))
    if not lens.rear.outline.is_rectangle:
        raise ValueError(
            f"tessellated meshes rectangular lenses, got one of {lens.rear.outline.text()}; use body_mesh"
        )
    gap = gap_graph(*lens.graphs(), lens.thickness)
    added = ALLOWANCE + (_rounding(surfaces) if single else 0.0)
    if added > chord / 2:
        raise ValueError(
            f"chord must be at least {2 * added:.2g} mm, as rounding moves vertices by {added:.2g} mm, got "
            f"{chord:g}"
        )
    bends = np.maximum(*(_bounds(_heights(s), ((2, 0), (1, 1), (0, 2)), gap) for s in surfaces))
    u, v, bound = _positions(bends, gap, chord - added)
    rows, edge_bound = _rows(lens, gap, bends, (u, v), chord - added)
    count = 4 * (len(u) - 1) * (len(v) - 1) + 4 * rows * (len(u) + len(v) - 2)
    if count > MOST_TRIANGLES:
        raise ValueError(
            f"a chord error of {chord:g} mm needs {count:,} triangles, more than {MOST_TRIANGLES:,}; allow "
            "a greater one"
        )
    triangles, strips = closed_triangles(len(u) - 1, len(v) - 1, rows)
    vertices = told_apart(_vertices([s.grid(u, v) for s in surfaces], rows), triangles, single)
    faces = np.where(strips < EDGES[0], strips, EDGES[0] + (strips - EDGES[0]) % len(EDGES))
    return Tessellation(vertices, triangles, faces, max(bound, edge_bound) + added)


def _heights(surface: BSplineSurface) -> BSplineSurface:
    return BSplineSurface(surface.kv_u, surface.kv_v, surface.coefficients[..., 2])


def _bounds(graph: BSplineSurface, derivatives: tuple[Orders, ...], mesh: BSplineSurface) -> Floats:
    """Return bounds of |derivatives| of a scalar graph on the cells of a mesh that holds its knots, (d, cells
    u, cells v)."""
    bounds = cell_bounds(graph, derivatives)
    i, j = (
        np.searchsorted(kv.breaks, fine.breaks[:-1], "right") - 1
        for kv, fine in ((graph.kv_u, mesh.kv_u), (graph.kv_v, mesh.kv_v))
    )
    return bounds[:, i[:, None], j[None, :]]


def _rounding(surfaces: tuple[BSplineSurface, BSplineSurface]) -> float:
    """Return by how much float32 vertices move a point from its face, in z on front and rear: half a unit d
    of x, y and z each."""
    size = max(float(np.abs(s.coefficients).max()) for s in surfaces)
    factors = [3**0.5]
    for s in surfaces:
        slopes = _bounds(_heights(s), ((1, 0), (0, 1)), s).max(axis=(1, 2))
        (x0, y0), (x1, y1) = s.coefficients[0, 0, :2], s.coefficients[-1, -1, :2]
        scale = (s.kv_u.stop - s.kv_u.start) / (x1 - x0), (s.kv_v.stop - s.kv_v.start) / (y1 - y0)
        factors.append(1 + float(slopes @ scale))
    return max(factors) * float(np.spacing(np.float32(size))) / 2


def _positions(bends: Floats, mesh: BSplineSurface, chord: float) -> tuple[Floats, Floats, float]:
    """Return parameters u and v of the grid lines, and the bound that the cells then keep.

    As 2 h k M_uv <= (h^2 + k^2) M_uv, h^2 (M_uu + M_uv) <= 4 chord and k^2 (M_vv + M_uv) <= 4 chord are
    enough.
    """
    uu, uv, vv = bends
    needs = (uu + uv).max(axis=1), (vv + uv).max(axis=0)
    lines = []
    steps = []
    for kv, need in zip((mesh.kv_u, mesh.kv_v), needs):
        width = np.diff(kv.breaks)
        parts = np.ceil(np.clip(width * np.sqrt(need / (4 * chord)), 1, MOST_TRIANGLES))
        if parts.sum() > MOST_TRIANGLES:
            raise ValueError(
                f"a chord error of {chord:g} mm needs more than {MOST_TRIANGLES:,} triangles; allow a "
                "greater one"
            )
        lines.append(subdivided(kv.breaks, parts.astype(np.int64)))
        steps.append(width / parts)
    h, k = steps[0][:, None], steps[1][None, :]
    return lines[0], lines[1], float((h * h * uu + 2 * h * k * uv + k * k * vv).max()) / 8


def subdivided(breaks: Floats, parts: Integers) -> Floats:
    """Return the breaks and between them those that cut every interval into a number of equal parts.

    breaks : (n + 1,) float, increasing.  parts : (n,) int
    """
    fraction = (np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)) / np.repeat(parts, parts)
    inner = np.repeat(breaks[:-1], parts) + np.repeat(np.diff(breaks), parts) * fraction
    return np.append(inner, breaks[-1])


def _rows(
    lens: Lens, gap: BSplineSurface, bends: Floats, lines: tuple[Floats, Floats], chord: float
) -> tuple[int, float]:
    """Return how many rows of triangles the ruled edges need, and the bound that they then keep.

    `_positions` leaves h^2 M_uu / 8 <= chord / 2; rows of height 1 / n add h |R' - F'| / (4 n).
    """
    sides = []
    for axis, (kv, line) in enumerate(zip((gap.kv_u, gap.kv_v), lines)):
        ratio = [f / r for f, r in zip(lens.front.half_width, lens.rear.half_width)]
        if ratio[1 - axis] == 1:
            continue  # these two edges are plane
        steps = np.diff(line)
        cell = np.searchsorted(kv.breaks, line[:-1], "right") - 1
        twist = np.hypot(1 - ratio[axis], _bounds(gap, (((1, 0), (0, 1))[axis],), gap)[0])
        for rim in (0, -1):
            bend, turn = (np.moveaxis(field, axis, 0)[cell, rim] for field in (bends[2 * axis], twist))
            sides.append((steps**2 * bend / 8, steps * turn / 4))
    rows = max((int(np.ceil(min(turn.max() / (chord / 2), MOST_TRIANGLES))) for _, turn in sides), default=1)
    rows = max(rows, 1)
    return rows, max((float((bend + turn / rows).max()) for bend, turn in sides), default=0.0)


def _vertices(grids: list[Floats], rows: int) -> Floats:
    """Return the vertices of front, rear and the rows between their rims, front first, (n, 3)."""
    ring = rim_indices(*grids[0].shape[:2])
    front, rear = (g.reshape(-1, 3) for g in grids)
    fraction = (np.arange(1, rows) / rows)[:, None, None]
    between = (1 - fraction) * front[ring] + fraction * rear[ring]
    return np.concatenate([front, rear, between.reshape(-1, 3)])


def told_apart(vertices: Floats, triangles: Integers, single: bool) -> Floats:
    """Return vertices, rounded to float32 where they shall be `single`; raise ValueError where two corners of
    a triangle are one point then."""
    if single:
        vertices = vertices.astype(np.float32).astype(np.float64)
    if any((vertices[triangles[:, k]] == vertices[triangles[:, k - 1]]).all(axis=1).any() for k in range(3)):
        raise ValueError(
            "two vertices of the mesh lie closer than float32 tells apart; allow a greater chord error or "
            "use float64"
        )
    return vertices


def closed_triangles(nu: int, nv: int, rows: int) -> tuple[Integers, Integers]:
    """Return the vertex numbers of all triangles, (t, 3), and the strip of each, (t,).

    The vertices are a front and a rear grid of (nu + 1) x (nv + 1) points, then rings between their rims, as
    of `walled_triangles`.  Strips are 0 front, 1 rear, and 2 + 4 k + s on the side s of the k-th row.
    """
    count = (nu + 1) * (nv + 1)
    grid = np.arange(count).reshape(nu + 1, nv + 1)
    plan = _halves(grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:])
    triangles = walled_triangles(plan, rim_indices(nu + 1, nv + 1), count, rows)
    side = np.repeat(np.arange(4), [2 * nu, 2 * nv, 2 * nu, 2 * nv])
    side = (EDGES[0] + 4 * np.arange(rows)[:, None] + side).ravel()
    return triangles, np.concatenate([np.repeat([FRONT, REAR], len(plan)), side])


def walled_triangles(plan: Integers, ring: Integers, count: int, rows: int) -> Integers:
    """Return the vertex numbers of the triangles of a front and a rear over one plan, and of rows of walls
    between them, two by two along the ring, (t, 3).

    plan : (t, 3), counter-clockwise as seen from +z.  ring : (n,), its rim in that sense.  The vertices are
    `count` points of the front, those of the rear, then rows - 1 rings between them, front first.
    """
    between = 2 * count + np.arange((rows - 1) * len(ring)).reshape(rows - 1, len(ring))
    levels = np.concatenate([ring[None], between, count + ring[None]])
    following = np.roll(levels, -1, axis=1)
    walls = _halves(levels[:-1], following[:-1], following[1:], levels[1:])
    return np.concatenate([plan[:, ::-1], count + plan, walls])


def _halves(a: Integers, b: Integers, c: Integers, d: Integers) -> Integers:
    """Return the triangles a b c and a c d of the quadrangles a b c d, alternating, (2 n, 3)."""
    return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
