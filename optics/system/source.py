"""The light that a problem starts from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import acos, degrees, log2
from typing import TYPE_CHECKING

import numpy as np

from optics.problem import OF_FILES
from optics.ray_files import PlacedRays, placed_rays, read_rays
from optics.runtime import speaking_of
from optics.sources import (
    Divergence,
    Profile,
    RayGrid,
    Rays,
    SourceCells,
    area_parts,
    beam_cells,
    collimated_beam,
    cone_cells,
    point_rays,
    tilted_cells,
)
from optics.system.luminaire_rays import PlacedLuminaire, placed_luminaire
from optics.target import read_picture
from thbcad.poses import Pose

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from optics.problem import Source

UNLIMITED = 1 << 62  # rays at once
WITHIN = 0.99  # of a file's forward flux: the cone of the point that stands for it
RAYS_OF_POINT = (128, 128)  # of a luminaire, which tell that point
NEAREST, FAR_AWAY, LEAST_ANGLE = 1e-3, 1e6, 0.01  # mm, mm, degrees: limits of that point


@dataclass(frozen=True, eq=False)
class LightSource:
    """A source and the aperture that it lights.

    settings : of the problem file.  aperture : half-widths of the front, mm.
    """

    settings: Source
    aperture: tuple[float, float]

    @property
    def collimated(self) -> bool:
        """Whether all rays are parallel to z."""
        return self.settings.kind == "collimated" and not self.settings.half_divergence

    @cached_property
    def profile(self) -> Profile:
        """How the light spreads over the source's area.

        Raises
        ------
        UserError : see `read_picture`.
        """
        source = self.settings
        light = None
        if source.profile == "image":
            with speaking_of("source.image"):
                light = read_picture(source.image, "linear")
        return Profile(source.profile, source.sigma, light)

    @cached_property
    def of_file(self) -> PlacedRays:
        """The rays of the source's file in the scene.

        Raises
        ------
        UserError : see `read_rays`.
        """
        source = self.settings
        with speaking_of("source.file"):
            rays = read_rays(source.file)
        return placed_rays(rays, self.pose, source.flux)

    @cached_property
    def luminaire(self) -> PlacedLuminaire:
        """The luminaire of the source's file in the scene.

        Raises
        ------
        UserError : see `read_luminaire`.
        """
        return placed_luminaire(self.settings, self.pose)

    @property
    def pose(self) -> Pose:
        """From the frame of a file's light to the scene's.

        X, Y and Z turn about one axis each, right-handed.  By `tilt`, about own axes, it is X Y Z; by `turn`,
        about axes that stay, Z Y X.
        """
        from scipy.spatial.transform import Rotation

        source = self.settings
        position = *source.shift, -source.distance
        if not any(source.turn):
            return Pose.tilted(position, source.tilt)
        return Pose(Rotation.from_euler("xyz", source.turn, degrees=True).as_matrix(), np.array(position))

    def without_extent(self) -> LightSource:
        """Return the source without its spread: of a beam parallel light, of a glowing area the point in its
        middle, with its intensity; of a file's light one where its rays are nearest to."""
        if not self.extended:
            return self
        if self.settings.kind in OF_FILES:
            return replace(self, settings=self._point_of_rays())
        if self.settings.kind == "collimated":
            settings = replace(self.settings, divergence=0.0, divergence_profile="uniform")
        else:
            settings = replace(self.settings, kind="point", exponent=1.0)
        return replace(self, settings=settings)

    @property
    def extended(self) -> bool:
        """Whether light comes from every point of an area in many directions, so that cells have no image."""
        return self.settings.kind in ("lambertian", *OF_FILES) or self.settings.half_divergence > 0

    @property
    def diverging(self) -> bool:
        """Whether it is a beam whose points spread their light: cells measure each direction of it."""
        return self.settings.half_divergence > 0

    @property
    def symmetric(self) -> bool:
        """Whether the source is its own mirror image in x and y, but for the picture of its profile."""
        if self.settings.kind == "luminaire":
            return self.luminaire.symmetric
        return self.settings.kind != "rays"

    @property
    def area(self) -> float:
        """The area that shines, mm^2: of the ellipse for round profiles, else of the rectangle."""
        hx, hy = self.settings.half_width
        return self.profile.area * hx * hy

    @property
    def etendue(self) -> float:
        """Flux over the radiance on the axis of a source whose points are equally bright, mm^2 sr.

        Of a Lambertian one it is pi A sin^2(half_angle); it is 0 without extent or a known radiance.
        """
        known = self.extended and self.settings.kind not in OF_FILES
        return self.area / self.spread.brightest if known else 0.0

    @property
    def image(self) -> tuple[Profile, tuple[float, float]]:
        """What a pinhole in the lens throws of an extended source: its profile and its proportions."""
        if self.settings.kind == "lambertian":
            return self.profile, self.settings.half_width
        return self.spread.picture, (1.0, 1.0)

    @property
    def spread(self) -> Divergence:
        """How the light of every point of an extended source spreads around +z."""
        source = self.settings
        if source.kind == "lambertian":
            return Divergence("lambertian", source.half_angle)
        return Divergence(source.divergence_profile, source.half_divergence)

    @property
    def _cone(self) -> dict[str, float]:
        """The light of a point, as `cone_cells` and `point_rays` take it."""
        source = self.settings
        return {
            "distance": source.distance,
            "flux": source.flux,
            "half_angle": source.half_angle,
            "exponent": source.exponent,
        }

    def cells(
        self,
        counts: Sequence[int],
        aperture: Sequence[float] | None = None,
        centre: Sequence[float] = (0.0, 0.0),
    ) -> SourceCells:
        """Return (nx, ny) cells of a source that is not extended.

        aperture, centre : half-widths and middle of the rectangle at which those of a collimated beam end,
            mm; left out, the aperture that the source lights.
        """
        source = self.settings
        if self.collimated:
            ends = aperture or self.aperture
            return beam_cells(source.half_width, source.flux, ends, counts, self.profile, centre)
        return cone_cells(**self._cone, counts=counts)

    def beam(self, counts: Sequence[int], direction: NDArray[np.float64]) -> SourceCells:
        """Return (nx, ny) cells of a diverging beam's light in one direction, with all of its flux."""
        source, profile = self.settings, self.profile
        return tilted_cells(source.half_width, source.distance, source.flux, direction, counts, profile)

    def rays(self, counts: Sequence[int], fresh: np.random.Generator | None = None) -> RayGrid | Rays:
        """Return rays of the source, those of a collimated one only where they meet the aperture.

        counts : (nx, ny).  An extended source has their product of rays, rounded to a power of two.
        fresh : draws a shift of the grid or another scrambling; without it the set is always the same.
        """
        return next(self.parts(counts, fresh))

    def parts(
        self,
        counts: Sequence[int],
        fresh: np.random.Generator | None = None,
        most: int = UNLIMITED,
        aperture: tuple[float, float] | None = None,
        centre: tuple[float, float] = (0.0, 0.0),
    ) -> Iterator[RayGrid | Rays]:
        """Yield the rays of `rays` in parts of about `most`.  aperture, centre : as of `cells`."""
        source, profile = self.settings, self.profile
        shift = [0.0, 0.0] if fresh is None else fresh.uniform(-0.5, 0.5, 2).tolist()
        if source.kind == "rays":
            chosen = self.of_file.thinned(counts[0] * counts[1], 0.5 + shift[0])
            yield from Rays(chosen.origin, chosen.direction, chosen.flux).slices(most)
            return
        if self.collimated:
            ends = aperture or self.aperture
            beam = collimated_beam(source.half_width, source.flux, ends, counts, shift, profile, centre)
            yield from beam.slices(most)
        elif source.kind == "point":
            yield from point_rays(**self._cone, counts=counts, shift=shift).slices(most)
        else:
            count = 1 << max(2, round(log2(counts[0] * counts[1])))
            seed = 0 if fresh is None else int(fresh.integers(1, 1 << 31))
            if source.kind == "luminaire":
                yield from self.luminaire.parts(count, seed, most)
                return
            yield from area_parts(
                half_width=source.half_width,
                distance=source.distance,
                flux=source.flux,
                spread=self.spread,
                profile=profile,
                count=count,
                seed=seed,
                most=most,
            )

    def replicates(
        self, number: int, counts: Sequence[int], fresh: np.random.Generator, most: int
    ) -> Iterator[Iterator[RayGrid | Rays]]:
        """Yield independent sets of rays, each as `parts` yields them.

        Of a file they are parts of its rays: more than it holds there are not.
        """
        if self.settings.kind != "rays":
            for _ in range(number):
                yield self.parts(counts, fresh, most)
            return
        kept = self.of_file.thinned(number * counts[0] * counts[1], float(fresh.uniform()))
        for hand in kept.dealt(number):
            yield Rays(hand.origin, hand.direction, hand.flux).slices(most)

    def _point_of_rays(self) -> Source:
        """Return a point on the axis from which light comes about as from the file's.

        Its z is the flux-weighted least-squares meeting point of the rays with the axis.  The point lights
        the cone that WITHIN of the forward flux fills, with the intensity of a Lambertian area.
        """
        rays = self.of_file if self.settings.kind == "rays" else self.rays(RAYS_OF_POINT)
        assert not isinstance(rays, RayGrid)
        forward = rays.direction[2] > 0
        direction, flux = rays.direction[:, forward], rays.flux[forward]
        origin, slope = rays.origin[:, forward], direction[:2] / direction[2]
        steep = float((flux * (slope**2).sum(axis=0)).sum())
        offset = origin[:2] - origin[2] * slope
        z = -float((flux * (offset * slope).sum(axis=0)).sum()) / steep if steep else -FAR_AWAY
        order = np.argsort(direction[2])[::-1]
        within = np.searchsorted(np.cumsum(flux[order]), WITHIN * flux.sum())
        cosine = direction[2][order][min(within, len(order) - 1)]
        return replace(
            self.settings,
            kind="point",
            distance=float(np.clip(-z, NEAREST, FAR_AWAY)),
            half_angle=float(np.clip(degrees(acos(min(cosine, 1.0))), LEAST_ANGLE, 90.0)),
            exponent=1.0,
        )
