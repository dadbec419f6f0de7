"""How far the patches in a STEP file lie from the surfaces of a lens, by the text of the file."""

from pathlib import Path

import numpy as np

from thbcad.checks import Floats
from thbcad.io.brep_records import MILLIMETRE
from thbcad.io.step_brep import parse_brep
from thbcad.lens import Lens
from thbcad.sags import lobatto_nodes
from thbcad.splines import BSplineSurface

UNCOVERED = 1e-9  # of the area of a surface


def patched_deviation(path: str | Path, lens: Lens) -> float:
    """Return the greatest distance in z between front and rear of a STEP file and those of the lens, mm.

    Every spline face of degree 2 or more in both directions is compared with the nearer surface, in every
    knot span at the extrema of the Chebyshev polynomial of its degree.  The text is read without OCCT.

    Raises OSError : the file cannot be read.
    Raises ValueError : not a STEP file with one solid in mm, or its faces do not cover front and rear.
    """
    solid = parse_brep(path)
    if solid.unit != MILLIMETRE:
        raise ValueError(f"{path} must be in {MILLIMETRE}, got {solid.unit}")
    splines = [face.surface for face in solid.faces if isinstance(face.surface, BSplineSurface)]
    points: tuple[list[Floats], ...] = ([], [])
    for spline in splines:
        if min(spline.kv_u.degree, spline.kv_v.degree) > 1:
            u, v = (lobatto_nodes(kv.breaks, kv.degree) for kv in (spline.kv_u, spline.kv_v))
            net = spline.grid(u, v)
            points[_nearer(lens, net[len(net) // 2, net.shape[1] // 2])].append(net)
    greatest = 0.0
    for name, surface, vertex, nets in zip(
        ("front", "rear"), (lens.front, lens.rear), (0.0, lens.thickness), points
    ):
        covered = sum(float(np.prod(net[-1, -1, :2] - net[0, 0, :2])) for net in nets) / (
            4 * np.prod(surface.half_width)
        )
        if abs(covered - 1) > UNCOVERED:
            raise ValueError(f"the faces of {path} must cover the {name} once, got {covered:.9g} of its area")
        x, y, z = np.concatenate([net.reshape(-1, 3) for net in nets]).T
        greatest = max(greatest, float(abs(vertex + surface(x, y) - z).max()))
    return greatest


def _nearer(lens: Lens, point: Floats) -> int:
    """Return 0 where a point, (3,), is nearer to the front in z, 1 where it is nearer to the rear."""
    distances = [
        abs(vertex + surface(*point[:2]) - point[2])
        if (abs(point[:2]) <= surface.half_width).all()
        else np.inf
        for surface, vertex in ((lens.front, 0.0), (lens.rear, lens.thickness))
    ]
    return int(np.argmin(distances))
