"""Sources that numbers describe: a point, beams along +z, and Lambertian areas."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from optics.base.runtime import speaking_of
from optics.scene.sources.cells import SourceCells, beam_cells, cone_cells, tilted_cells
from optics.scene.sources.collimated import collimated_beam
from optics.scene.sources.divergence import PARALLEL, Divergence
from optics.scene.sources.light_source import (
    ALL,
    AXIS,
    Counts,
    Ends,
    Fresh,
    LightSource,
    Pair,
    drawn_shift,
    drawn_sobol,
)
from optics.scene.sources.profile import Profile
from optics.scene.sources.rays import RayGrid, Rays
from optics.scene.sources.spreading import area_parts, point_rays
from thbcad.certified import DIRECTIONS, Stack, ellipse_supports, rectangle_supports
from thbcad.checks import Floats


@dataclass(frozen=True, eq=False, kw_only=True)
class PointSource(LightSource):
    """A point on the axis with intensity ~ cos(theta)^exponent within a cone of `half_angle` degrees."""

    half_angle: float
    exponent: float
    axial = True
    kinked = True

    @property
    def cone(self) -> float:
        return self.half_angle

    def envelope(self) -> tuple[Stack, float]:
        return Stack(np.array([-self.distance]), np.zeros((1, len(DIRECTIONS)))), self.half_angle

    def cells(
        self, counts: Counts, aperture: Ends = None, centre: Pair = AXIS, direction: Floats | None = None
    ) -> SourceCells:
        return cone_cells(self.distance, self.flux, self.half_angle, self.exponent, counts)

    def parts(
        self, counts: Counts, fresh: Fresh = None, most: int = ALL, aperture: Ends = None, centre: Pair = AXIS
    ) -> Iterator[Rays]:
        shift = drawn_shift(fresh)
        rays = point_rays(self.distance, self.flux, self.half_angle, self.exponent, counts, shift)
        yield from rays.slices(most)


@dataclass(frozen=True, eq=False, kw_only=True)
class AreaSource(LightSource):
    """An area in the plane z = -distance, whose points all spread their light alike.

    half_width : of its rectangle, mm.
    shape, sigma : kind and sigma of its `Profile`.  picture : path of its image, read when it is needed.
    """

    half_width: tuple[float, float]
    shape: str
    sigma: tuple[float, float]
    picture: str
    scalable = True

    @cached_property
    def profile(self) -> Profile:
        light = None
        if self.shape == "image":
            from optics.scene.receivers import read_picture  # needs Pillow

            with speaking_of("source.image"):
                light = read_picture(self.picture, "linear")
        return Profile(self.shape, self.sigma, light)

    @property
    def etendue(self) -> float:
        hx, hy = self.half_width
        return self.profile.area * hx * hy / self.spread.greatest if self.extended else 0.0

    def envelope(self) -> tuple[Stack, float]:
        figure = ellipse_supports if self.profile.round else rectangle_supports
        return Stack(np.array([-self.distance]), figure(self.half_width)[None]), self.spread.widest

    def parts(
        self, counts: Counts, fresh: Fresh = None, most: int = ALL, aperture: Ends = None, centre: Pair = AXIS
    ) -> Iterator[RayGrid | Rays]:
        area = self.half_width, self.distance, self.flux, self.spread, self.profile
        yield from area_parts(*area, *drawn_sobol(counts, fresh), most)


@dataclass(frozen=True, eq=False, kw_only=True)
class CollimatedBeam(AreaSource):
    """A beam along +z, parallel or nearly so.

    aperture : half-widths of the front that it lights, mm.  divergence : of the light of every point.
    """

    aperture: tuple[float, float]
    divergence: Divergence
    from_afar = True

    @property
    def spread(self) -> Divergence:
        return self.divergence

    @property
    def whole(self) -> LightSource:
        return replace(self, aperture=self.half_width)

    def without_extent(self) -> LightSource:
        return replace(self, divergence=PARALLEL) if self.extended else self

    def cells(
        self, counts: Counts, aperture: Ends = None, centre: Pair = AXIS, direction: Floats | None = None
    ) -> SourceCells:
        area, profile = self.half_width, self.profile
        if direction is not None:
            return tilted_cells(area, self.distance, self.flux, direction, counts, profile)
        return beam_cells(area, self.flux, aperture or self.aperture, counts, profile, centre)

    def parts(
        self, counts: Counts, fresh: Fresh = None, most: int = ALL, aperture: Ends = None, centre: Pair = AXIS
    ) -> Iterator[RayGrid | Rays]:
        if self.extended:
            yield from super().parts(counts, fresh, most)
            return
        shift, ends = drawn_shift(fresh), aperture or self.aperture
        beam = collimated_beam(self.half_width, self.flux, ends, counts, shift, self.profile, centre)
        yield from beam.slices(most)


@dataclass(frozen=True, eq=False, kw_only=True)
class LambertianArea(AreaSource):
    """A Lambertian emitter: the same radiance in all directions of a cone of `half_angle` degrees."""

    half_angle: float
    emitter = True

    @property
    def spread(self) -> Divergence:
        return Divergence("lambertian", self.half_angle)

    @property
    def image(self) -> tuple[Profile, tuple[float, float]]:
        return self.profile, self.half_width

    def without_extent(self) -> LightSource:
        return PointSource(flux=self.flux, distance=self.distance, half_angle=self.half_angle, exponent=1.0)
