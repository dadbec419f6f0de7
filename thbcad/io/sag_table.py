"""Tables of a surface on a grid: sags with derivatives for Zemax OpticStudio, points with normals for diamond
turning.

Source: Zemax OpticStudio user guide, Grid Sag surface, importing grid data.
"""

import io

import numpy as np

from thbcad.checks import Floats, require_integer, require_type
from thbcad.lens import FreeformSurface
from thbcad.splines import BSplineSurface

LEAST_POINTS = 5  # what OpticStudio wants per direction
MOST_POINTS = 10_000_000
MILLIMETRES = 0  # OpticStudio's unit flag
ORDERS = ((0, 0), (1, 0), (0, 1), (1, 1))


def table_size(surface: FreeformSurface) -> tuple[int, int]:
    """Return the points in x and y whose distance is at most the least knot span of the surface, both rims
    included.

    Where all spans are multiples of the least one, bicubic interpolation of the table gives a cubic surface
    back.

    Raises ValueError : more than 10 million points.
    """
    require_type("surface", surface, FreeformSurface)
    graph = surface.graph()
    spans = [(kv.stop - kv.start) / np.diff(kv.breaks).min() for kv in (graph.kv_u, graph.kv_v)]
    nx, ny = (max(int(np.ceil(min(s, MOST_POINTS) * (1 - 1e-9))) + 1, LEAST_POINTS) for s in spans)
    if nx * ny > MOST_POINTS:
        raise ValueError(
            f"a table at the least knot span needs {nx:,} x {ny:,} points, more than {MOST_POINTS:,}"
        )
    return nx, ny


def sag_text(surface: FreeformSurface, size: tuple[int, int]) -> bytes:
    """Return a grid sag file (.DAT) over the whole rectangle, from the vertex of the surface, mm.

    The first line is nx ny dx dy unit xdec ydec; then follow nx ny lines z dz/dx dz/dy d2z/dxdy nodata
    from the corner at -x and +y, along x first and then down in y.  All reals have 17 digits.

    size : (nx, ny), at least 5 each.

    Raises ValueError : fewer points.
    """
    x, y = _lines(surface, size)
    columns = [surface.grid(x, y[::-1], order).T.ravel() for order in ORDERS]
    steps = [2 * h / (n - 1) for h, n in zip(surface.half_width, size)]
    text = io.BytesIO()
    text.write("{} {} {:.17g} {:.17g} {} 0 0\n".format(*size, *steps, MILLIMETRES).encode())
    np.savetxt(text, np.column_stack(columns), "%.17g %.17g %.17g %.17g 0")
    return text.getvalue()


def cloud_text(surface: FreeformSurface, vertex: float, upwards: bool, size: tuple[int, int]) -> bytes:
    """Return lines x y z nx ny nz, mm: points on a grid over the whole rectangle and unit normals, 17 digits.

    vertex : z of the surface's vertex in the lens frame, mm.  upwards : the normal points to +z, else to -z.
    size : (nx, ny), at least 5 each.

    Raises ValueError : fewer points.
    """
    return points_text(surface, vertex, upwards, *_lines(surface, size))


def points_text(
    graph: FreeformSurface | BSplineSurface, vertex: float, upwards: bool, x: Floats, y: Floats
) -> bytes:
    """Return the same on the grid of the lines x and y, mm.  graph : z(x, y) above z = vertex."""
    z, zx, zy = (graph.grid(x, y, order).ravel() for order in ORDERS[:3])
    normals = np.column_stack([-zx, -zy, np.ones_like(z)]) * (1 if upwards else -1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    positions = [a.ravel() for a in np.meshgrid(x, y, indexing="ij")]
    text = io.BytesIO()
    np.savetxt(text, np.column_stack([*positions, vertex + z, normals]), "%.17g")
    return text.getvalue()


def _lines(surface: FreeformSurface, size: tuple[int, int]) -> tuple[Floats, Floats]:
    """Return x and y of the grid."""
    for name, n in zip(("nx", "ny"), size):
        require_integer(name, n, LEAST_POINTS)
    x, y = (np.linspace(-h, h, n) for h, n in zip(surface.half_width, size))
    return x, y
