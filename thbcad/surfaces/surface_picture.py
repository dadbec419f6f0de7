"""A THB surface as a map of its values with the mesh on it."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import Floats
from thbcad.hierarchy import THBSpace, mesh_lines, space_rows
from thbcad.pictures import card, frame_size, interval_text, map_element, svg

PIXELS = 112  # of the map, in u and in v: as a PNG at most 12.7 kB, and 16.9 kB of text


class Surface(Protocol):
    """What is shown of a THB surface."""

    @property
    def space(self) -> THBSpace: ...
    @property
    def coefficients(self) -> Floats: ...
    def grid(self, u: ArrayLike, v: ArrayLike) -> Floats: ...


def surface_card(surface: Surface) -> str:
    """Return a map of the values beside the numbers of a surface, as HTML of at most 40 kB."""
    size = frame_size(*(kv.stop - kv.start for kv in (surface.space.kv_u, surface.space.kv_v)))
    picture, values, drawn = value_map(surface, size)
    rows = [*space_rows(surface.space, drawn), ("values", interval_text(values.min(), values.max()))]
    if surface.coefficients.ndim == 2:
        rows.insert(0, ("components", f"{surface.coefficients.shape[1]}, the last of them shown"))
    return card("THBSurface", picture, rows)


def value_map(surface: Surface, size: tuple[float, float]) -> tuple[str, Floats, int]:
    """Return (SVG, the values on it (columns, rows), levels of the mesh on it).

    Of vectors the last component is shown; u runs to the right and v upwards.

    size : width and height in pixels.
    """
    part = (np.arange(PIXELS) + 0.5) / PIXELS
    u, v = (kv.start + (kv.stop - kv.start) * part for kv in (surface.space.kv_u, surface.space.kv_v))
    values = surface.grid(u, v)
    if values.ndim == 3:
        values = values[..., -1]
    lines, drawn = mesh_lines(surface.space, *size)
    return svg(map_element(values, *size) + lines, *size), values, drawn
