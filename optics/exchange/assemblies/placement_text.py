"""The text of a STEP file whose one solid a placement may move."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thbcad.io import Brep, Entity, Value, brep, direction_of, entity_of, having, points_of, read_file

PLACEMENT = "ITEM_DEFINED_TRANSFORMATION"


class PlacedText(NamedTuple):
    """A solid in its own frame, and the motion of that frame: a rotation beside a shift, (3, 4) float."""

    solid: Brep
    motion: NDArray[np.float64]


def placed_text(path: str | Path) -> PlacedText:
    """Read the one solid of a STEP file, and its placement where it has one, from the text.

    Raises
    ------
    OSError : the file cannot be read.
    ValueError : as `parse_brep`, but for one placement.
    """
    header, entities = read_file(path)
    try:
        placements = having(entities, PLACEMENT)
        if len(placements) > 1:
            raise ValueError(f"the file must place its one part once, got {len(placements)} placements")
        rest = {number: entity for number, entity in entities.items() if entity not in placements}
        motion = _motion(entities, placements[0]) if placements else np.eye(4)[:3]
        return PlacedText(brep(rest, header), motion)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _motion(entities: Mapping[int, Entity], placement: Entity) -> NDArray[np.float64]:
    """Return the motion T of a placement from the frame F to the frame G, T = G F^-1."""
    _, _, start, stop = placement.parameters(PLACEMENT, 4)
    frames = [_frame(entities, item, placement) for item in (start, stop)]
    return (frames[1] @ np.linalg.inv(frames[0]))[:3]


def _frame(entities: Mapping[int, Entity], item: Value, user: Entity) -> NDArray[np.float64]:
    """Return an AXIS2_PLACEMENT_3D as a matrix (4, 4)."""
    axes = entity_of(entities, item, user)
    _, point, axis, first = axes.parameters("AXIS2_PLACEMENT_3D", 4)
    z, x = (direction_of(entities, direction, axes) for direction in (axis, first))
    x = x - (x @ z) * z
    x = x / np.linalg.norm(x)
    frame = np.eye(4)
    frame[:3] = np.column_stack([x, np.cross(z, x), z, points_of(entities, [point], axes)[0]])
    return frame
