"""Light of a point by stereographic coordinates, and a far field in them: classes of a script's own.

The unit vector (x, y, z) has the coordinates (u, v) = (x, y) / (1 + z), so that

    (x, y, z) = (2 u, 2 v, 1 - w) / (1 + w),    w = u^2 + v^2,    d Omega = 4 du dv / (1 + w)^2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from math import atan, degrees, sqrt
from types import ModuleType
from typing import Any

import numpy as np

from optics.scene.receivers import DEGREES, Receiver, Triple
from optics.scene.sources import LightSource, Rays, SourceCells, concentric
from thbcad.certified import DIRECTIONS, Stack
from thbcad.checks import Floats
from thbcad.poses import Pose

NODES = 3  # of Gauss-Legendre in a cell, in each direction
BACKWARD = Pose(np.diag([1.0, -1.0, -1.0]), np.zeros(3))  # of light that a mirror sends back along -z
AXIS = 0.0, 0.0
ALL = 1 << 62  # rays at once


def unit_vectors(u: Any, v: Any) -> Triple:
    """Return the directions with these coordinates."""
    w = u * u + v * v
    return 2 * u / (1 + w), 2 * v / (1 + w), (1 - w) / (1 + w)


@dataclass(frozen=True, eq=False, kw_only=True)
class StereographicPoint(LightSource):
    """A point of the same intensity in all directions of the square |u|, |v| <= half, or of a disk.

    half : half-width of the square, or radius of the disk.
    """

    half: float
    round: bool = False

    @property
    def cone(self) -> float:
        return degrees(2 * atan(self.half * (1 if self.round else sqrt(2))))

    def envelope(self) -> tuple[Stack, float]:
        return Stack(np.array([-self.distance]), np.zeros((1, len(DIRECTIONS)))), self.cone

    def cells(
        self,
        counts: Sequence[int],
        aperture: Sequence[float] | None = None,
        centre: Sequence[float] = AXIS,
        direction: Floats | None = None,
    ) -> SourceCells:
        """See `LightSource`; s and t run from -1 to 1, on a disk as `concentric` says."""
        s, t = (2 * np.arange(n + 1) / n - 1 for n in counts)
        emitted = np.zeros((counts[0], counts[1]))
        nodes = list(zip(*np.polynomial.legendre.leggauss(NODES)))
        for a, by_a in nodes:
            for b, by_b in nodes:
                at = [(r[:-1] + r[1:] + w * (r[1:] - r[:-1])) / 2 for r, w in ((s, a), (t, b))]
                emitted += by_a * by_b * self._density(at[0][:, None], at[1][None, :])
        return SourceCells(s, t, emitted * (self.flux / emitted.sum()), self._rays, self._density)

    def parts(
        self,
        counts: Sequence[int],
        fresh: np.random.Generator | None = None,
        most: int = ALL,
        aperture: Sequence[float] | None = None,
        centre: Sequence[float] = AXIS,
    ) -> Iterator[Rays]:
        shift = [0.0, 0.0] if fresh is None else fresh.uniform(-1, 1, 2)
        s, t = ((2 * np.arange(n) + 1 + k) / n - 1 for n, k in zip(counts, shift))
        s, t = (a.ravel() for a in np.meshgrid(s, t, indexing="ij"))
        yield from self._rays(s, t, self.cells(counts).emitted.ravel()).slices(most)

    def toward(self, u: Floats, v: Floats) -> Rays:
        """Return rays of the same flux in these directions."""
        direction = np.stack(unit_vectors(u, v))
        origin = np.zeros_like(direction)
        origin[2] = -self.distance
        flux = np.full(len(u), self.flux / len(u))
        return Rays(origin, direction / np.linalg.norm(direction, axis=0), flux)

    def _density(self, s: Floats, t: Floats) -> Floats:
        w = np.maximum(np.abs(s), np.abs(t)) ** 2 if self.round else s * s + t * t
        return 1 / (1 + self.half**2 * w) ** 2

    def _rays(self, s: Floats, t: Floats, flux: Floats) -> Rays:
        return replace(
            self.toward(*(self.half * a for a in (concentric(s, t) if self.round else (s, t)))), flux=flux
        )


@dataclass(frozen=True, eq=False)
class Stereographic(Receiver):
    """All directions but that along -z of its frame, by their coordinates.

    per_solid_angle : pictures are light per solid angle; else per area of the chart.
    """

    per_solid_angle: bool = field(default=True, kw_only=True)

    unit = "1"
    area_unit = "square degrees"
    far_field = True

    def _chart(
        self, point: Triple, direction: Triple, library: ModuleType, number: Callable[[float], Any]
    ) -> tuple[Any, Any, Any, Any]:
        p, q, r = direction
        return p / (1 + r), q / (1 + r), 0.0, True

    def points(self, u: Any, v: Any) -> Any:
        return self.pose.points(unit_vectors(u, v))

    def toward(self, point: Triple, u: Any, v: Any) -> Any:
        return self.pose.directions(unit_vectors(u, v))

    def normal(self, u: Any, v: Any) -> Any:
        return self.toward((0.0, 0.0, 0.0), u, v)

    def area(self, u: Any, v: Any) -> Any:
        solid = 4 / (1 + u * u + v * v) ** 2
        return DEGREES**2 * (solid if self.per_solid_angle else np.ones_like(solid))
