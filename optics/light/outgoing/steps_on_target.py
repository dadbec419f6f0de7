"""What the steps of a luminaire file do to the light on the target.

A file gives the light smoothed over one step of its angles, and interpolates it.  Light that is known on the
target is sent through the same grid: seen from the middle of the rear, at the distance d and under the angle
i of incidence, an intensity I makes E = I cos(i) / d^2; in the far field E is I itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil

import numpy as np

from optics.light.analysis import rel_l2, uniformity_of_pixels
from optics.scene.luminaires import IntensityGrid, Luminaire, Opening, directions_at
from optics.scene.receivers import Receiver
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.lens import Lens
from thbcad.poses import Pose

POINTS = 4  # of a pixel each way, and of a step at least
FINE = 0.25  # degrees: between points of gamma at most; pixels are no finer as a rule


@dataclass(frozen=True)
class OnTarget:
    """Light on the target beside that of the lens.

    rel_l2 : of both, scaled to one mean.  min_over_mean : U0 on boxes, None of a picture.
    """

    rel_l2: float
    min_over_mean: float | None


@dataclass(frozen=True, eq=False)
class StepsOnTarget:
    """The light of a lens on its target, and what luminaires make of it.

    light : on the target's pixels, (rows, columns); only its ratios count.
    blur : see `optics.light.blur.spot_rms`, for U0.
    """

    system: System
    light: Floats
    blur: float = 0.0

    @property
    def lens(self) -> Lens:
        return self.system.designed

    @property
    def own(self) -> OnTarget:
        """The light of the lens itself."""
        return self._beside(self.light)

    def by_file(self, luminaire: Luminaire) -> OnTarget:
        """Return the light that a luminaire makes, as of a point in the middle of the rear."""
        return self._beside(self._relit(luminaire))

    def by_steps(self, step: float) -> OnTarget:
        """Return the light of the lens, smoothed and interpolated as a file of a step does, without noise."""
        grid = IntensityGrid(round(180 / step), round(180 / step))
        points = grid.tilts * max(POINTS, ceil(step / FINE))
        middles = (np.arange(points) + 0.5) / points
        c, gamma = (a.ravel() for a in np.meshgrid(360 * middles, 180 * middles[: points // 2]))
        direction = directions_at(c, gamma)
        solid = np.sin(np.radians(gamma)) * 2 * (np.pi / points) ** 2
        screen = self.system.target.screen()
        landed = self._receiver.land((0.0, 0.0, 0.0), direction)
        x, y = landed.u, landed.v
        dilution = self._dilution(x, y)
        maps = screen.pixel_map()
        column, row = (np.floor(p * maps[k][0] + maps[k][1] - screen.margin) for k, p in enumerate((x, y)))
        rows, columns = self.light.shape
        on = landed.met & (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        intensity = np.zeros(x.size)
        # noise may leave less than no light
        intensity[on] = (
            np.maximum(self.light[row[on].astype(int), column[on].astype(int)], 0.0) / dilution[on]
        )
        flux = grid.flux(direction, intensity * solid)
        return self._beside(self._relit(grid.luminaire(flux, Opening())))

    def _beside(self, light: Floats) -> OnTarget:
        least = None
        if self.system.target.uniform_region is not None:
            screen = self.system.target.screen()
            least = uniformity_of_pixels(self.system, light, screen, self.blur).min_over_mean
        return OnTarget(rel_l2(light, self.light), least)

    def _relit(self, luminaire: Luminaire) -> Floats:
        """Return the mean light on every pixel."""
        (direction, dilution), (rows, columns) = self._points, self.light.shape
        values = luminaire.intensity(direction) * dilution
        return np.asarray(values.reshape(rows, POINTS, columns, POINTS).mean(axis=(1, 3)))

    @cached_property
    def _points(self) -> tuple[Floats, Floats]:
        """Directions to the points of all pixels, (3, n), and E / I there, (n,)."""
        screen = self.system.target.screen().finer(POINTS)
        x, y = (a.ravel() for a in np.meshgrid(*screen.centres))
        direction = np.stack(np.broadcast_arrays(*self._receiver.toward((0.0, 0.0, 0.0), x, y)))
        return direction, self._dilution(x, y)

    def _dilution(self, u: Floats, v: Floats) -> Floats:
        """Return E / I at points of the target, (n,)."""
        if self._receiver.far_field:
            return np.ones(u.size)
        ways, normals = (
            np.stack(np.broadcast_arrays(*f(u, v))) for f in (self._receiver.points, self._receiver.normal)
        )
        distance = np.linalg.norm(ways, axis=0)
        return np.maximum((ways * normals).sum(axis=0), 0.0) / distance**3

    @property
    def _receiver(self) -> Receiver:
        """The target as seen from the middle of the rear."""
        return self.system.target.receiver.seen_from(Pose.at((0.0, 0.0, self.lens.thickness)))
