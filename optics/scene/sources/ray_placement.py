"""Rays of a file in the scene: turned, moved, and in an order in which every k-th ray stands for all.

Rays are ordered along Morton's curve through position and direction.  Neighbours in this order are alike, so
that every k-th ray, or a ray from every equal part of the flux, is a stratified sample of all of them.

Source: G. M. Morton, A computer oriented geodetic data base, IBM, 1966.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from optics.scene.ray_files import RaySet
from optics.scene.sources.rays import Rays
from thbcad.checks import Floats
from thbcad.poses import Pose

BITS = 15  # of each of four coordinates, in an integer of 64


def placed_rays(rays: RaySet, pose: Pose, flux: float) -> Rays:
    """Return rays in the scene, in Morton's order.

    pose : of the file's frame.  flux : W, of all rays.
    """
    direction = pose.directions(rays.direction.T.astype(np.float64))
    direction /= np.linalg.norm(direction, axis=0)
    origin = pose.points(rays.position.T.astype(np.float64))
    each = rays.flux.astype(np.float64)
    order = np.argsort(_morton([*origin[:2], *direction[:2]]), kind="stable")
    return Rays(origin[:, order], direction[:, order], (each * (flux / each.sum()))[order])


def _morton(rows: list[Floats]) -> NDArray[np.uint64]:
    """Return the numbers of points along Morton's curve, (n,): the bits of their coordinates in turn."""
    code = np.zeros(len(rows[0]), np.uint64)
    for k, row in enumerate(rows):
        span = float(np.ptp(row)) or 1.0
        whole = np.minimum((row - row.min()) / span * (1 << BITS), (1 << BITS) - 1).astype(np.uint64)
        for bit in range(BITS):
            code |= ((whole >> np.uint64(bit)) & np.uint64(1)) << np.uint64(len(rows) * bit + k)
    return code
