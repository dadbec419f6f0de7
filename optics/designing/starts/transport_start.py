"""The surface to start from: optimal transport, the law of refraction or reflection, and a fit of slopes.

The light of a source without extent has one direction at every point of the surface that is shaped.  Optimal
transport from its density there to the target gives the target point of each point, and Snell's law the
slope that sends the light there.  Where parallel light meets the rear of a lens on the axis, it does not
change with the shape that is looked for; anywhere else, and for a wide far field, it is traced again on each
new shape (`shaped_along`).  The light that is sent is that which arrives: Fresnel's losses are made up for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from optics.base.runtime import Backend
from optics.designing.starts.cell_sums import summed_over_cells
from optics.designing.starts.lost_light import CELLS, lost_share, passing_share, stretched
from optics.designing.starts.path_light import light_on
from optics.designing.starts.path_start import Picture, shaped_along
from optics.designing.starts.rear_light import (
    DARK,
    LEAST_WEIGHT,
    Floats,
    RearLight,
    as_many_within,
    centres,
    inside,
)
from optics.designing.transport import height_from_slopes, prewarped, transport_map
from optics.light.blur import aimed
from optics.light.refraction import RestOfPath, ShapedSurface
from optics.scene.paths import LightPath
from optics.scene.receivers import Screen, lit_part
from optics.scene.system import OpticalSystem, target_irradiance
from thbcad.fitting import fit_slopes, level_misfits, seen_functions
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens, require_sound
from thbcad.surfaces import THBSurface

SNELL_STEPS = 4
TRACED = 2  # level of the fit that tells whether a sag is within its bounds
CELLS_PER_PIXEL = 2
LEAST_CELLS, MOST_CELLS = 64, 512
# degrees, half of a far field from which on its angles are no chart for transport (pearl, 40 degrees: the
# start's rel_l2 is 0.18 by angles and 0.09 by the slopes that they need; at 15 degrees both end alike)
WIDE = 20.0
DETAIL = 0.015  # pixels: texture moves light by little, but changes its density
UNIFORM_DETAIL = 0.05  # the same of uniform light, which has an outline but no texture
INSIDE = 0.97  # of z_freedom
ROOM = 1.02  # times the z_freedom that the map needs: finer meshes ask for a little more
# of the coefficients.  With a fiftieth cut off, the last level repairs what is missing (pearl, R = 100,
# z_freedom 9.5: rel_l2 0.041); with a fifth, optimising every level pays (z_freedom 8: 0.059 against 0.115)
MOST_CUT = 0.05
# at most, of a sag that crosses the front: the gap is linear in the sag and positive without it
HALVINGS = 20
CHANGE = 0.05  # of the density to ask for, relative to that wanted: with less another map does not pay
# the same within an outline, where texture alone changes more of it (pearl on a disk, five seeds: a change of
# 0.067, rel_l2 0.0284 with another map and 0.0285 without)
CHANGE_WITHIN = 0.1


@dataclass(frozen=True, eq=False)
class TransportFit:
    """A sag with about the slopes of a transport map.

    asked : mm, the greatest |c| that the slopes ask for where there is light.
    cut : share of the coefficients that z_freedom cuts off.
    crosses : the sag within z_freedom would cross the front; it is scaled down.
    """

    sag: THBSurface
    asked: float
    cut: float
    crosses: bool


class TransportStart:
    """Slopes of the rear, or of a front that alone is free, that send light without extent to the target.

    A Lambertian source is taken as a point in its centre.  `fit` gives the sag with these slopes in any THB
    space.  Where light is blurred, it is sent to the light that `optics.light.blur.aimed` aims at.

    traced : a fit of the light, None where it is parallel before the surface
    bent : share of the light that a slope can send to where the map wants it

    most : cells of the map in each direction, at most.
    """

    def __init__(self, system: OpticalSystem, backend: Backend, most: int = MOST_CELLS) -> None:
        system = aimed(system, spot_lens(system, backend), backend)
        self._system, self._lens, self._backend = system, system.lens, backend
        screen, receiver = system.goal.screen(), system.target.receiver
        self.lit, self._centre, self.half_lit = lit_part(system.goal.irradiance(screen, 1.0), screen, DARK)
        self._surface: FreeformSurface = getattr(system.lens, system.shaped)
        counts = (int(np.clip(CELLS_PER_PIXEL * n, LEAST_CELLS, most)) for n in screen.pixels)
        nx, ny = (as_many_within(self._surface.outline, n) for n in counts)
        self._cells = nx, ny
        self._bound = INSIDE * system.freeforms[-1].freedom
        self.traced: TransportFit | None = None
        self.bent = 1.0
        narrow = receiver.across_axis and not (receiver.far_field and max(self.half_lit) > WIDE)
        if system.parallel and system.shaped == "rear" and narrow and not self._crosses:
            self._vertex = system.lens.thickness
            air = RestOfPath((), (1.0,), receiver)
            self._refraction = ShapedSurface(False, (system.lens.index, 1.0), air)
            self._light, self._slopes = self._shape_parallel()
            self._weight = self._light.weight
            return
        path, finest = self._path(), system.freeforms[-1].finest
        picture = Picture(np.ascontiguousarray(self.lit[::-1].T), self._centre, self.half_lit, self._crosses)
        shaped = shaped_along(backend, path, path.shaped, system.source, picture, self._cells, finest)
        self._light, self._slopes, self.bent = shaped.light, shaped.above, shaped.bent
        self._places: Sequence[Floats] = shaped.places
        self._weight = np.ones(self._cells)  # the slopes go on where no light is
        if not shaped.light.parallel:
            self.traced = self.fit(self._lens.sags[-1].space.uniform(min(TRACED, finest)))

    def _path(self) -> LightPath:
        """Return the path to the surface and behind it, with the losses that the design reckons with."""
        path = self._system.path(self._lens)
        return path if self._system.problem.optimizer.fresnel else path.without_reflection()

    @property
    def _crosses(self) -> bool:
        return self._system.target.settings.crossing

    def fit(self, space: THBSpace) -> TransportFit:
        """Return the sag in a THB space over x, y in mm.

        Coefficients beyond z_freedom are cut off there; the others still send their light where it belongs.
        A sag that then crosses the front is scaled down.  It moves the light a part of the distance.
        """
        light, (zx, zy) = self._light, self._slopes
        sag = fit_slopes(space, light.x, light.y, zx, zy, self._weight)
        seen = seen_functions(space, light.x, light.y)
        size, crosses = np.abs(sag.coefficients[seen] if seen.any() else sag.coefficients), False
        kept = np.clip(sag.coefficients, -self._bound, self._bound)
        for _ in range(HALVINGS):
            try:
                require_sound(_with_last(self._lens, THBSurface(space, kept)))
                break
            except ValueError:
                kept, crosses = kept / 2, True
        cut = float(np.mean(size > self._bound))
        return TransportFit(THBSurface(space, kept), float(size.max()), cut, crosses)

    def misfit(self, sag: THBSurface) -> Floats:
        """Return the squared deviation of a sag's slopes from those of the map, summed over every leaf cell.

        Shape (n_cells,).
        """
        light, (zx, zy) = self._light, self._slopes
        off_x = sag.grid(light.x, light.y, (1, 0)) - zx
        off_y = sag.grid(light.x, light.y, (0, 1)) - zy
        deviation = off_x**2 + off_y**2
        return summed_over_cells(sag.space, light.x, light.y, light.weight * deviation)

    def rear_slopes(self) -> tuple[RearLight, list[Floats]]:
        """Return the light at the shaped surface, and the slopes (zx, zy) that all of it needs, (nx, ny)."""
        light, above, conic = self._light, self._slopes, self._surface.conic
        x, y = light.x[:, None], light.y[None, :]
        return light, [s + conic(x, y, d) for s, d in zip(above, ((1, 0), (0, 1)))]

    def lost(self, system: OpticalSystem) -> float:
        """Return the share of the light that the surface loses, see `lost_share`, which sends it to the same
        places of a target that lies elsewhere; with what misses an element that is turned."""
        path, here = system.path(self._lens), self._system.path(self._lens)
        number = path.shaped
        sides = zip(system.target.settings.half_width, self._system.target.settings.half_width)
        places = [new / old * a for (new, old), a in zip(sides, self._places)]
        if np.array_equal(system.pose.rotation, self._system.pose.rotation):
            return lost_share(path, number, self._light, places)
        lights = [light_on(self._backend, p, number, system.source, (CELLS, CELLS)) for p in (here, path)]
        before, now = (float(light.emitted((CELLS, CELLS)).sum()) for light in lights)
        turned = lost_share(path, number, lights[1], stretched(places, self._light, lights[1]))
        return 1 - now / before * (1 - turned)

    def level(self, least: int, finest: int) -> int:
        """Return the coarsest level, at least `least`, from which on another moves light by less than DETAIL
        (UNIFORM_DETAIL where uniform light is asked for).

        That is e |n - n'| throw in pixels, 2 n e throw where it reflects, with e^2 what another level takes
        off the mean square of the slopes' misfit.  Slopes that no surface has remain in all of them.
        """
        light, (zx, zy), target = self._light, self._slopes, self._system.target
        misfits = level_misfits(self._lens.sags[-1].space, light.x, light.y, zx, zy, light.weight, finest + 1)
        path = self._system.path(self._lens)
        before, behind = (medium.index for medium in path.media[path.shaped : path.shaped + 2])
        reflects = path.surfaces[path.shaped].kind == "reflect"
        moved = (2 * before if reflects else abs(before - behind)) * path.lever / min(target.screen().pitch)
        gains = moved * np.sqrt(np.maximum(misfits[:-1] ** 2 - misfits[1:] ** 2, 0))
        detail = DETAIL if target.uniform_region is None else UNIFORM_DETAIL
        return max([least, *(np.flatnonzero(gains > detail) + 1).tolist()])

    def within(self, fit: TransportFit) -> bool:
        """Whether the sag of a fit keeps to z_freedom and clear of the front."""
        return fit.asked <= self._bound and not fit.crosses

    def follows(self, fit: TransportFit) -> bool:
        """Whether the sag of a fit sends most of the light where the map wants it."""
        return fit.cut <= MOST_CUT and not fit.crosses

    def note(self, fit: TransportFit) -> str:
        """Return a sentence for the user where z_freedom or the thickness is too small for the map, or ""."""
        if self.within(fit):
            return ""
        asked, optic = f"the transport map asks for a sag of +-{fit.asked:.3g} mm", self._system.problem.optic
        if fit.asked > max(self._surface.half_width):
            wide = f"{asked}, more than the {optic.noun} is wide"
            return f"{wide}: are the units right, is the target within reach?"
        if fit.crosses:
            return (
                f"{asked}, which would bring rear and front together; raise {optic.key('thickness')} for "
                "better light"
            )
        flat = ", or --set optimizer.start=flat, which does without the map" * self._system.source.emitter
        return (
            f"{asked}, more than z_freedom allows: for better light "
            f"--set {optic.key(self._system.shaped)}.freeform.z_freedom={ROOM * fit.asked / INSIDE:.3g}{flat}"
        )

    def _shape_parallel(self) -> tuple[RearLight, list[Floats]]:
        """Return light and slopes for parallel rays: the surface changes neither density nor directions."""
        source, lens = self._system.source, self._lens
        size = self._system.problem.source.half_width
        outlines = {lens.front.outline, self._surface.outline}
        half = [min(h) for h in zip(size, lens.front.half_width, self._surface.half_width)]
        relative = [b / s for b, s in zip(half, size)]

        @cache
        def emitted(grid: tuple[int, ...]) -> Floats:
            s, t = (r * ((2 * np.arange(n) + 1) / n - 1) for n, r in zip(grid, relative))
            return source.profile(s[:, None], t[None, :]) * inside(outlines, half, grid)

        x, y = centres(half, self._cells)
        along = np.zeros(self._cells)
        weight = np.maximum(inside(outlines, half, self._cells), LEAST_WEIGHT)
        light = RearLight(x, y, (along, along, along + 1), emitted, weight)
        arrival = self._arrival(light, half, self.lit)
        above, self.bent = self._above(light, arrival, np.zeros(self._cells), SNELL_STEPS)
        picture = self._prewarped(light, arrival, above)
        if picture is not None:
            arrival = self._arrival(light, half, picture)
            above, _ = self._above(light, arrival, _height(light, above), 1)
        self._places = arrival
        return light, above

    def _above(
        self, light: RearLight, arrival: Sequence[Floats], sag: Floats, steps: int
    ) -> tuple[list[Floats], float]:
        """Return the slopes of the sag that sends parallel light to its arrival, in steps from a sag, mm, and
        the share of the light that slopes can send there.
        """
        base = self._vertex + self._surface.conic(light.x[:, None], light.y[None, :])
        for _ in range(steps):
            points = light.x[:, None], light.y[None, :], base + sag
            slopes, refracts = self._refraction.slopes(points, light.direction, arrival)
            above = _above_conic(light, self._surface, slopes)
            sag = _height(light, above)
        return above, float(np.average(refracts, weights=light.emitted(self._cells)))

    def _prewarped(
        self, light: RearLight, arrival: Sequence[Floats], above: Sequence[Floats]
    ) -> Floats | None:
        """Return the picture to ask for, so that the one that is wanted arrives.

        None where it would hardly be another one.
        """
        sag = _height(light, above)
        # where light lands that a sag on the cells refracts, mm or degrees
        x, y = light.x[:, None], light.y[None, :]
        steep = np.gradient(sag, *_spacing(light))
        slopes = [s + self._surface.conic(x, y, d) for s, d in zip(steep, ((1, 0), (0, 1)))]
        height = self._vertex + self._surface.conic(x, y) + sag
        landing = self._refraction.landing((x, y, height), light.direction, slopes)
        sent = [(a - c) / h for a, c, h in zip(arrival, self._centre, self.half_lit)]
        beside = [(q - a) / h for q, a, h in zip(landing, arrival, self.half_lit)]
        wanted = self._density(self.lit, self._cells)
        path = self._path()
        share = passing_share(path.surfaces[path.shaped], self._refraction, light.direction, slopes)
        asked = prewarped(wanted, sent, beside, light.emitted(self._cells), share=share)
        change = np.linalg.norm(asked / asked.mean() - wanted / wanted.mean())
        enough = CHANGE if self._surface.outline.is_rectangle else CHANGE_WITHIN
        much = change > enough * np.linalg.norm(wanted / wanted.mean())
        return asked.T[::-1] if much else None

    def _density(self, picture: Floats, grid: tuple[int, int]) -> Floats:
        """Return a picture of the lit rectangle as cell means, (nx, ny)."""
        return target_irradiance(picture, Screen(self.half_lit, grid), "stretch", 1.0)[::-1].T

    def _arrival(self, light: RearLight, half: Sequence[float], picture: Floats) -> tuple[Floats, Floats]:
        """Return the target coordinates to which transport sends the light's cells, mm or degrees."""
        aspect = np.sqrt(half[0] * self.half_lit[0] / (half[1] * self.half_lit[1]))
        density = partial(self._density, picture)
        plan = transport_map(self._backend, density, self._cells, aspect, light.emitted)
        return self._centre[0] + self.half_lit[0] * plan.tx, self._centre[1] + self.half_lit[1] * plan.ty


