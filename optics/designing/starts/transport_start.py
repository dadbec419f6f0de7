"""The surface to start from: optimal transport, the law of refraction or reflection, and a fit of slopes.

The light of a source without extent has one direction at every point of the surface that is shaped.  Optimal
transport from its density there to the target gives the target point of each point, and Snell's law the
slope that sends the light there.  Where parallel light meets the rear of a lens on the axis, it does not
change with the shape that is looked for (`ParallelStart`); anywhere else, and for a wide far field, it is
traced again on each new shape (`shaped_along`).  Fresnel's losses are made up for.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from math import ceil

import numpy as np

from optics.base.runtime import Backend
from optics.designing.starts.cell_sums import summed_over_cells
from optics.designing.starts.lost_light import CELLS, lost_share, stretched
from optics.designing.starts.parallel_start import ParallelStart
from optics.designing.starts.path_light import light_on
from optics.designing.starts.path_start import MOST_ROUNDS, Picture, shaped_along
from optics.designing.starts.rear_light import DARK, RearLight, as_many_within
from optics.light.blur import aimed
from optics.scene.problem import Freeform
from optics.scene.receivers import lit_part
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.fitting import fit_slopes, level_misfits, seen_functions
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens, require_sound
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

TRACED = 2  # level of the fit that tells whether a sag is within its bounds
CELLS_PER_PIXEL = 2
# of the finest mesh: with fewer, coefficients that alternate are nearly free (a ramp over angles by a beam,
# 80 x 40 pixels, 224 spans: with 0.71 and 0.36 cells a span the design's rel_l2 is 0.256, with these 0.001).
# As many as `seen_functions` asks for, too: with 8 / 7 it saw none of a level (a ramp by a point source, thin
# lens, 112 spans: z_freedom cut off what it should not, 0.065 against 0.0038)
CELLS_PER_SPAN = 10 / 7
# fewer show in the light (a ramp by a beam, 32 x 32 pixels, 56 spans: with 64 cells the start's rel_l2 is
# 0.055 and the design's 0.0038, with these 0.0041 and 0.0008)
LEAST_CELLS, MOST_CELLS = 128, 512
SPOT_CELLS = 64  # of a map that tells a blur
LEAST_AUTO = 3  # level of max_level = "auto": the optimiser mends what the map's own cells leave
MOST_SPANS = 224  # in a direction, of the finest mesh that is fitted whole: the map has 512 cells
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
RIM = 1.5  # spans of the finest level, beside the light: half of the support of a cubic function, less a half
STEEP = 0.1  # of the light, lost where it is bent: some 0.04 are where it meets a usual index at right angles


@dataclass(frozen=True, eq=False)
class TransportFit:
    """A sag with about the slopes of a transport map.

    asked : mm, the greatest |c| that the slopes ask for where there is light.
    cut : share of the coefficients that z_freedom cuts off.
    crosses : the sag within z_freedom would cross the front; it is scaled down.
    whole : the sag before any of this.
    """

    sag: THBSurface
    asked: float
    cut: float
    crosses: bool
    whole: THBSurface


class TransportStart:
    """Slopes of the rear, or of a front that alone is free, that send light without extent to the target.

    A Lambertian source is taken as a point in its centre.  `fit` gives the sag with these slopes in any THB
    space.  Where light is blurred, it is sent to the light that `optics.light.blur.aimed` aims at.

    bent : share of the light that a slope can send to where the map wants it

    most : cells of the map in each direction, at most.  rounds : as of `shaped_along`.
    """

    def __init__(
        self, system: System, backend: Backend, most: int = MOST_CELLS, rounds: int = MOST_ROUNDS
    ) -> None:
        system = aimed(spot_system(system, backend), backend).unshaped
        self._system, self._lens, self._backend = system, system.base, backend
        screen, receiver = system.goal.screen(), system.target.receiver
        self.lit, centre, self.half_lit = lit_part(system.goal.irradiance(screen, 1.0), screen, DARK)
        self._surface: FreeformSurface = getattr(system.base, system.shaped)
        self._most, self._cells = most, _cells(system, screen.pixels, most)
        nx, ny = (as_many_within(self._surface.outline, n) for n in self._cells)
        self._bound = INSIDE * system.freeforms[-1].freedom
        narrow = receiver.across_axis and not (receiver.far_field and max(self.half_lit) > WIDE)
        crosses, finest = system.target.settings.crossing, system.freeforms[-1].finest
        picture = Picture(np.ascontiguousarray(self.lit[::-1].T), centre, self.half_lit, crosses)
        path = system.path
        path = path if system.problem.optimizer.fresnel else path.without_reflection()
        if system.parallel and system.shaped == "rear" and narrow and not crosses:
            self._shaped = ParallelStart(system, backend, path, picture, (nx, ny)).shaped()
        else:
            self._shaped = shaped_along(
                backend, path, path.shaped, system.source, picture, (nx, ny), finest, rounds
            )
        self._light, self._slopes, self.bent = self._shaped.light, self._shaped.above, self._shaped.bent
        self._fits: dict[tuple[bytes, bytes, bytes], TransportFit] = {}

    @property
    def gap(self) -> float:
        """Relative gap of primal and dual of the transport map, see `Transport.gap`."""
        return self._shaped.transport.gap

    @property
    def steps(self) -> int:
        """Steps that the transport map took."""
        return self._shaped.transport.steps

    @cached_property
    def traced(self) -> TransportFit | None:
        """A fit that tells whether the sag is within its bounds; None where light is parallel before the
        surface."""
        if self._light.parallel:
            return None
        level = min(TRACED, self._system.freeforms[-1].finest)
        return self.fit(self._lens.sags[-1].space.uniform(level))

    def fit(self, space: THBSpace) -> TransportFit:
        """Return the sag in a THB space over x, y in mm; of one mesh it is made once.

        Coefficients beyond z_freedom are cut off there; the others still send their light where it belongs.
        A sag that then crosses the front is scaled down.  It moves the light a part of the distance.
        """
        mesh = space.kv_u.knots.tobytes(), space.kv_v.knots.tobytes(), space.functions.tobytes()
        if mesh not in self._fits:
            self._fits[mesh] = self._fitted(space)
        return self._fits[mesh]

    def _fitted(self, space: THBSpace) -> TransportFit:
        light, (zx, zy) = self._light, self._slopes
        sag = fit_slopes(space, light.x, light.y, zx, zy, light.weight)
        seen = seen_functions(space, light.x, light.y)
        size, crosses = np.abs(sag.coefficients[seen] if seen.any() else sag.coefficients), False
        kept = within_bound(sag, self._bound)
        for _ in range(HALVINGS):
            if self._clear(kept):
                break
            kept, crosses = THBSurface(space, kept.coefficients / 2), True
        cut = float(np.mean(size > self._bound))
        return TransportFit(kept, float(size.max()), cut, crosses, sag)

    def finest_fit(self) -> TransportFit:
        """Return the fit on the whole mesh of the last level, or of the last before it that is quick."""
        freeforms = self._system.freeforms
        level = min(max(f.finest for f in freeforms), _quick(freeforms[-1]))
        return self.fit(self._lens.sags[-1].space.uniform(level))

    def levelled(self, system: System) -> TransportStart:
        """Return the start of the system with levels where they were left to the program: this one, unless
        its map has too few cells for them."""
        known = copy(self)
        known._system = self._system.with_prescription(problem=system.problem)
        if _cells(known._system, known._system.goal.screen().pixels, self._most) == self._cells:
            return known
        return TransportStart(system, self._backend, self._most)

    def _clear(self, sag: THBSurface) -> bool:
        """Whether the lens with a sag can exist."""
        try:
            require_sound(_with_last(self._lens, sag))
        except ValueError:
            return False
        return True

    def misfit(self, sag: THBSurface) -> Floats:
        """Return the squared deviation of a sag's slopes from those of the map, summed over every leaf cell.

        It goes on over the rim beside the light: cells there are refined with their neighbours, so that all
        functions which meet the light are as fine as its cells.  Shape (n_cells,).
        """
        light, (zx, zy) = self._light, self._slopes
        off_x = sag.grid(light.x, light.y, (1, 0)) - zx
        off_y = sag.grid(light.x, light.y, (0, 1)) - zy
        squares, space, level = light.weight * (off_x**2 + off_y**2), sag.space, sag.space.levels - 1
        (x, beside_x), (y, beside_y) = (
            _with_rim(kv, row, level) for kv, row in ((space.kv_u, light.x), (space.kv_v, light.y))
        )
        return summed_over_cells(space, x, y, np.pad(squares, (beside_x, beside_y), mode="edge"))

    def rear_slopes(self) -> tuple[RearLight, list[Floats]]:
        """Return the light at the shaped surface, and the slopes (zx, zy) that all of it needs, (nx, ny)."""
        light, above, conic = self._light, self._slopes, self._surface.conic
        x, y = light.x[:, None], light.y[None, :]
        return light, [s + conic(x, y, d) for s, d in zip(above, ((1, 0), (0, 1)))]

    def lost(self, system: System) -> float:
        """Return the share of the light that the surface loses, see `lost_share`, to make its picture on a
        target that lies elsewhere; with what misses an element that is turned."""
        path, here = system.path, self._system.path
        number = path.shaped
        sides = zip(system.target.settings.half_width, self._system.target.settings.half_width)
        places = [new / old * a for (new, old), a in zip(sides, self._shaped.places)]
        made_up = self._shaped.made_up
        if np.array_equal(system.pose.rotation, self._system.pose.rotation):
            return lost_share(path, number, self._light, places, made_up)
        lights = [light_on(self._backend, p, number, system.source, (CELLS, CELLS)) for p in (here, path)]
        before, now = (float(light.flux.sum()) for light in lights)
        *at, share = stretched([*places, made_up], self._light, lights[1])
        turned = lost_share(path, number, lights[1], at, share)
        return 1 - now / before * (1 - turned)

    def level(self, least: int, finest: int) -> int:
        """Return the coarsest level, at least `least`, from which on another moves light by less than DETAIL
        (UNIFORM_DETAIL where uniform light is asked for).

        That is e |n - n'| throw in pixels, 2 n e throw where it reflects, with e^2 what another level takes
        off the mean square of the slopes' misfit.  Slopes that no surface has remain in all of them.
        """
        light, (zx, zy), target = self._light, self._slopes, self._system.target
        misfits = level_misfits(self._lens.sags[-1].space, light.x, light.y, zx, zy, light.weight, finest + 1)
        path = self._system.path
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

    def freedom(self, *fits: TransportFit) -> float:
        """Return the z_freedom, mm, that takes the whole sags of some fits, and that of `traced`."""
        return float(f"{ROOM * max(fit.asked for fit in self._with_traced(fits)) / INSIDE:.3g}")

    def overlap(self, *fits: TransportFit) -> float:
        """Return by how much front and rear would cross with that freedom, mm; negative where they do not."""
        bound = INSIDE * self.freedom(*fits)
        lenses = (_with_last(self._lens, within_bound(f.whole, bound)) for f in self._with_traced(fits))
        return max(-lens.least_thickness().lower for lens in lenses)

    def steep(self) -> bool:
        """Whether the surface of the map would lose so much light that more of its sag does not help."""
        return self.lost(self._system) > STEEP

    def helped(self, *fits: TransportFit) -> bool:
        """Whether `freedom` takes the sags of some fits, and of `traced`, whole, and z_freedom does not."""
        every = self._with_traced(fits)
        wide = max(fit.asked for fit in every) > max(self._surface.half_width)
        return not (all(map(self.within, every)) or self.steep() or self.overlap(*fits) >= 0 or wide)

    def note(self, *fits: TransportFit, remedies: Sequence[str] = ()) -> str:
        """Return a sentence on what helps where a design does not take the sags of some fits, or of `traced`,
        as they are, or "".

        remedies : options `--set KEY=VALUE` that help where no z_freedom does so alone.
        """
        if all(self.within(fit) for fit in self._with_traced(fits)):
            return ""
        problem, largest = self._system.problem, max(fit.asked for fit in self._with_traced(fits))
        optic, asked = problem.optic, f"the transport map asks for a sag of +-{largest:.3g} mm"
        one = len(self._system.freeforms) == 1 and not self._system.reflects
        shared = ", or let both surfaces bend it" * one
        options, gentler = " or ".join(remedies), problem.target.gentler
        flat = ", or --set optimizer.start=flat, which does without the map" * self._system.source.emitter
        if self.steep():
            return (
                f"{asked}, but no z_freedom helps, since so steep a surface would lose "
                f"{self.lost(self._system):.0%} of the light: {options or gentler}{shared}{flat}"
            )
        if self.overlap(*fits) >= 0:
            other = f"choose another {optic.key(self._system.shaped)}.radius, {gentler}{shared}"
            return f"{asked}, which would bring rear and front together: {options or other}{flat}"
        if largest > max(self._surface.half_width):
            wide = f"{asked}, more than the {optic.noun} is wide"
            return f"{wide}: are the units right, is the target within reach?"
        # beside the light more freedom than that may bring the surfaces together
        why = "more" if largest > self._bound else "less"
        return (
            f"{asked}, {why} than the {self._bound:.3g} mm of z_freedom that a start takes: for better light "
            f"--set {optic.key(self._system.shaped)}.freeform.z_freedom={self.freedom(*fits):g}{flat}"
        )

    def _with_traced(self, fits: Sequence[TransportFit]) -> list[TransportFit]:
        return [*fits, *([self.traced] if self.traced else [])]


def _cells(system: System, pixels: Sequence[int], most: int) -> list[int]:
    """Return the cells of a map in x and y: enough for pixels, and for a fit on the finest mesh, or on
    the coarsest that may be chosen.

    As many to each pixel, which keeps borders of light sharp (`examples/lamp_reflector.toml`, 128 rows: with
    320 cells the design's rel_l2 is 0.016, with 384 it is 0.009).
    """
    freeform = system.freeforms[-1]
    level = least_auto(freeform) if isinstance(freeform.max_level, str) else freeform.max_level
    cells = []
    for n, spans in zip(pixels, freeform.spans):
        of_pixel = max(CELLS_PER_PIXEL, ceil(CELLS_PER_SPAN * (spans << level) / n))
        cells.append(min(max(of_pixel * n, LEAST_CELLS), most))
    return cells


def least_auto(freeform: Freeform) -> int:
    """Return the coarsest level that max_level = "auto" stands for: a map has cells for its spans."""
    return min(LEAST_AUTO, _quick(freeform))


def _quick(freeform: Freeform) -> int:
    """Return the finest level, if any, of at most MOST_SPANS."""
    return max((MOST_SPANS // max(freeform.spans)).bit_length() - 1, 0)


def _with_rim(kv: KnotVector, samples: Floats, level: int) -> tuple[Floats, tuple[int, int]]:
    """Return samples that go on evenly over a rim of the domain, and how many there are before and behind."""
    spacing, width = samples[1] - samples[0], RIM * (kv.stop - kv.start) / (kv.spans << level)
    before, behind = (
        int(min(width, gap) / spacing) for gap in (samples[0] - kv.start, kv.stop - samples[-1])
    )
    return samples[0] + spacing * np.arange(-before, len(samples) + behind), (before, behind)


def within_bound(sag: THBSurface, bound: float) -> THBSurface:
    """Return a sag with its coefficients cut off at a bound, mm."""
    return THBSurface(sag.space, np.clip(sag.coefficients, -bound, bound))


def spot_system(system: System, backend: Backend) -> System:
    """Return the system with the lens whose blur stands for that of the design, before there is one.

    For a target across the axis this is the base lens, which sends light roughly there; otherwise it is the
    lens of a coarse map.
    """
    base = system.with_lens(system.base)
    if not system.blurred or system.target.receiver.across_axis:
        return base
    start = TransportStart(system.sharp, backend, SPOT_CELLS)
    return base.with_lens(_with_last(base.designed, start.fit(base.designed.sags[-1].space).sag))


def _with_last(lens: Lens, sag: THBSurface) -> Lens:
    """Return the lens with another sag on the last of its free surfaces."""
    return lens.with_sags([*lens.sags[:-1], sag])
