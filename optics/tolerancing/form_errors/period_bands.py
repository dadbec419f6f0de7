"""What height errors of each band of period cost, and where on the lens, by the local formula in expectation.

A wave dh = a sin(k . u) of random phase on the surface changes the light at a place of the lens by

    <(dE / E)^2> = a^2 / 2 ((k' A k)^2 + |(M k) . grad ln E|^2) MTF(f)^2,      A = U DT^-1 M,

the curvature and the transport term, which are a quarter period apart, times what pixels leave of the
frequency f that the wave has on the target.  E and DT are those that pixels see; grad E is the rms of the
steps to the pixels on both sides.  In a band the mean over directions and octaves is taken.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import cos, pi, sin, sqrt

import numpy as np
from scipy.ndimage import map_coordinates

from optics.tolerancing.form_errors.local_formula import Floats, LocalFormula, middles, solved
from optics.tolerancing.perturbations import shortest_period

Band = tuple[float, float]

EDGES = (0.5, 1.0, 2.0, 5.0, 10.0, 25.0)  # mm: from the marks of a tool to the figure of a polisher
LEAST_RATIO = 1.5  # of the longest periods' band
DIRECTIONS, PERIODS = 8, 4  # of waves in a band: twice as many change norms by less than 1 %
MAP_CELLS = 128  # of the lens in each direction, that a map shows: single cells of a finer trace
DARK = 1e-3  # of the mean irradiance: below it pixels do not count


def period_bands_of(half_width: tuple[float, float]) -> list[Band]:
    """Return the bands of period, mm, up to the width of an aperture.  half_width : of it, mm.

    Those that are too short for a random field over it are left out.
    """
    widest, shortest = 2 * max(half_width), shortest_period(half_width)
    edges = [edge for edge in EDGES if edge >= shortest and LEAST_RATIO * edge < widest] or [widest / 2]
    return list(pairwise([*edges, widest]))


@dataclass(frozen=True, eq=False)
class BandChange:
    """What a band does to the light, per mm of the error's rms, in the mean over random phases.

    relative : rms of dE / E, (nx, ny) 1/mm, on `BandFormula.points`.
    norm : |dE| / |E| over the target, 1/mm; in the far field of intensities.
    curvature : the part of the curvature term in norm^2.  mtf : what pixels leave, rms over the light.
    worst : norm of the worst single wave of the band, in that of the band.
    """

    relative: Floats
    norm: float
    curvature: float
    mtf: float
    worst: float


@dataclass(frozen=True, eq=False)
class BandFormula:
    """The local formula of a lens for waves of any period."""

    formula: LocalFormula

    def change(self, band: Band) -> BandChange:
        """Return the BandChange of a band of period, mm."""
        terms = [self._terms(wave) for wave in _waves(band)]
        curvature, transport, seen = np.mean(terms, axis=0)
        light = self.flux * self._irradiance / self._at(self.formula.shown) ** 2
        bent, carried = float((light * curvature).sum()), float((light * transport).sum())
        single = (float((light * sum(self._terms(wave)[:2])).sum()) for wave in _waves(band, outer=True))
        return BandChange(
            relative=np.sqrt(curvature + transport),
            norm=sqrt((bent + carried) / light.sum()),
            curvature=bent / (bent + carried),
            mtf=sqrt((self.flux * seen).sum() / self.flux.sum()),
            worst=sqrt(max(1.0, max(single) / (bent + carried))),
        )

    def _terms(self, wave: tuple[float, float]) -> tuple[Floats, Floats, Floats]:
        """Return the curvature and the transport term of a wave, and what pixels leave, (nx, ny) each."""
        landing, surface, slope, second = self._fields
        by_x, by_y = self._steps
        kx, ky = (2 * pi * w for w in wave)
        in_phase = kx * kx * second[0, 0] + kx * ky * (second[0, 1] + second[1, 0]) + ky * ky * second[1, 1]
        along_x, along_y = (kx * row[0] + ky * row[1] for row in slope)
        passed = pixel_mtf(on_target(wave, landing, surface), self.formula.screen.pitch) ** 2
        bend, carry = in_phase**2 * passed, ((along_x * by_x) ** 2 + (along_y * by_y) ** 2) * passed
        return np.nan_to_num(bend), np.nan_to_num(carry), np.nan_to_num(passed)

    @cached_property
    def points(self) -> Floats:
        """x and y of the surface at the cells of a map, (2, nx, ny) mm."""
        return self._sparse(middles(self.formula.points))

    @cached_property
    def flux(self) -> Floats:
        """What arrives of the cells of a map, W."""
        formula = self.formula
        return self._sparse(formula.trace.cells.emitted * middles(formula.nominal.passing))

    @cached_property
    def _landing(self) -> Floats:
        return self._sparse(middles(self.formula.nominal.landing))

    @cached_property
    def _irradiance(self) -> Floats:
        """That of the pixel where the light of each cell lands."""
        image = self.formula.irradiance
        return np.maximum(self._at(image), DARK * image.mean())

    @cached_property
    def _fields(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Return DT, U, M and A on the cells of a map."""
        formula = self.formula
        landing = self._sparse(formula.seen)
        surface, slope = (self._sparse(middles(a)) for a in (formula.surface, formula.by_slope))
        back = np.stack([solved(landing, slope[:, j]) for j in (0, 1)], axis=1)
        second = np.einsum("kiab,ijab->kjab", surface, back)
        return landing, surface, slope, second

    @cached_property
    def _steps(self) -> tuple[Floats, Floats]:
        """Return the rms of grad ln E by x and y on the cells of a map."""
        image, pitch = self.formula.irradiance, self.formula.screen.pitch
        by_x, by_y = (
            np.sqrt(_both_sides(np.square(np.diff(image, axis=axis)), axis)) / width
            for axis, width in ((1, pitch[0]), (0, pitch[1]))
        )
        return self._at(by_x) / self._irradiance, self._at(by_y) / self._irradiance

    def _at(self, image: Floats) -> Floats:
        """Return an image where the light of each cell lands."""
        maps = self.formula.screen.pixel_map()
        column, row = (np.nan_to_num(s * a + o - 0.5) for a, (s, o) in zip(self._landing, maps))
        return np.asarray(map_coordinates(image, [row, column], order=1, mode="nearest"))

    def _sparse(self, values: Floats) -> Floats:
        """Return every so manieth cell, as a map shows them."""
        by_s, by_t = (max(1, n // MAP_CELLS) for n in values.shape[-2:])
        return np.asarray(values[..., by_s // 2 :: by_s, by_t // 2 :: by_t])


def seen_by_cells(band: Band, cell: tuple[float, float]) -> float:
    """Return what cells leave of the curvature term of a band, rms over its waves.

    Corners are moved exactly, and between them linearly: the derivatives along the sides of a cell are
    differences over it, and means over its other sides,

        sinc(fx cx) cos(pi fy cy)        sinc(fy cy) cos(pi fx cx).

    cell : (cx, cy), its sides on the surface, mm.
    """
    (cx, cy), squares = cell, []
    for fx, fy in _waves(band):
        by_x, by_y = np.sinc(fx * cx) * cos(pi * fy * cy), np.sinc(fy * cy) * cos(pi * fx * cx)
        squares.append(((fx**2 * by_x + fy**2 * by_y) / (fx**2 + fy**2)) ** 2)
    return sqrt(np.mean(squares))


def _waves(band: Band, outer: bool = False) -> Iterator[tuple[float, float]]:
    """Yield waves (fx, fy) of a band, cycles per mm, at equal steps in direction and in the octave.

    outer : from end to end of the band, and along the axes too; else amid the steps.
    """
    amid = 0.0 if outer else 0.5
    for i in range(PERIODS + outer):
        period = band[0] * (band[1] / band[0]) ** ((i + amid) / PERIODS)
        for j in range(DIRECTIONS):
            direction = pi * (j + amid) / DIRECTIONS
            yield cos(direction) / period, sin(direction) / period


def _both_sides(between: Floats, axis: int) -> Floats:
    """Return at pixels the mean of what lies between them and their two neighbours; one at borders."""
    ends = [np.take(between, [k], axis=axis) for k in (0, -1)]
    before, after = np.concatenate([ends[0], between], axis), np.concatenate([between, ends[1]], axis)
    return (before + after) / 2


def pixel_mtf(frequency: Sequence[Floats] | Floats, pitch: tuple[float, float]) -> Floats:
    """Return what the mean over a pixel leaves of a wave on the target, sinc(fx px) sinc(fy py).

    frequency : (fx, fy), cycles per mm or degree.  pitch : (px, py) of the pixels, in the same unit.
    """
    fx, fy = frequency
    return np.asarray(np.sinc(fx * pitch[0]) * np.sinc(fy * pitch[1]))


def on_target(waves: Sequence[float], landing: Floats, surface: Floats) -> Floats:
    """Return the local frequency on the target of a wave on the surface, (2, ...).

    f = DT^-T U^T k, with the maps T to the target and U to the surface: the wave's phase is the same.

    waves : (kx, ky) on the surface, cycles per mm.  landing : DT, surface : U, (2, 2, ...).
    """
    by_source = np.stack([surface[0, i] * waves[0] + surface[1, i] * waves[1] for i in (0, 1)])
    return solved(np.swapaxes(landing, 0, 1), by_source)
