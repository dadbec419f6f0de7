"""The rear of a STEP file, as OCCT evaluates it, beside the exact spline surface of the design."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from optics.exchange.verification import StepFile, optical_faces
from thbcad.cad.exchange import face_nodes
from thbcad.lens import Lens

SAMPLES = 101  # in each direction


def rear_deviation(path: Path, lens: Lens) -> float:
    """Return the greatest |z_file - z(x, y)| in mm at points of the rear of a STEP file, in a grid.

    Raises OSError : the file cannot be read.
    Raises ValueError : it holds no lens, or its rear is no spline.
    """
    file = StepFile(path)
    _, number = optical_faces(file.text)
    spline = file.text.faces[number].surface
    if spline is None:
        raise ValueError(f"the rear in {path} is no spline")
    u, v = (np.linspace(kv.start, kv.stop, SAMPLES) for kv in (spline.kv_u, spline.kv_v))
    x, y, z = np.moveaxis(face_nodes(file.solid.shape, number, u, v).points, -1, 0)
    _, (_, rear, vertex) = lens.faces
    hx, hy = rear.half_width
    exact = vertex + rear(np.clip(x, -hx, hx), np.clip(y, -hy, hy))  # x and y may be rounded beyond the rim
    return float(np.abs(z - exact).max())
