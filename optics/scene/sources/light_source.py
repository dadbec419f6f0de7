"""What every source of light is asked for, in front of any lens."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf, log2
from typing import ClassVar

import numpy as np

from optics.scene.sources.cells import AXIS, SourceCells
from optics.scene.sources.divergence import PARALLEL, Divergence
from optics.scene.sources.profile import UNIFORM, Profile
from optics.scene.sources.rays import RayGrid, Rays
from thbcad.certified import Stack
from thbcad.checks import Floats
from thbcad.poses import IDENTITY, Pose

Counts = Sequence[int]
Fresh = np.random.Generator | None
Pair = Sequence[float]
Ends = Sequence[float] | None

ALL = 1 << 62  # rays at once


@dataclass(frozen=True, eq=False, kw_only=True)
class LightSource(ABC):
    """A source: its rays, where they start, and what a tracer may leave out.

    Each class says where it differs from light of a known intensity that comes from a place on the axis, so
    that nobody else asks of what kind a source is.

    flux : W.  distance : mm, from the source to the front's vertex at z = 0.
    from_afar : it comes along +z from before all of a lens and its mount, so that it has no place.
    by_rays : rays are what is known of the light, and neither its radiance nor its etendue.
    several : it is more than one source.
    scalable : it is an area that the problem describes, and may be made with another width.
    emitter : points of an area that emit all around, so that smooth windows suit the blurred light best.
    axial : it stays the same where it turns about z, whatever its settings.
    symmetric : it is its own mirror image in x and y, but for the picture of its profile.
    kinked : its cells have kinks on diagonals, and are as many in both directions, an even number.
    spread : how the light of every point of an area spreads around +z.
    """

    flux: float
    distance: float
    from_afar: ClassVar[bool] = False
    by_rays: ClassVar[bool] = False
    several: ClassVar[bool] = False
    scalable: ClassVar[bool] = False
    emitter: ClassVar[bool] = False
    axial: ClassVar[bool] = False
    symmetric: ClassVar[bool] = True
    kinked: ClassVar[bool] = False

    @property
    def each(self) -> tuple[LightSource, ...]:
        """The sources that it consists of."""
        return (self,)

    @property
    def spread(self) -> Divergence:
        return PARALLEL

    @property
    def collimated(self) -> bool:
        """Whether all rays are parallel to z."""
        return self.from_afar and not self.extended

    @property
    def extended(self) -> bool:
        """Whether light comes from every point of an area in many directions, so that cells have no image."""
        return self.by_rays or self.spread.half_angle > 0

    @property
    def beam(self) -> bool:
        """Whether it is one beam, which may be turned."""
        return self.from_afar

    @property
    def diverging(self) -> bool:
        """Whether it is a beam whose points spread their light: cells measure each direction of it."""
        return self.from_afar and self.extended

    @property
    def profile(self) -> Profile:
        """How the light spreads over the source's area.

        Raises UserError : see `read_picture`.
        """
        return UNIFORM

    @property
    def image(self) -> tuple[Profile, tuple[float, float]]:
        """What a pinhole in the lens throws of an extended source: its profile and its proportions."""
        return self.spread.picture, (1.0, 1.0)

    @property
    def etendue(self) -> float:
        """Flux over the radiance on the axis of a source whose points are equally bright, mm^2 sr.

        Of a Lambertian one it is pi A sin^2(half_angle); it is 0 without extent or a known radiance.
        """
        return 0.0

    @property
    def frame(self) -> Pose:
        """From the frame of its area to that of the scene."""
        return IDENTITY

    @property
    def middle(self) -> tuple[float, float, float]:
        """The point in the middle of the source, mm."""
        return 0.0, 0.0, -self.distance

    @property
    def most_rays(self) -> float:
        """How many rays it has, inf where any number can be made."""
        return inf

    @property
    def cone(self) -> float:
        """The half-angle of the cone about the axis into which the source shines, degrees."""
        return self.spread.half_angle

    @property
    def told(self) -> Mapping[str, object]:
        """Changes of the problem, by dotted keys: numbers that it leaves to the source's file."""
        return {}

    @property
    def assumed(self) -> list[str]:
        """Sentences about what is assumed of the light."""
        return []

    @property
    def whole(self) -> LightSource:
        """The source with all of its rays: also those of a beam that pass by the first element."""
        return self

    def starts(self) -> Floats | None:
        """Return points where light starts, of which none may lie in the lens, (3, n) mm.

        None where the source's plane tells.

        Raises UserError : a file that cannot be read, or none of whose light goes forward.
        """
        return None

    @abstractmethod
    def envelope(self) -> tuple[Stack, float]:
        """Return figures that hold the points where light starts, and its greatest angle from z, degrees."""

    def without_extent(self) -> LightSource:
        """Return the source without its spread: of a beam parallel light, of an emitter the point in its
        middle, with its intensity; of a file's light one where its rays are nearest to."""
        return self

    def cells(
        self, counts: Counts, aperture: Ends = None, centre: Pair = AXIS, direction: Floats | None = None
    ) -> SourceCells:
        """Return (nx, ny) cells of a source that is not extended, or of a diverging beam in one direction.

        Where they have kinks there are about as many, see `cone_cells`.

        aperture, centre : half-widths and middle of the rectangle at which those of a collimated beam end,
            mm; left out, the aperture that the source lights.
        direction : (3,) unit vector, into which all of a diverging beam's flux goes.
        """
        raise TypeError("light from every point of an area in many directions has no cells")

    def rays(self, counts: Counts, fresh: Fresh = None) -> RayGrid | Rays:
        """Return rays of the source, those of a collimated one only where they meet the aperture.

        counts : (nx, ny).  An extended source has their product of rays, rounded to a power of two.
        fresh : draws a shift of the grid or another scrambling; without it the set is always the same.
        """
        return next(self.parts(counts, fresh))

    @abstractmethod
    def parts(
        self, counts: Counts, fresh: Fresh = None, most: int = ALL, aperture: Ends = None, centre: Pair = AXIS
    ) -> Iterator[RayGrid | Rays]:
        """Yield the rays of `rays` in parts of about `most`.  aperture, centre : as of `cells`."""

    def replicates(
        self, number: int, counts: Counts, fresh: np.random.Generator, most: int
    ) -> Iterator[Iterator[RayGrid | Rays]]:
        """Yield independent sets of rays, each as `parts` yields them.

        Of a ray file they are parts of its rays: more than it holds there are not.
        """
        for _ in range(number):
            yield self.parts(counts, fresh, most)


def drawn_shift(fresh: Fresh) -> list[float]:
    """Return by which fractions of its step a grid of rays moves, |shift| <= 1/2."""
    return [0.0, 0.0] if fresh is None else fresh.uniform(-0.5, 0.5, 2).tolist()


def drawn_sobol(counts: Counts, fresh: Fresh) -> tuple[int, int]:
    """Return how many Sobol points stand for `counts` rays, a power of two, and the seed of their scrambling.

    What grids draw is drawn too, and left.
    """
    drawn_shift(fresh)
    count = 1 << max(2, round(log2(counts[0] * counts[1])))
    return count, 0 if fresh is None else int(fresh.integers(1, 1 << 31))
