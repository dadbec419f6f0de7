"""The light that a problem asks for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import UserError, speaking_of
from optics.scene.photometry import RASTER, LitRegion, units_of
from optics.scene.problem import Target
from optics.scene.receivers import (
    Cylinder,
    FarField,
    Plane,
    Receiver,
    Screen,
    Sphere,
    ZoneRow,
    divided,
    fit_picture,
    formula_light,
    formula_pixels,
    merged,
    require_quick,
    smoothest_light,
    uniform_region,
    zone_places,
    zone_rows,
)
from thbcad.checks import Floats
from thbcad.poses import Pose

LEAST_MISS = 0.01  # of a limit: less is left to the weights of the smoothest light
# degrees, that zones of the far field are read over: a square of 65 mm at 25 m, which holds the photometer of
# UN Regulations Nos. 112 and 149
APERTURE = 0.15
# pixels, at least, of the light that zones are read in (headlamp: readings are then within 0.1 % of those in
# much finer light, with 1.2 pixels within 1.5 %)
PER_APERTURE = 3
FORMULA_CELLS = 210  # of the target in each direction, on which the region of a formula is looked for
WHOLE = 1e-9  # of a pixel, what may be dark of one that is lit wholly: rounding


def receiver_of(target: Target, rear: float) -> Receiver:
    """Return what receives the light of a target.  rear : z from which its distance counts, mm."""
    if target.far_field:
        return FarField(Pose.tilted((0.0, 0.0, 0.0), target.tilt))
    position = target.position or (0.0, 0.0, rear + (target.distance or 0.0))
    pose = Pose.tilted(position, target.tilt)
    if target.surface == "plane":
        return Plane(pose)
    return {"cylinder": Cylinder, "sphere": Sphere}[target.surface](pose, radius=target.radius)


@dataclass(frozen=True, eq=False)
class LightTarget:
    """The light asked for, and where.

    settings : of the problem file.  receiver : of the light, in the frame of the scene.
    flux : that may arrive, which the smoothest light of zones needs.
    corrections : of what a design aims at in every row of the zones, factors; none are 1.
    given : linear light in place of what the settings describe.
    """

    settings: Target
    receiver: Receiver
    flux: float = 1.0
    corrections: tuple[float, ...] = ()
    given: Floats | None = None

    @cached_property
    def light(self) -> Floats:
        """Linear light: a picture at its own resolution, a region or a formula on the target's pixels.

        Row 0 is at the greatest y, column 0 at the least x.

        Raises UserError : see `read_picture` and `formula_light`.
        """
        target = self.settings
        if self.given is not None:
            return self.given
        if target.kind == "tophat":
            light = uniform_region(target.shape, target.pixels, target.lit)
            if not light.any():
                raise UserError(
                    f"target.lit = {list(target.lit)} leaves no light on the pixels; "
                    "make it larger, or target.half_width smaller"
                )
            return light
        if target.kind == "function":
            require_quick(target.formula, target.pixels)
            return formula_light(target.formula, target.pixels)
        if target.kind == "zones":
            return smoothest_light(self.screen(), self.zone_rows(self.screen()), self.flux)
        from optics.scene.receivers import read_picture  # needs Pillow

        with speaking_of("target.image"):
            light = read_picture(target.image, target.encoding)
        # column 0 is at -x: on the left for one behind the target, on the right for one at the lens
        return np.ascontiguousarray(light[:, ::-1]) if self.mirrored else light

    @property
    def mirrored(self) -> bool:
        """Whether the viewer for whom the picture reads right sees x go to the left."""
        return self.settings.seen_from == "lens"

    @cached_property
    def lit_pixels(self) -> NDArray[np.bool_] | None:
        """The pixels that a region or a formula lights wholly, (rows, columns); None of other light."""
        target = self.settings
        if target.kind in ("image", "zones"):
            return None
        if target.kind == "function":
            return formula_pixels(target.formula, target.pixels)
        return self.light > 1 - WHOLE

    @cached_property
    def uniform_region(self) -> LitRegion | None:
        """The region on which the same light is asked for everywhere.

        None of other light, and of a formula whose light varies.
        """
        target, lit = self.settings, self.lit_pixels
        if target.kind == "tophat":
            x, y = (h * part for h, part in zip(target.half_width, target.lit))
            inside = uniform_region(target.shape, (RASTER, RASTER), (1.0, 1.0)) > 1 - WHOLE
            return LitRegion((-x, x), (-y, y), inside)
        if lit is None or not lit.any() or np.ptp(self.light[lit]) > WHOLE * self.light.max():
            return None
        cells = formula_pixels(target.formula, (FORMULA_CELLS, FORMULA_CELLS))
        return LitRegion.of_pixels(cells, target.half_width)

    def box_screen(self, grid: int) -> Screen | None:
        """Return the boxes on which the uniformity of the region is judged, as pixels of a screen; None
        without a region.  grid : boxes in each direction."""
        region = self.uniform_region
        if region is None:
            return None
        (x, u), (y, v) = region.x, region.y
        half_width, centre = ((u - x) / 2, (v - y) / 2), ((x + u) / 2, (y + v) / 2)
        return Screen(half_width, (grid, grid), receiver=self.receiver, centre=centre)

    @property
    def as_picture(self) -> bool:
        """Whether light is judged as a picture: not uniform light, nor where zones alone count."""
        return self.uniform_region is None and self.settings.kind != "zones"

    def missed(self, lower: bool) -> list[str]:
        """Return the rows that the smoothest light misses, and by how much.

        lower : those whose nearer limit is the lower one, else the others.
        """
        screen, light = self.screen(), self.light
        rows, held = self.zone_rows(screen), float((light * screen.projection()).sum()) * screen.pixel_area
        light = light * min(1.0, self.flux / held)  # limits may take more than there is
        read = ((row.name, row.reading(light[None])) for row in rows)
        short = ((name, -row.margin) for name, row in read if row.at_least == lower)
        return [f"{name} by {share:.0%}" for name, share in short if share > LEAST_MISS]

    def zone_rows(self, screen: Screen) -> list[ZoneRow]:
        """Return the rows of all zones, to read light on a screen's pixels, flux per area there."""
        right = -1 if self.mirrored else 1
        unit = 1 / units_of("lm").density(self.far_field).factor
        rows: list[ZoneRow] = []
        for name, zone in self.settings.zones:
            shape, corners = zone.shape
            parts = [(name, corners)]
            if shape == "points" and not zone.peak:
                parts = [(f"{name} at ({h:g}, {v:g})", ((h, v),)) for h, v in corners]
            limits = unit * zone.least, unit * zone.greatest, zone.least_of_peak
            for called, part in parts:
                at = zone_places(shape, part, screen, right)
                rows += zone_rows(called, at, screen, limits, zone.margin, zone.peak, self.aperture)
        factors = self.corrections or (1.0,) * len(rows)
        return [replace(row, correction=factor) for row, factor in zip(rows, factors, strict=True)]

    @property
    def aperture(self) -> float:
        """Over which zones are read, degrees or mm; 0 is a pixel."""
        return self.settings.aperture or (APERTURE if self.far_field else 0.0)

    @property
    def zone_screen(self) -> Screen:
        """The screen on whose pixels zones are read: fine enough for the aperture."""
        screen, width = self.screen(), self.aperture
        if not self.settings.zones or not width:
            return screen
        return screen.finer(ceil(PER_APERTURE * max(screen.pitch) / width))

    @property
    def unit(self) -> str:
        """Of lengths on the target."""
        return self.receiver.unit

    @property
    def far_field(self) -> bool:
        """Whether light is asked for by direction, in degrees, and not in a plane."""
        return self.receiver.far_field

    def screen(self, coarsening: int = 1, margin: int = 0, parts: int = 1) -> Screen:
        """Return the Screen of the target, with pixels merged `coarsening` times in each direction.

        margin : of dark pixels around it.  parts : of every pixel in each direction, as pixels of their own.
        """
        columns, rows = (parts * -(-n // coarsening) for n in self.settings.pixels)
        return Screen(self.settings.half_width, (columns, rows), parts * margin, self.receiver)

    def of_light(self, screen: Screen, irradiance: Floats) -> LightTarget:
        """Return a target on the same receiver that asks for a given irradiance on a screen's pixels."""
        settings = replace(
            self.settings, kind="image", fit="stretch", half_width=screen.half_width, pixels=screen.pixels
        )
        return LightTarget(settings, self.receiver, given=irradiance / screen.projection())

    def irradiance(self, screen: Screen, flux: float) -> Floats:
        """Return the target irradiance on a screen's pixels, or on their parts, see `target_irradiance`."""
        parts = screen.pixels[0] // self.settings.pixels[0]
        if parts > 1 and screen.half_width == self.settings.half_width:
            return target_irradiance(self._light_within(parts), screen, "stretch", flux)
        return target_irradiance(self.light, screen, self.settings.placing, flux)

    def _light_within(self, parts: int) -> Floats:
        """Return the light of parts x parts of each pixel: the region or formula, or `divided` light.

        The means over pixels are those of the light asked for, which samples of a formula hit nearly.
        """
        target = self.settings
        columns, rows = target.pixels
        aspect = target.half_width[0] / target.half_width[1]
        light = fit_picture(self.light, target.pixels, aspect, target.placing)
        if target.kind not in ("tophat", "function"):
            return divided(light, parts)
        finer = parts * columns, parts * rows
        if target.kind == "tophat":
            within = uniform_region(target.shape, finer, target.lit)
        else:
            within = formula_light(target.formula, finer)
        means = merged(within, parts)
        share = np.divide(light, means, out=np.zeros_like(light), where=means > 0)
        other = np.where(means > 0, 0.0, light)
        share, other = (a.repeat(parts, axis=0).repeat(parts, axis=1) for a in (share, other))
        return within * share + other


def target_irradiance(light: Floats, screen: Screen, fit: str, flux: float) -> Floats:
    """Return the target irradiance on a screen's pixels for a total flux, (rows, columns), W/mm^2.

    In the far field it is in W per square degree.

    light : linear, of any size.  fit : as `fit_picture`.  flux : W.

    Raises UserError : the light is 0 on all pixels.
    """
    aspect = screen.half_width[0] / screen.half_width[1]
    image = fit_picture(light, screen.pixels, aspect, fit) * screen.projection()
    total = image.sum() * screen.pixel_area
    if total <= 0:
        raise UserError("no light is left of the picture inside the target; choose another target.fit")
    return image * (flux / total)
