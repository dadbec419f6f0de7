"""The last step of a ray to the target, for the tracers of a file: it shares no code with what designs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from optics.receivers import Receiver

    Rows = NDArray[np.float64]


def last_step(points: Rows, directions: Rows, target: Receiver) -> tuple[Rows, NDArray[np.bool_]]:
    """Return where rays land, (n, 2), mm or degrees, and whether they come from before the target, (n,).

    points, directions : (n, 3), in the frame of the lens.
    """
    own, along = (points - target.pose.shift) @ target.pose.rotation, directions @ target.pose.rotation
    meets = along[:, 2] > 0
    across = along[:, :2] / np.where(meets, along[:, 2], 1.0)[:, None]
    if target.far_field:
        return np.degrees(np.arctan(across)), meets
    return own[:, :2] - own[:, 2:] * across, meets
