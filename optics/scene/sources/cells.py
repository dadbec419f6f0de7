"""Cells of a source of two parameters: a grid of rays at their corners, and the flux of each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import ceil, cos, prod, radians, sqrt

import numpy as np

from optics.scene.sources.collimated import lit_part
from optics.scene.sources.profile import UNIFORM, Profile
from optics.scene.sources.rays import BEFORE, RayGrid, Rays
from optics.scene.sources.spreading import concentric
from thbcad.checks import Bools, Floats

AXIS = 0.0, 0.0
# rings of cells, and of all of a small cone: behind ring n what is not straight is 0.1 / n^2 of their flux
INNERMOST, INNER = 16, 4


@dataclass(frozen=True, eq=False)
class SourceCells:
    """A source cut into a grid of cells over its two parameters s, t.

    s : (nx + 1,), t : (ny + 1,) float, borders of the cells.  emitted : (nx, ny) W.
    at : called with s, t and flux, (n,) each; returns the Rays there.
    density : called with s and t, (n,) each; returns the flux per area of s and t there, up to a factor.
    parallel : the rays go along +z and s, t are x, y in mm.  missed : W that passes beside the lens.
    kinked : the rays have kinks on |s| = |t|, which are diagonals of cells.
    """

    s: Floats
    t: Floats
    emitted: Floats
    at: Callable[[Floats, Floats, Floats], Rays]
    density: Callable[[Floats, Floats], Floats]
    parallel: bool = False
    missed: float = 0.0
    kinked: bool = False

    @property
    def turned(self) -> Bools | None:
        """Which cells may have a kink along their other diagonal, where s + t is the same; None is none."""
        return self.turned_at(self.s[1:, None] + self.s[:-1, None], self.t[1:] + self.t[:-1])

    def turned_at(self, s: Floats, t: Floats) -> Bools | None:
        """Return what `turned` says of cells around points, or around multiples of these."""
        return s * t < 0 if self.kinked else None

    def rays(self) -> RayGrid | Rays:
        """Return the rays at the corners; each carries a quarter of the flux of the cells around it."""
        flux = corner_flux(self.emitted)
        if self.parallel:
            return RayGrid(self.s, self.t, flux, self.missed)
        s, t = (a.ravel() for a in np.meshgrid(self.s, self.t, indexing="ij"))
        return self.at(s, t, flux.ravel())

    def half(self, axes: Sequence[int]) -> SourceCells:
        """Return the cells with s >= 0 (axis 0) and t >= 0 (axis 1) of an even number of cells there."""
        i, j = (n // 2 if axis in axes else 0 for axis, n in enumerate(self.emitted.shape))
        return replace(self, s=self.s[i:], t=self.t[j:], emitted=self.emitted[i:, j:])

    def slices(self, most: int) -> Iterator[SourceCells]:
        """Yield strips of about `most` corners that make up these cells."""
        step = max(1, most // len(self.t) - 1)
        for start in range(0, len(self.s) - 1, step):
            yield replace(
                self,
                s=self.s[start : start + step + 1],
                emitted=self.emitted[start : start + step],
                missed=0.0 if start else self.missed,
            )


def corner_flux(emitted: Floats) -> Floats:
    """Return the flux that the corners of cells stand for, (nx + 1, ny + 1): quarters of the cells around."""
    quarters = np.pad(emitted / 4, 1)
    return quarters[1:, 1:] + quarters[1:, :-1] + quarters[:-1, 1:] + quarters[:-1, :-1]


def beam_cells(
    half_width: Sequence[float],
    flux: float,
    aperture: Sequence[float],
    counts: Sequence[int],
    profile: Profile = UNIFORM,
    centre: Sequence[float] = AXIS,
) -> SourceCells:
    """Return the cells of a beam along +z, as far as it meets an aperture; s and t are x and y in mm.

    half_width : of the source, mm.  aperture, centre : as of `lit_part`, mm.  counts : (nx, ny) cells.
    """
    middles, lit = lit_part(half_width, aperture, centre)
    before, along = BEFORE * 2 * max(aperture), np.array([0.0, 0.0, 1.0])
    cells = tilted_cells(half_width, before, flux, along, counts, profile, (middles, lit))
    missed = flux - float(cells.emitted.sum()) if lit != list(half_width) else 0.0
    return replace(cells, parallel=True, missed=missed)


def tilted_cells(
    half_width: Sequence[float],
    distance: float,
    flux: float,
    direction: Floats,
    counts: Sequence[int],
    profile: Profile,
    part: tuple[Sequence[float], Sequence[float]] | None = None,
) -> SourceCells:
    """Return the cells of an area in the plane z = -distance that shines in one direction.

    s and t are x and y in mm.

    half_width : mm.  direction : (3,) unit vector.  counts : (nx, ny) cells.
    part : middle and half-widths of the part that has cells, mm; None is all.
    """
    x, y = (m + h * (2 * np.arange(n + 1) / n - 1) for m, h, n in zip(*(part or (AXIS, half_width)), counts))
    emitted = flux * profile.shares(x / half_width[0], y / half_width[1])

    def at(x: Floats, y: Floats, flux: Floats) -> Rays:
        along = np.repeat(direction[:, None], len(x), axis=1)
        return Rays(np.stack([x, y, np.full_like(x, -distance)]), along, flux)

    def density(x: Floats, y: Floats) -> Floats:
        return profile(x / half_width[0], y / half_width[1])

    return SourceCells(x, y, emitted, at, density)


def cone_cells(
    distance: float, flux: float, half_angle: float, exponent: float, counts: Sequence[int]
) -> SourceCells:
    """Return the cells of a point's cone with intensity ~ cos(theta)^exponent.

    s and t are coordinates in the square [-1, 1]^2 that `concentric` maps to the cone, equal solid angles to
    equal areas.  1 - cos(theta) is in proportion to max(|s|, |t|)^2 there.  The map has kinks on |s| = |t|.
    They are diagonals of cells, as these are an even number, the same in both directions.

    distance : mm, of the point before z = 0.  half_angle : degrees.
    counts : (nx, ny) cells, about: no fewer in all.
    """
    side = 2 * ceil(sqrt(prod(counts)) / 2)
    s = 2 * np.arange(side + 1) / side - 1
    deepest = 1 - cos(radians(half_angle))

    def density(s: Floats, t: Floats) -> Floats:
        return (1 - deepest * np.maximum(np.abs(s), np.abs(t)) ** 2) ** exponent

    emitted = _of_quarter(density, s[side // 2 :])
    emitted = np.block([[emitted[::-1, ::-1], emitted[::-1]], [emitted[:, ::-1], emitted]])
    emitted *= flux / emitted.sum()

    def at(s: Floats, t: Floats, flux: Floats) -> Rays:
        p, q = concentric(s, t)
        depth = deepest * (p * p + q * q)
        stretch = np.sqrt((2 - depth) * deepest)
        direction = np.stack([p * stretch, q * stretch, 1 - depth])
        origin = np.zeros_like(direction)
        origin[2] = -distance
        return Rays(origin, direction, flux)

    return SourceCells(s, s, emitted, at, density, kinked=True)


def _of_quarter(density: Callable[[Floats, Floats], Floats], s: Floats) -> Floats:
    """Return the flux of cells with s, t >= 0 of a cone, up to a factor, (n, n) from the middle outwards.

    max(s, t) alone tells the density, so that the cells of a ring are alike but for the one on the diagonal:
    of this, the part u of the width from its inner border on has the weight 2 u.

    s : (n + 1,) borders of the cells, in both directions.
    """
    inside, thirds = sqrt(3 / 5), np.array([5.0, 8.0, 5.0]) / 18  # three points of Gauss
    u = (1 + np.array([[-inside], [0.0], [inside]])) / 2
    of_ring = density((1 - u) * s[:-1] + u * s[1:], np.zeros(1))
    k = np.arange(len(s) - 1)
    emitted = (thirds @ of_ring)[np.maximum.outer(k, k)]
    np.fill_diagonal(emitted, thirds @ (2 * u * of_ring))
    return _with_straight_edges(emitted, s)


def _with_straight_edges(emitted: Floats, s: Floats) -> Floats:
    """Return the flux of cells by their areas with straight edges on the disk, as `_of_quarter`.

    What `concentric` makes of the cells around the middle is round.  Traced corners leave out a tenth of it,
    which other cells cover.  The flux of the INNERMOST rings together stays.
    """
    rings = max(1, min(INNERMOST, len(s) // INNER))
    p, q = concentric(*np.meshgrid(s[: rings + 1], s[: rings + 1], indexing="ij"))
    # areas by their diagonals
    (p1, p2), (q1, q2) = ((v[1:, 1:] - v[:-1, :-1], v[:-1, 1:] - v[1:, :-1]) for v in (p, q))
    inner, out = emitted[:rings, :rings], emitted.copy()
    straight = inner * (p1 * q2 - q1 * p2)
    out[:rings, :rings] = straight * (inner.sum() / straight.sum())
    return out
