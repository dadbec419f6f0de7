"""Light that a file describes, and the rays of a ray file.

Rays are ordered along Morton's curve through position and direction.  Neighbours in this order are alike, so
that every k-th ray, or a ray from every equal part of the flux, is a stratified sample of all of them.

Source: G. M. Morton, A computer oriented geodetic data base, IBM, 1966.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import acos, degrees

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import UserError, speaking_of
from optics.scene.ray_files import RaySet, read_rays
from optics.scene.sources.light_source import ALL, AXIS, Counts, Ends, Fresh, LightSource, Pair, drawn_shift
from optics.scene.sources.plain_sources import PointSource
from optics.scene.sources.rays import Rays
from thbcad.certified import DIRECTIONS, Stack
from thbcad.checks import Floats
from thbcad.poses import Pose

WITHIN = 0.99  # of the forward flux: the cone of the point that stands for the light
LEAST_RAYS = 8  # of a file
BITS = 15  # of each of four coordinates, in an integer of 64
NEAREST, FAR_AWAY, LEAST_ANGLE = 1e-3, 1e6, 0.01  # mm, mm, degrees: limits of that point


@dataclass(frozen=True, eq=False, kw_only=True)
class FileSource(LightSource):
    """Light that a file describes: some of its rays are all that is known.

    file : its path; it is read when it is first needed, and once.  shift : of its origin in x and y, mm.
    tilt, turn : degrees, see `pose`; one of them is zero.
    """

    file: str
    shift: tuple[float, float]
    tilt: tuple[float, float, float]
    turn: tuple[float, float, float]
    by_rays = True
    symmetric = False

    @property
    def middle(self) -> tuple[float, float, float]:
        return *self.shift, -self.distance

    @property
    def pose(self) -> Pose:
        """From the frame of the file's light to the scene's.

        X, Y and Z turn about one axis each, right-handed.  By `tilt`, about own axes, it is X Y Z; by `turn`,
        about axes that stay, Z Y X.
        """
        from scipy.spatial.transform import Rotation

        if not any(self.turn):
            return Pose.tilted(self.middle, self.tilt)
        return Pose(Rotation.from_euler("xyz", self.turn, degrees=True).as_matrix(), np.array(self.middle))

    @property
    def cone(self) -> float:
        return self.without_extent().half_angle

    @abstractmethod
    def sample(self) -> Rays:
        """Return rays that stand for all of the light: those of a ray file."""

    def starts(self) -> Floats:
        return self.sample().origin

    def envelope(self) -> tuple[Stack, float]:
        rays = self.sample()
        forward = (rays.direction[2] > 0) & (rays.flux > 0)
        if not forward.any():
            return Stack(np.array([-self.distance]), np.zeros((1, len(DIRECTIONS)))), 0.0
        points = rays.origin[:, forward]
        steepest = float(np.degrees(np.arccos(np.clip(rays.direction[2, forward].min(), 0.0, 1.0))))
        supports = np.array([(d @ points[:2]).max() for d in DIRECTIONS])
        return Stack(np.array([points[2].min(), points[2].max()]), np.array([supports, supports])), steepest

    def without_extent(self) -> PointSource:
        """Return a point on the axis from which light comes about as from the file's.

        Its z is the flux-weighted least-squares meeting point of the rays with the axis.  The point lights
        the cone that WITHIN of the forward flux fills, with the intensity of a Lambertian area.
        """
        rays = self.sample()
        forward = rays.direction[2] > 0
        direction, flux = rays.direction[:, forward], rays.flux[forward]
        origin, slope = rays.origin[:, forward], direction[:2] / direction[2]
        steep = float((flux * (slope**2).sum(axis=0)).sum())
        offset = origin[:2] - origin[2] * slope
        z = -float((flux * (offset * slope).sum(axis=0)).sum()) / steep if steep else -FAR_AWAY
        order = np.argsort(direction[2])[::-1]
        within = np.searchsorted(np.cumsum(flux[order]), WITHIN * flux.sum())
        cosine = direction[2][order][min(within, len(order) - 1)]
        return PointSource(
            flux=self.flux,
            distance=float(np.clip(-z, NEAREST, FAR_AWAY)),
            half_angle=float(np.clip(degrees(acos(min(cosine, 1.0))), LEAST_ANGLE, 90.0)),
            exponent=1.0,
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class RayFileSource(FileSource):
    """The rays of a file.

    unit : of the flux, "W" or "lm", by which a file's rays count that has both.
    """

    unit: str = "W"

    @cached_property
    def placed(self) -> Rays:
        """All rays of the file in the scene.

        Raises UserError : see `read_rays`.
        """
        with speaking_of("source.file"):
            rays = read_rays(self.file)
        return placed_rays(rays, self.pose, self.flux, self.unit)

    @property
    def most_rays(self) -> float:
        return len(self.placed.flux)

    def sample(self) -> Rays:
        return self.placed

    def starts(self) -> Floats:
        if (count := len(self.placed.flux)) < LEAST_RAYS:
            raise UserError(
                f"source.file holds {count} rays, and {LEAST_RAYS} parts of them tell how uncertain the "
                "light is; give a file of more"
            )
        return super().starts()

    def parts(
        self, counts: Counts, fresh: Fresh = None, most: int = ALL, aperture: Ends = None, centre: Pair = AXIS
    ) -> Iterator[Rays]:
        chosen = self.placed.thinned(counts[0] * counts[1], 0.5 + drawn_shift(fresh)[0])
        yield from chosen.slices(most)

    def replicates(
        self, number: int, counts: Counts, fresh: np.random.Generator, most: int
    ) -> Iterator[Iterator[Rays]]:
        offset = float(fresh.uniform())
        for hand in self.placed.dealt(number):
            yield hand.thinned(counts[0] * counts[1], offset).slices(most)


def placed_rays(rays: RaySet, pose: Pose, flux: float, unit: str = "W") -> Rays:
    """Return rays in the scene, in Morton's order.

    pose : of the file's frame.  flux : of all rays.  unit : of it, "W" or "lm".
    """
    direction = pose.directions(rays.direction.T.astype(np.float64))
    direction /= np.linalg.norm(direction, axis=0)
    origin = pose.points(rays.position.T.astype(np.float64))
    order = np.argsort(_morton([*origin[:2], *direction[:2]]), kind="stable")
    return Rays(origin[:, order], direction[:, order], (flux * rays.shares(unit))[order])


def _morton(rows: list[Floats]) -> NDArray[np.uint64]:
    """Return the numbers of points along Morton's curve, (n,): the bits of their coordinates in turn."""
    code = np.zeros(len(rows[0]), np.uint64)
    for k, row in enumerate(rows):
        span = float(np.ptp(row)) or 1.0
        whole = np.minimum((row - row.min()) / span * (1 << BITS), (1 << BITS) - 1).astype(np.uint64)
        for bit in range(BITS):
            code |= ((whole >> np.uint64(bit)) & np.uint64(1)) << np.uint64(len(rows) * bit + k)
    return code
