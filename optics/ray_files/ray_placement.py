"""Rays of a file in the scene: turned, moved, and fewer of them where that does.

Rays are ordered along Morton's curve through position and direction.  Neighbours in this order are alike, so
that every k-th ray, or a ray from every equal part of the flux, is a stratified sample of all of them.

Source: G. M. Morton, A computer oriented geodetic data base, IBM, 1966.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from optics.ray_files.ray_set import RaySet
from thbcad.poses import Pose

Floats = NDArray[np.float64]

BITS = 15  # of each of four coordinates, in an integer of 64


@dataclass(frozen=True, eq=False)
class PlacedRays:
    """Rays in Morton's order.

    origin, direction : (3, n), mm and unit vectors.  flux : (n,), W.
    """

    origin: Floats
    direction: Floats
    flux: Floats

    def thinned(self, count: int, offset: float) -> PlacedRays:
        """Return `count` rays of equal flux, one from each of as many equal parts of the flux.

        Where there are no more they stay as they are.
        offset : of the chosen points in their parts, in [0, 1).
        """
        if count >= len(self.flux):
            return self
        ends = np.cumsum(self.flux)
        at = (np.arange(count) + offset) * (ends[-1] / count)
        chosen = np.minimum(np.searchsorted(ends, at, side="right"), len(ends) - 1)
        each = np.full(count, ends[-1] / count)
        return PlacedRays(self.origin[:, chosen], self.direction[:, chosen], each)

    def dealt(self, hands: int) -> Iterator[PlacedRays]:
        """Yield sets that make up all rays: every `hands`-th ray, with the flux of all."""
        total = self.flux.sum()
        for k in range(hands):
            flux = self.flux[k::hands]
            scaled = flux * (total / flux.sum()) if flux.any() else flux
            yield PlacedRays(self.origin[:, k::hands], self.direction[:, k::hands], scaled)


def placed_rays(rays: RaySet, pose: Pose, flux: float) -> PlacedRays:
    """Return rays in the scene, in Morton's order.

    pose : of the file's frame.  flux : W, of all rays.
    """
    direction = pose.directions(rays.direction.T.astype(np.float64))
    direction /= np.linalg.norm(direction, axis=0)
    origin = pose.points(rays.position.T.astype(np.float64))
    each = rays.flux.astype(np.float64)
    order = np.argsort(_morton([*origin[:2], *direction[:2]]), kind="stable")
    return PlacedRays(origin[:, order], direction[:, order], (each * (flux / each.sum()))[order])


def _morton(rows: list[Floats]) -> NDArray[np.uint64]:
    """Return the numbers of points along Morton's curve, (n,): the bits of their coordinates in turn."""
    code = np.zeros(len(rows[0]), np.uint64)
    for k, row in enumerate(rows):
        span = float(np.ptp(row)) or 1.0
        whole = np.minimum((row - row.min()) / span * (1 << BITS), (1 << BITS) - 1).astype(np.uint64)
        for bit in range(BITS):
            code |= ((whole >> np.uint64(bit)) & np.uint64(1)) << np.uint64(len(rows) * bit + k)
    return code
