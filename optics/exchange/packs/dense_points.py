"""Points of front and rear with normals, so dense that interpolation keeps a proven error, and read back."""

from __future__ import annotations

import io
from collections.abc import Mapping

import numpy as np

from optics.base.runtime import Check
from thbcad.checks import Floats
from thbcad.io import points_text
from thbcad.lens import ALLOWANCE, DenseGrid, FreeformSurface, Lens, dense_grid

LINEAR, CUBIC = 1e-3, 1e-6  # mm
POINTS = 1e-10  # mm
NORMALS = 1e-9  # of a conic as a spline within 1e-11 mm


def dense_points(lens: Lens) -> tuple[dict[str, bytes], list[Check], dict[str, DenseGrid]]:
    """Return the files of front and rear, what the bounds and the files read back say, and the grids.

    Raises ValueError : more than 10 million points.
    """
    files, checks, grids = {}, [], {}
    faces = (("front", lens.front, 0.0), ("rear", lens.rear, lens.thickness))
    for (word, surface, vertex), graph in zip(faces, lens.own_graphs()):
        grid = dense_grid(graph, LINEAR - ALLOWANCE, CUBIC - ALLOWANCE)
        text = points_text(graph, vertex, word == "rear", grid.x, grid.y)
        files[f"points_{word}.xyz"], grids[word] = text, grid
        checks += [
            Check(f"{word} points, linear between them, bound", grid.linear + ALLOWANCE, LINEAR, "mm"),
            Check(f"{word} points, cubic between them, bound", grid.cubic + ALLOWANCE, CUBIC, "mm"),
            *_read_back(word, surface, vertex, text, grid),
        ]
    return files, checks, grids


def _read_back(
    word: str, surface: FreeformSurface, vertex: float, text: bytes, grid: DenseGrid
) -> list[Check]:
    """Return the Checks of a file against the surface: at its points, and in the middles of its cells."""
    x, y, z, *normal = np.loadtxt(io.BytesIO(text)).T.reshape(6, len(grid.x), len(grid.y))
    slopes = [-n / normal[2] for n in normal[:2]]
    off = [surface.grid(x[:, 0], y[0], (1, 0)), surface.grid(x[:, 0], y[0], (0, 1))]
    mid_x, mid_y = ((a[1:] + a[:-1]) / 2 for a in (x[:, 0], y[0]))
    between, by = surface.grid(mid_x, mid_y) + vertex, "XYZ read back by numpy"
    errors: Mapping[str, tuple[Floats, float]] = {
        "points": (z - vertex - surface.grid(x[:, 0], y[0]), POINTS),
        "slopes of the normals": (np.subtract(slopes, off), NORMALS),
        "bilinear in the middles": (_linear(_linear(z, 0), 1) - between, LINEAR),
        "Coons patches in the middles": (middles(x, y, z, *slopes) - between, CUBIC),
    }
    return [
        Check(f"{word} {what}, {by}", float(np.abs(error).max()), limit, "mm" if limit != NORMALS else "")
        for what, (error, limit) in errors.items()
    ]


def middles(x: Floats, y: Floats, z: Floats, zx: Floats, zy: Floats) -> Floats:
    """Return the heights of Coons patches in the middles of cells, from a grid of heights and slopes.

    All are (nx, ny).  The sides are cubics: (z0 + z1) / 2 + h (z0' - z1') / 8.
    """
    along_x = _linear(z, 0) - np.diff(x, axis=0)[:, :1] * np.diff(zx, axis=0) / 8
    along_y = _linear(z, 1) - np.diff(y, axis=1)[:1] * np.diff(zy, axis=1) / 8
    return _linear(along_x, 1) + _linear(along_y, 0) - _linear(_linear(z, 0), 1)


def _linear(values: Floats, axis: int) -> Floats:
    """Return the means of neighbours along an axis."""
    first, last = (np.delete(values, end, axis) for end in (-1, 0))
    return (first + last) / 2
