"""Rays of a luminaire: the same intensity from every point of its opening."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.luminaires import DirectionSampler, read_luminaire
from optics.runtime import speaking_of
from optics.sources import MIRRORS, Rays, concentric, mirror_images

if TYPE_CHECKING:
    from optics.problem import Problem, Source
    from thbcad.poses import Pose

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PlacedLuminaire:
    """A luminaire in the scene.

    directions : of its light, in its own frame.  half_width : of its opening, mm, about its origin.
    round : the opening is an ellipse.  pose : of its frame.  flux : W.
    """

    directions: DirectionSampler
    half_width: Sequence[float]
    round: bool
    pose: Pose
    flux: float

    def parts(self, count: int, seed: int, most: int) -> Iterator[Rays]:
        """Yield `count` rays of equal flux from four-dimensional Sobol points, in parts of at most `most`.

        Those of symmetric light are taken with their mirror images, in the order of `mirror_images`.
        count : a power of two, of four at least.  seed : of the scrambling.
        """
        from scipy.stats import qmc

        engine, images = qmc.Sobol(4, scramble=True, seed=seed), len(MIRRORS) if self.symmetric else 1
        left = count // images
        while left:
            size = min(left, max(1, most // images))
            left -= size
            s, t, u, v = engine.random(size).T
            s, t = 2 * s - 1, 2 * t - 1
            if self.round:
                s, t = concentric(s, t)
            opening = np.stack([s * self.half_width[0], t * self.half_width[1], np.zeros(size)])
            origin = self.pose.points(opening)
            direction = self.pose.directions(self.directions(u, v))
            direction /= np.linalg.norm(direction, axis=0)
            if self.symmetric:
                origin, direction = mirror_images(origin), mirror_images(direction)
            yield Rays(origin, direction, np.full(images * size, self.flux / count))

    @property
    def symmetric(self) -> bool:
        """Whether its light in the scene is its own mirror image in x and in y."""
        straight = not self.pose.shift[:2].any() and not self.pose.rotates
        return straight and self.directions.light.symmetric


def placed_luminaire(source: Source, pose: Pose) -> PlacedLuminaire:
    """Return the luminaire of a source's file in the scene.

    Raises
    ------
    UserError : see `read_luminaire`.
    """
    with speaking_of("source.file"):
        directions = DirectionSampler(read_luminaire(source.file))
    return PlacedLuminaire(directions, source.half_width, source.profile == "round", pose, source.flux)


def with_numbers_of_file(problem: Problem) -> Problem:
    """Return the problem with flux and opening of a luminaire's file where they are left to it.

    Raises
    ------
    UserError : see `read_luminaire`.
    """
    source = problem.source
    if source.kind != "luminaire" or (source.flux and any(source.half_width)):
        return problem
    with speaking_of("source.file"):
        luminaire = read_luminaire(source.file)
    changes: dict[str, object] = {"source.flux": source.flux or luminaire.flux}
    if not any(source.half_width):
        a, b = luminaire.opening.size
        changes["source.half_width"] = a / 2, b / 2
        changes["source.profile"] = "round" if luminaire.opening.round else source.profile
    return problem.with_(**changes)
