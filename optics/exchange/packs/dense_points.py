"""Points of front and rear with normals, so dense that interpolation keeps a proven error, and read back."""

import io

import numpy as np

from optics.base.runtime import Check
from thbcad.io import points_text
from thbcad.lens import ALLOWANCE, DenseGrid, Lens, dense_grid

LINEAR, CUBIC = 1e-3, 1e-6  # mm
POINTS, SLOPES = 1e-10, 1e-9  # mm, and of slopes: conics are splines within 1e-11 mm


def dense_points(lens: Lens) -> tuple[dict[str, bytes], list[Check], dict[str, DenseGrid]]:
    """Return the files of front and rear, what the bounds and the files read back say, and the grids."""
    files, checks, grids = {}, [], {}
    faces = (("front", lens.front, 0.0), ("rear", lens.rear, lens.thickness))
    for (word, surface, vertex), graph in zip(faces, lens.own_graphs()):
        grid = dense_grid(graph, LINEAR - ALLOWANCE, CUBIC - ALLOWANCE)
        text = points_text(graph, vertex, word == "rear", grid.x, grid.y)
        files[f"points_{word}.xyz"], grids[word] = text, grid
        x, y, z, *normal = np.loadtxt(io.BytesIO(text)).T.reshape(6, len(grid.x), len(grid.y))
        off = z - vertex - surface.grid(x[:, 0], y[0])
        turned = (n / normal[2] + surface.grid(grid.x, grid.y, o) for n, o in zip(normal, ((1, 0), (0, 1))))
        by = "XYZ read back by numpy"
        checks += [
            Check(f"{word} points, {by}", float(np.abs(off).max()), POINTS, "mm"),
            Check(f"{word} slopes, {by}", max(float(np.abs(t).max()) for t in turned), SLOPES, ""),
            Check(f"{word} points, linear between them, bound", grid.linear + ALLOWANCE, LINEAR, "mm"),
            Check(f"{word} points, cubic between them, bound", grid.cubic + ALLOWANCE, CUBIC, "mm"),
        ]
    return files, checks, grids
