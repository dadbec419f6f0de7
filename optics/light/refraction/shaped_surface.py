"""A surface that is looked for, anywhere on a light path: the slopes that send light where it is wanted.

By the laws of refraction and of reflection the normal (-z_x, -z_y, 1) of a surface z(x, y) lies along

    m = n a - n' d

for light of unit direction a in index n that goes on along d in index n'; n' = n for a mirror.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from optics.light.refraction.rest_of_path import RestOfPath, bent
from optics.scene.paths import LightPath
from optics.scene.receivers import Triple
from thbcad.checks import Bools, Floats

LEAST_Z = 0.15  # of the unit normal: steeper slopes are not asked for


@dataclass(frozen=True, eq=False)
class ShapedSurface:
    """A surface of a path, in its own frame.

    mirror : it reflects.  indices : n before it and n' behind.  rest : what light meets then.
    """

    mirror: bool
    indices: tuple[float, float]
    rest: RestOfPath

    @classmethod
    def of(cls, path: LightPath, surface: int) -> ShapedSurface:
        """Return a surface of a path, by its number."""
        shaped = path.surfaces[surface]
        before, behind = (medium.index for medium in path.media[surface : surface + 2])
        return cls(shaped.kind == "reflect", (before, behind), RestOfPath.behind(path, surface))

    def slopes(
        self, points: Triple, along: Triple, wanted: Triple, near: Sequence[Floats] | None = None
    ) -> tuple[list[Floats], Bools]:
        """Return the slopes (z_x, z_y) that send light where it is wanted, and where there are such.

        There are none of more than the law allows, a . d <= min(n, n') / max(n, n'), none that is steep
        (LEAST_Z) or would be met from behind, and none where nothing leads to a place of the receiver.

        along : unit vectors a.  wanted : u and v.  near : slopes that are about those, where some are known.
        """
        before, behind = self.indices
        start = None
        if near is not None and self.rest.surfaces:
            start, _ = bent(self.mirror, self.indices, along, near)
        leaving, leads = self.rest.toward(points, wanted[0], wanted[1], start)
        sense = 1.0 if self.mirror or before > behind else -1.0
        normal = [sense * (before * a - behind * d) for a, d in zip(along, leaving)]
        length = np.sqrt(sum(np.square(m) for m in normal))
        possible = leads & (normal[2] > LEAST_Z * length)
        if not self.mirror:
            turned = sum(a * d for a, d in zip(along, leaving))
            possible = possible & (turned > min(before, behind) / max(before, behind))
        across = np.where(possible, normal[2], 1.0)
        return [-normal[0] / across, -normal[1] / across], possible

    def landing(self, points: Triple, along: Triple, slopes: Sequence[Floats]) -> list[Floats]:
        """Return u and v where light lands that a surface with these slopes sends on."""
        leaving, _ = bent(self.mirror, self.indices, along, slopes)
        u, v, _ = self.rest.land(points, leaving)
        return [u, v]
