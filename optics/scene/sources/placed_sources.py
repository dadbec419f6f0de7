"""Sources that stand elsewhere than on the axis, and several at once: the light of all is added."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain
from math import acos, degrees, isqrt
from operator import attrgetter
from typing import Any

import numpy as np

from optics.scene.sources.cells import SourceCells
from optics.scene.sources.light_source import ALL, AXIS, Counts, Ends, Fresh, LightSource, Pair
from optics.scene.sources.rays import RayGrid, Rays
from thbcad.certified import Stack
from thbcad.checks import Floats
from thbcad.poses import Pose

LEAST = 2  # rays each way of a source, however little of the light is its own


def _of_source(name: str) -> Any:
    """Return a property that is the one of the own source."""
    return property(attrgetter(f"source.{name}"))


@dataclass(frozen=True, eq=False, kw_only=True)
class PlacedSource(LightSource):
    """A source that lies anywhere.

    source : in its own frame, where its middle is (0, 0, -distance).  pose : from there to the scene.
    """

    source: LightSource
    pose: Pose
    symmetric = False

    spread = _of_source("spread")
    extended = _of_source("extended")
    beam = _of_source("beam")
    by_rays = _of_source("by_rays")
    scalable = _of_source("scalable")
    emitter = _of_source("emitter")
    kinked = _of_source("kinked")
    told = _of_source("told")
    etendue = _of_source("etendue")
    profile = _of_source("profile")
    image = _of_source("image")
    cone = _of_source("cone")
    most_rays = _of_source("most_rays")
    assumed = _of_source("assumed")

    @property
    def frame(self) -> Pose:
        return self.pose

    @property
    def middle(self) -> tuple[float, float, float]:
        x, y, z = self.pose.points(np.array(self.source.middle)).tolist()
        return x, y, z

    @property
    def corners(self) -> Floats:
        """Points whose convex hull holds all where light starts, (3, n) mm."""
        own = self.source.starts()
        if own is None:
            stack, _ = self.source.envelope()
            x, y = (float(stack.supports[0, k]) for k in (0, len(stack.supports[0]) // 4))
            z = float(stack.heights[0])
            own = np.array([(i * x, j * y, z) for i in (-1, 1) for j in (-1, 1)]).T
        return np.asarray(self.pose.points(own))

    def starts(self) -> Floats:
        return self.corners

    def envelope(self) -> tuple[Stack, float]:
        tilt = degrees(acos(np.clip(self.pose.rotation[2, 2], -1.0, 1.0)))
        return Stack.around(self.corners), self.source.envelope()[1] + tilt

    @property
    def whole(self) -> LightSource:
        return replace(self, source=self.source.whole)

    def without_extent(self) -> PlacedSource:
        return replace(self, source=self.source.without_extent())

    def cells(
        self, counts: Counts, aperture: Ends = None, centre: Pair = AXIS, direction: Floats | None = None
    ) -> SourceCells:
        cells = self.source.cells(counts)

        def at(s: Floats, t: Floats, flux: Floats) -> Rays:
            return cells.at(s, t, flux).posed(self.pose)

        return replace(cells, at=at, parallel=False)

    def parts(
        self, counts: Counts, fresh: Fresh = None, most: int = ALL, aperture: Ends = None, centre: Pair = AXIS
    ) -> Iterator[Rays]:
        yield from self._posed(self.source.parts(counts, fresh, most))

    def replicates(
        self, number: int, counts: Counts, fresh: np.random.Generator, most: int
    ) -> Iterator[Iterator[Rays]]:
        for parts in self.source.replicates(number, counts, fresh, most):
            yield self._posed(parts)

    def _posed(self, parts: Iterator[RayGrid | Rays]) -> Iterator[Rays]:
        for part in parts:
            own = part.rays(self.source.middle[2]) if isinstance(part, RayGrid) else part
            yield own.posed(self.pose)


@dataclass(frozen=True, eq=False, kw_only=True)
class SourceGroup(LightSource):
    """Several sources whose light is added: rays of all of them.

    members : the sources.
    """

    members: tuple[PlacedSource, ...]
    by_rays = True
    several = True
    symmetric = False

    @property
    def each(self) -> tuple[LightSource, ...]:
        return self.members

    @property
    def emitter(self) -> bool:  # type: ignore[override]
        return all(member.emitter for member in self.members)

    @property
    def told(self) -> Mapping[str, object]:
        """That of the first: a source with a file stands first."""
        return self.members[0].told

    @property
    def middle(self) -> tuple[float, float, float]:
        shares = [member.flux / self.flux for member in self.members]
        x, y, z = np.average([member.middle for member in self.members], axis=0, weights=shares).tolist()
        return x, y, z

    @property
    def cone(self) -> float:
        return max(member.cone for member in self.members)

    @property
    def most_rays(self) -> float:
        return sum(member.most_rays for member in self.members)

    @property
    def assumed(self) -> list[str]:
        return list(dict.fromkeys(text for member in self.members for text in member.assumed))

    def starts(self) -> Floats:
        return np.concatenate([member.corners for member in self.members], axis=1)

    def envelope(self) -> tuple[Stack, float]:
        return Stack.around(self.starts()), max(member.envelope()[1] for member in self.members)

    def without_extent(self) -> LightSource:
        """Return the brightest source without extent, with all the light, in the middle of all."""
        brightest = max(self.members, key=lambda member: member.flux).without_extent()
        pose = Pose.at(np.subtract(self.middle, brightest.middle)) @ brightest.pose
        lone = replace(brightest.source, flux=self.flux)
        return PlacedSource(flux=self.flux, distance=brightest.distance, source=lone, pose=pose)

    def rays(self, counts: Counts, fresh: Fresh = None) -> Rays:
        return Rays.joined(list(self.parts(counts, fresh)))

    def parts(
        self, counts: Counts, fresh: Fresh = None, most: int = ALL, aperture: Ends = None, centre: Pair = AXIS
    ) -> Iterator[Rays]:
        for member in self.members:
            yield from member.parts(self._counts_of(member, counts), fresh, most)

    def replicates(
        self, number: int, counts: Counts, fresh: np.random.Generator, most: int
    ) -> Iterator[Iterator[RayGrid | Rays]]:
        sets = [m.replicates(number, self._counts_of(m, counts), fresh, most) for m in self.members]
        for parts in zip(*sets):
            yield chain.from_iterable(parts)

    def _counts_of(self, member: LightSource, counts: Counts) -> tuple[int, int]:
        """Return how many rays a member has of those of all, by its share of the flux."""
        share = counts[0] * counts[1] * member.flux / self.flux
        each = max(LEAST, isqrt(round(share)))
        return each, each
