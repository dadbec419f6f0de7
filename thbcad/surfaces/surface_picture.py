"""A THB surface as a map of its values with the mesh on it."""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import Bools, Floats
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
    return card("THBSurface", svg(picture, *size), rows)


def value_map(
    surface: Surface, size: tuple[float, float], inside: Callable[[Floats, Floats], Bools] | None = None
) -> tuple[str, Floats, int]:
    """Return (SVG elements, the values on them (columns, rows), levels of the mesh on them).

    Of vectors the last component is shown; u runs to the right and v upwards.

    size : width and height in pixels
    inside : function of positions (x, y) from -1 to 1 that returns which count; the values are then those
        inside, (n,), and have all the colours
    """
    part = (np.arange(PIXELS) + 0.5) / PIXELS
    u, v = (kv.start + (kv.stop - kv.start) * part for kv in (surface.space.kv_u, surface.space.kv_v))
    values = surface.grid(u, v)
    if values.ndim == 3:
        values = values[..., -1]
    shown = values if inside is None else values[inside(2 * part[:, None] - 1, 2 * part - 1)]
    lines, drawn = mesh_lines(surface.space, *size)
    return map_element(np.clip(values, shown.min(), shown.max()), *size) + lines, shown, drawn
