"""Rays: the one record of light on its way, and regular grids of parallel rays, which need no such record."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from thbcad.checks import Floats
from thbcad.lens import Lens
from thbcad.poses import Pose

BEFORE = 10  # sizes of the lens, from its front to where a beam starts: no front bends back so far
UNIT_LENGTH = 1e-9  # the greatest difference of a direction's length from 1


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays in air.

    origin : (3, n) float, mm.  direction : (3, n) float, unit vectors.  flux : (n,) float, W.
    `require_rays` checks the numbers.

    Raises ValueError : no rays, or wrong shapes.
    """

    origin: Floats
    direction: Floats
    flux: Floats

    def __post_init__(self) -> None:
        n = np.size(self.flux)
        if n == 0:
            raise ValueError("there must be at least one ray, got 0")
        for name, shape in (("origin", (3, n)), ("direction", (3, n)), ("flux", (n,))):
            values = np.asarray(getattr(self, name), dtype=np.float64)
            if values.shape != shape:
                raise ValueError(f"{name} must have the shape {shape}, got {values.shape}")
            object.__setattr__(self, name, values)

    @classmethod
    def joined(cls, parts: Sequence[Rays]) -> Rays:
        """Return the rays of all parts."""
        names = ("origin", "direction", "flux")
        return cls(*(np.concatenate([getattr(p, name) for p in parts], axis=-1) for name in names))

    @property
    def total(self) -> float:
        """Flux of all rays, W."""
        return float(self.flux.sum())

    def posed(self, pose: Pose) -> Rays:
        """Return the rays of a source that lies elsewhere."""
        if pose.is_identity:
            return self
        return Rays(pose.points(self.origin), pose.directions(self.direction), self.flux)

    def slices(self, most: int) -> Iterator[Rays]:
        """Yield rays, at most `most` at once, that make up these."""
        for start in range(0, len(self.flux), most):
            chosen = slice(start, start + most)
            yield Rays(self.origin[:, chosen], self.direction[:, chosen], self.flux[chosen])

    def thinned(self, count: int, offset: float) -> Rays:
        """Return `count` rays of equal flux, one from each of as many equal parts of the flux.

        Where there are no more they stay as they are.
        offset : of the chosen points in their parts, in [0, 1).
        """
        if count >= len(self.flux):
            return self
        ends = np.cumsum(self.flux)
        at = (np.arange(count) + offset) * (ends[-1] / count)
        chosen = np.minimum(np.searchsorted(ends, at, side="right"), len(ends) - 1)
        each = np.full(count, ends[-1] / count)
        return Rays(self.origin[:, chosen], self.direction[:, chosen], each)

    def dealt(self, hands: int) -> Iterator[Rays]:
        """Yield sets that make up all rays, each with the flux of all.

        Which set a ray falls to is drawn, so that sets differ as independent samples of the same light do.
        The draw is the same every time: all that is measured by the same set errs together.
        """
        total = self.flux.sum()
        drawn = np.random.default_rng(hands).permutation(len(self.flux))
        for k in range(hands):
            chosen = np.sort(drawn[k::hands])
            flux = self.flux[chosen]
            scaled = flux * (total / flux.sum()) if flux.any() else flux
            yield Rays(self.origin[:, chosen], self.direction[:, chosen], scaled)

    def rays(self, z: float) -> Rays:
        """Return these: they are one by one already, and start where they do, unlike those of a `RayGrid`."""
        return self


def require_rays(rays: Rays) -> None:
    """Check the numbers of rays that come from outside.

    Raises ValueError : numbers that are not finite, directions that are not of length 1, negative flux.
    """
    for name in ("origin", "direction", "flux"):
        if not np.isfinite(getattr(rays, name)).all():
            raise ValueError(f"{name} must be finite")
    length = np.linalg.norm(rays.direction, axis=0)
    off = np.abs(length - 1)
    if off.max() > UNIT_LENGTH:
        raise ValueError(f"direction must have length 1, got {length[off.argmax()]}")
    if rays.flux.min() < 0:
        raise ValueError(f"flux must not be negative, got {rays.flux.min()}")


@dataclass(frozen=True, eq=False)
class RayGrid:
    """Rays along +z at the points of the grid x times y.

    x : (nx,) float, mm.  y : (ny,) float, mm.  flux : (nx, ny) float, W.
    missed : W that passes beside the lens and has no rays.
    """

    x: Floats
    y: Floats
    flux: Floats
    missed: float = 0.0

    @property
    def total(self) -> float:
        """Flux of all rays, W."""
        return float(self.flux.sum())

    def slices(self, most: int) -> Iterator[RayGrid]:
        """Yield grids of at most `most` rays that make up this one."""
        step = max(1, most // len(self.y))
        for start in range(0, len(self.x), step):
            chosen = slice(start, start + step)
            yield RayGrid(self.x[chosen], self.y, self.flux[chosen], 0.0 if start else self.missed)

    def rays(self, z: float) -> Rays:
        """Return the rays one by one, y first, from the plane at z mm."""
        origin = np.empty((3, len(self.x), len(self.y)))
        origin[0], origin[1], origin[2] = self.x[:, None], self.y, z
        along = np.zeros((3, self.flux.size))
        along[2] = 1.0
        return Rays(origin.reshape(3, -1), along, self.flux.ravel())


def single_rays(rays: Rays | RayGrid, lens: Lens) -> Rays:
    """Return rays one by one; those of a grid start well before the lens."""
    return rays.rays(-BEFORE * (max(lens.front.half_width) + lens.thickness))
