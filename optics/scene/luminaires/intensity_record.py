"""The record of a luminaire: its intensity on a grid of angles C and gamma over the full sphere.

Seen along the light, from above for a luminaire that hangs, C grows counterclockwise (LM-63, CIE 121).  With
gamma = 0 along +z and C = 0 along +x a direction is

    d = (sin gamma cos C, -sin gamma sin C, cos gamma).

Between the angles of the grid the intensity is bilinear in C and gamma; beyond the first and the last gamma
it is zero.

Source: ANSI/IESNA LM-63-02, Standard file format for the electronic transfer of photometric data, 2002.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optics.base.runtime import UserError
from thbcad.checks import Floats, Integers

FULL_TURN, FARTHEST_GAMMA = 360.0, 180.0  # degrees
SAME = 1e-9  # of the peak: rounding errors of formulas at angles that are one, or mirror images


@dataclass(frozen=True)
class Opening:
    """Where the light of a luminaire leaves.

    size : mm along x and y; zeros are a point.  round : an ellipse with these axes, else a rectangle.

    Raises UserError : sizes that are not finite, or negative.
    """

    size: tuple[float, float] = (0.0, 0.0)
    round: bool = False

    def __post_init__(self) -> None:
        if not all(0 <= side < np.inf for side in self.size):
            raise UserError(f"the sizes of an opening must be finite and not negative, got {self.size} mm")


@dataclass(frozen=True, eq=False)
class Luminaire:
    """The intensity of a luminaire.

    planes : (k,) angles C, degrees, ascending from 0 to 360.  gammas : (m,), degrees, ascending in [0, 180].
    candela : (k, m), cd (or W/sr).  The last plane is the first again.
    opening : Opening.  lumens : rated flux of the lamps, lm; None where the photometry is absolute.

    Raises UserError : wrong shapes, numbers that are not finite or negative, angles that do not ascend or do
        not cover the full turn, no light at all.
    """

    planes: Floats
    gammas: Floats
    candela: Floats
    opening: Opening = Opening()
    lumens: float | None = None

    def __post_init__(self) -> None:
        for name, dimensions in (("planes", 1), ("gammas", 1), ("candela", 2)):
            array = np.ascontiguousarray(getattr(self, name), dtype=np.float64)
            if array.ndim != dimensions:
                raise UserError(f"{name} must have {dimensions} dimensions, got {array.ndim}")
            if bad := int((~np.isfinite(array)).sum()):
                raise UserError(f"{name} must be finite, got {bad} numbers that are not")
            object.__setattr__(self, name, array)
        wanted = len(self.planes), len(self.gammas)
        if self.candela.shape != wanted:
            raise UserError(f"candela must have the shape {wanted}, got {self.candela.shape}")
        require_ascending("planes C", self.planes)
        require_ascending("angles gamma", self.gammas)
        if self.planes[0] != 0 or self.planes[-1] != FULL_TURN:
            ends = f"{self.planes[0]:g} to {self.planes[-1]:g}"
            raise UserError(f"planes C must run from 0 to 360 degrees, got {ends}")
        if np.abs(self.candela[0] - self.candela[-1]).max() > SAME * np.abs(self.candela).max():
            raise UserError("the intensities at C = 0 and C = 360 must be the same")
        object.__setattr__(self, "candela", np.vstack([self.candela[:-1], self.candela[:1]]))
        if self.gammas[0] < 0 or self.gammas[-1] > FARTHEST_GAMMA:
            ends = f"{self.gammas[0]:g} to {self.gammas[-1]:g}"
            raise UserError(f"angles gamma must lie between 0 and 180 degrees, got {ends}")
        if self.candela.min() < 0:
            raise UserError(f"intensities must not be negative, got {self.candela.min():g} cd")
        if not 0 < self.flux < np.inf:
            raise UserError(f"the flux of a luminaire must be finite and greater than 0, got {self.flux:g}")

    @cached_property
    def node_solid_angles(self) -> Floats:
        """The integrals over the sphere of the functions that are 1 at one node of the grid, (k, m) sr."""
        return np.outer(interval_halves(np.radians(self.planes)), hat_integrals(np.radians(self.gammas)))

    @property
    def flux(self) -> float:
        """The integral of the intensity over the sphere, exact for the interpolation: lm (or W)."""
        return float((self.candela * self.node_solid_angles).sum())

    @cached_property
    def symmetric(self) -> bool:
        """Whether the light is its own mirror image in x and in y."""
        c, gamma = (a.ravel() for a in np.meshgrid(self.planes, self.gammas, indexing="ij"))
        images = [self.at(turned, gamma).reshape(self.candela.shape) for turned in (-c, 180 - c)]
        return bool(max(np.abs(image - self.candela).max() for image in images) <= SAME * self.candela.max())

    def flux_within(self, gamma: float) -> float:
        """Return the part of the flux in directions of less than an angle gamma, degrees."""
        nodes = np.union1d(self.gammas, np.clip(gamma, self.gammas[0], self.gammas[-1]))
        at = np.stack([np.interp(nodes, self.gammas, row) for row in self.candela])
        kept = int(np.searchsorted(nodes, gamma, side="right"))
        if kept < 2:
            return 0.0
        weights = np.outer(interval_halves(np.radians(self.planes)), hat_integrals(np.radians(nodes[:kept])))
        return float((at[:, :kept] * weights).sum())

    def intensity(self, direction: Floats) -> Floats:
        """Return the intensity in directions, (n,) cd.  direction : (3, n), of any length but zero."""
        return self.at(*angles_of(direction))

    def at(self, c: Floats, gamma: Floats) -> Floats:
        """Return the intensity at angles C and gamma, degrees, (n,) cd."""
        i, s = _position(self.planes, np.mod(c, FULL_TURN))
        j, t = _position(self.gammas, np.asarray(gamma))
        inside = (gamma >= self.gammas[0]) & (gamma <= self.gammas[-1])
        low = (1 - t) * self.candela[i, j] + t * self.candela[i, j + 1]
        high = (1 - t) * self.candela[i + 1, j] + t * self.candela[i + 1, j + 1]
        return np.where(inside, (1 - s) * low + s * high, 0.0)


def directions_at(c: Floats, gamma: Floats) -> Floats:
    """Return the unit vectors at angles C and gamma, degrees, (3, n)."""
    turn, tilt = np.radians(c), np.radians(gamma)
    sine = np.sin(tilt)
    return np.stack([sine * np.cos(turn), -sine * np.sin(turn), np.cos(tilt)])


def angles_of(direction: Floats) -> tuple[Floats, Floats]:
    """Return the angles C in [0, 360] and gamma of directions (3, n), degrees."""
    x, y, z = direction
    return np.degrees(np.arctan2(-y, x)) % FULL_TURN, np.degrees(np.arctan2(np.hypot(x, y), z))


def hat_integrals(gammas: Floats) -> Floats:
    """Return the integrals of h(gamma) sin(gamma) for the piecewise linear h that are 1 at one angle, (m,).

    With the middle c and half the width d of an interval they are
    sin(c) sin(d) +- cos(c) (sin(d) / d - cos(d)) for the rising and the falling half of a hat.
    """
    c, d = (gammas[1:] + gammas[:-1]) / 2, np.diff(gammas) / 2
    even, odd = np.sin(c) * np.sin(d), np.cos(c) * (np.sin(d) / d - np.cos(d))
    return np.append(even - odd, 0.0) + np.append(0.0, even + odd)


def interval_halves(values: Floats) -> Floats:
    """Return half the lengths of the intervals at every one of ascending values: the trapezoidal rule."""
    halves = np.diff(values) / 2
    return np.append(halves, 0.0) + np.append(0.0, halves)


def require_ascending(name: str, values: Floats) -> None:
    """Raise UserError unless there are two angles at least, and each is greater than the one before."""
    if len(values) < 2:
        raise UserError(f"there must be at least two {name}, got {len(values)}")
    falls = np.flatnonzero(np.diff(values) <= 0)
    if len(falls):
        a, b = values[falls[0] : falls[0] + 2]
        raise UserError(f"{name} must ascend, got {b:g} after {a:g} degrees")


def _position(nodes: Floats, values: Floats) -> tuple[Integers, Floats]:
    """Return the interval in which values lie, and the position in it from 0 to 1."""
    k = np.clip(np.searchsorted(nodes, values, side="right") - 1, 0, len(nodes) - 2)
    return k, np.clip((values - nodes[k]) / (nodes[k + 1] - nodes[k]), 0.0, 1.0)
