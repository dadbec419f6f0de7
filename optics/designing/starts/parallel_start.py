"""What a picture asks of the rear of a lens on the axis that parallel light meets.

Neither the density of this light nor its direction changes with the surface that is looked for, so that one
map does, or two: the second makes up for what the first one's surface sends beside its places, and loses.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from optics.base.runtime import Backend
from optics.designing.starts.lost_light import passing_share
from optics.designing.starts.path_start import Picture, ShapedLight
from optics.designing.starts.rear_light import LEAST_WEIGHT, RearLight, centres, inside
from optics.designing.transport import Transport, height_from_slopes, prewarped, transport_map
from optics.light.refraction import RestOfPath, ShapedSurface
from optics.scene.paths import LightPath
from optics.scene.receivers import Screen
from optics.scene.system import System, target_irradiance
from thbcad.checks import Bools, Floats

SNELL_STEPS = 4
CHANGE = 0.05  # of the density to ask for, relative to that wanted: with less another map does not pay
# the same within an outline, where texture alone changes more of it (pearl on a disk, five seeds: a change of
# 0.067, rel_l2 0.0284 with another map and 0.0285 without)
CHANGE_WITHIN = 0.1


@dataclass(frozen=True, eq=False)
class ParallelStart:
    """path : with the losses to make up for.  counts : (nx, ny) cells of the light on the rear."""

    system: System
    backend: Backend
    path: LightPath
    wanted: Picture
    counts: tuple[int, int]

    def shaped(self) -> ShapedLight:
        """Return what the picture asks of the rear."""
        density = self._density(self.wanted.flux)
        transport, arrival = self._arrival(density)
        above, refracts = self._above(arrival, np.zeros(self.counts), SNELL_STEPS)
        picture, share = self._prewarped(arrival, above, density(self.counts))
        if picture is not None:
            transport, arrival = self._arrival(self._density(picture))
            above, _ = self._above(arrival, self._height(above), 1)
        made_up = np.ones(self.counts) if picture is None else share
        bent = float(np.average(refracts, weights=self._light.flux))
        return ShapedLight(self._light, above, bent, arrival, made_up, transport)

    @cached_property
    def _half(self) -> list[float]:
        """Half-widths of the rectangle with light."""
        lens = self.system.base
        return [
            min(h)
            for h in zip(self.system.problem.source.half_width, lens.front.half_width, lens.rear.half_width)
        ]

    @cached_property
    def _light(self) -> RearLight:
        source, lens, half = self.system.source, self.system.base, self._half
        outlines = {lens.front.outline, lens.rear.outline}
        relative = [b / s for b, s in zip(half, self.system.problem.source.half_width)]

        @cache
        def emitted(grid: tuple[int, ...]) -> Floats:
            s, t = (r * ((2 * np.arange(n) + 1) / n - 1) for n, r in zip(grid, relative))
            return source.profile(s[:, None], t[None, :]) * inside(outlines, half, grid)

        x, y = centres(half, self.counts)
        along = np.zeros(self.counts)
        weight = np.maximum(inside(outlines, half, self.counts), LEAST_WEIGHT)
        return RearLight(x, y, (along, along, along + 1), emitted, weight)

    @cached_property
    def _refraction(self) -> ShapedSurface:
        air = RestOfPath((), (1.0,), self.system.target.receiver)
        return ShapedSurface(False, (self.system.base.index, 1.0), air)

    def _conic(self) -> tuple[Floats, Floats, Floats]:
        """Return height and slopes of the rear's conic on the cells."""
        x, y = self._light.x[:, None], self._light.y[None, :]
        conic = self.system.base.rear.conic
        return self.system.base.thickness + conic(x, y), conic(x, y, (1, 0)), conic(x, y, (0, 1))

    def _points(self, sag: Floats) -> tuple[Floats, Floats, Floats]:
        return self._light.x[:, None], self._light.y[None, :], self._conic()[0] + sag

    def _height(self, slopes: Sequence[Floats]) -> Floats:
        """Return the sag with about these slopes, whose greatest and least value are opposite, (nx, ny), mm.

        That is the constant which `fit_slopes` chooses, as far as coefficients are values.
        """
        zx, zy = slopes
        sag = height_from_slopes(zx, zy, self._spacing)
        return np.asarray(sag - (sag.max() + sag.min()) / 2)

    @property
    def _spacing(self) -> list[float]:
        return [float(row[1] - row[0]) for row in (self._light.x, self._light.y)]

    def _above(self, arrival: Sequence[Floats], sag: Floats, steps: int) -> tuple[list[Floats], Bools]:
        """Return the slopes of the sag that sends light to its arrival, in steps from a sag, mm, and where
        slopes can."""
        _, *conic = self._conic()
        for _ in range(steps):
            slopes, refracts = self._refraction.slopes(self._points(sag), self._light.direction, arrival)
            above = [s - c for s, c in zip(slopes, conic)]
            sag = self._height(above)
        return above, refracts

    def _prewarped(
        self, arrival: Sequence[Floats], above: Sequence[Floats], density: Floats
    ) -> tuple[Floats | None, Floats]:
        """Return the picture to ask for, so that the one that is wanted arrives, and the share that passes of
        each cell's light.

        None where it would hardly be another one.  density : of the picture that is wanted, on the cells.
        """
        light, wanted, (_, *conic) = self._light, self.wanted, self._conic()
        sag = self._height(above)
        # where light lands that a sag on the cells refracts, mm or degrees
        slopes = [s + c for s, c in zip(np.gradient(sag, *self._spacing), conic)]
        landing = self._refraction.landing(self._points(sag), light.direction, slopes)
        beside = [(q - a) / h for q, a, h in zip(landing, arrival, wanted.half)]
        shaped = self.path.shaped
        share = passing_share(self.path.surfaces[shaped], self._refraction, light.direction, slopes)
        height = self._points(sag)[2]
        reaching = np.exp(-self.path.media[shaped].absorption * (height - height.min()))
        sent = wanted.relative(arrival)
        asked = prewarped(density, sent, beside, light.flux, share=share * reaching)
        change = np.linalg.norm(asked / asked.mean() - density / density.mean())
        enough = CHANGE if self.system.base.rear.outline.is_rectangle else CHANGE_WITHIN
        much = change > enough * np.linalg.norm(density / density.mean())
        return asked if much else None, share

    def _density(self, picture: Floats) -> Callable[[tuple[int, int]], Floats]:
        """Return the function of a grid that gives a picture of the lit rectangle as cell means, (nx, ny)."""
        rows, half = np.ascontiguousarray(picture.T[::-1]), self.wanted.half
        return lambda grid: target_irradiance(rows, Screen(half, grid), "stretch", 1.0)[::-1].T

    def _arrival(
        self, density: Callable[[tuple[int, int]], Floats]
    ) -> tuple[Transport, tuple[Floats, Floats]]:
        """Return optimal transport, and the target coordinates of the light's cells, mm or degrees."""
        (hx, hy), (u, v), half = self.wanted.half, self.wanted.centre, self._half
        aspect = np.sqrt(half[0] * hx / (half[1] * hy))
        transport = transport_map(self.backend, density, self.counts, aspect, self._light.emitted)
        tx, ty = transport.places
        return transport, (u + hx * tx, v + hy * ty)