def spot_lens(system: OpticalSystem, backend: Backend) -> Lens:
    """Return the lens that tells the blur of a system before there is a design: the base lens, that sends its
    light about to a target across the axis, and that of a coarse map to any other one."""
    if not system.blurred or system.target.receiver.across_axis:
        return system.lens
    start = TransportStart(system.sharp, backend, LEAST_CELLS)
    return _with_last(system.lens, start.fit(system.lens.sags[-1].space).sag)


def _with_last(lens: Lens, sag: THBSurface) -> Lens:
    """Return the lens with another sag on the last of its free surfaces."""
    return lens.with_sags([*lens.sags[:-1], sag])


def _above_conic(light: RearLight, surface: FreeformSurface, slopes: Sequence[Floats]) -> list[Floats]:
    """Return the slopes that a sag adds to those of the surface's conic."""
    x, y = light.x[:, None], light.y[None, :]
    return [s - surface.conic(x, y, d) for s, d in zip(slopes, ((1, 0), (0, 1)))]


def _height(light: RearLight, slopes: Sequence[Floats]) -> Floats:
    """Return the sag with about these slopes, whose greatest and least value are opposite, (nx, ny), mm.

    That is the constant which `fit_slopes` chooses, as far as coefficients are values.
    """
    zx, zy = slopes
    sag = height_from_slopes(zx, zy, _spacing(light))
    return sag - (sag.max() + sag.min()) / 2


def _spacing(light: RearLight) -> list[float]:
    return [float(row[1] - row[0]) for row in (light.x, light.y)]
