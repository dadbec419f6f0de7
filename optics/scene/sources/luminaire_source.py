"""Light of a luminaire: the same intensity from every point of its opening."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optics.base.runtime import UserError, speaking_of
from optics.scene.luminaires import DirectionSampler, read_luminaire
from optics.scene.sources.file_sources import FileSource
from optics.scene.sources.light_source import ALL, AXIS, Counts, Ends, Fresh, Pair, drawn_sobol
from optics.scene.sources.profile import Profile
from optics.scene.sources.rays import Rays
from optics.scene.sources.spreading import MIRRORS, concentric, mirror_images
from thbcad.certified import Stack
from thbcad.checks import Floats

SAMPLE = (128, 128)  # rays that tell the point which stands for the light
TRIED = (32, 32)  # rays of which none may start in the lens
SAME_FLUX = 1e-9  # relative: problem files hold every digit


@dataclass(frozen=True, eq=False, kw_only=True)
class LuminaireSource(FileSource):
    """A luminaire in the scene.

    half_width : of its opening, mm, about its origin.  shape : "uniform", or "round" for an ellipse.
    weight : by which `flux` is that of the problem.
    Where `flux` and `half_width` are zero the file's own are `told`.
    """

    half_width: tuple[float, float]
    shape: str
    weight: float = 1.0
    emitter = True

    @cached_property
    def directions(self) -> DirectionSampler:
        """The directions of its light, in its own frame.

        Raises UserError : see `read_luminaire`.
        """
        with speaking_of("source.file"):
            return DirectionSampler(read_luminaire(self.file))

    @property
    def profile(self) -> Profile:
        return Profile(self.shape)

    @property
    def symmetric(self) -> bool:  # type: ignore[override]
        straight = not self.pose.shift[:2].any() and not self.pose.rotates
        return straight and self.directions.light.symmetric

    @property
    def told(self) -> dict[str, object]:
        changes: dict[str, object] = {}
        if not self.flux and self.weight:
            changes["source.flux"] = self.directions.light.flux
        if not any(self.half_width):
            opening = self.directions.light.opening
            changes["source.half_width"] = opening.size[0] / 2, opening.size[1] / 2
            if opening.round:
                changes["source.profile"] = "round"
        return changes

    @property
    def assumed(self) -> list[str]:
        sentences = [
            "the same intensity from every point of the luminaire's opening is assumed: its file tells no "
            "near field, so that no bound of etendue is given"
        ]
        own = self.directions.light.flux
        given = self.flux / self.weight if self.weight else own
        if abs(given / own - 1) > SAME_FLUX:
            sentences.append(
                f"the flux of source.file, {own:.6g}, is scaled to source.flux = {given:g}; 0 keeps it"
            )
        return sentences

    def sample(self) -> Rays:
        return next(self.parts(SAMPLE))

    def starts(self) -> Floats:
        tried = next(self.parts(TRIED))
        if tried.direction[2].max() <= 0:
            raise UserError(
                "no light of source.file goes to +z, where its gamma is 0; turn it with source.tilt"
            )
        return tried.origin

    def envelope(self) -> tuple[Stack, float]:
        corners = np.array([(x, y, 0.0) for x in (-1, 1) for y in (-1, 1)]) * [*self.half_width, 0.0]
        return Stack.around(self.pose.points(corners.T)), 90.0

    def parts(
        self, counts: Counts, fresh: Fresh = None, most: int = ALL, aperture: Ends = None, centre: Pair = AXIS
    ) -> Iterator[Rays]:
        """Yield rays of equal flux from four-dimensional Sobol points, in parts of at most `most`.

        Those of symmetric light are taken with their mirror images, in the order of `mirror_images`.
        """
        from scipy.stats import qmc

        count, seed = drawn_sobol(counts, fresh)
        symmetric, pose = self.symmetric, self.pose
        engine, images = qmc.Sobol(4, scramble=True, seed=seed), len(MIRRORS) if symmetric else 1
        left = count // images
        while left:
            size = min(left, max(1, most // images))
            left -= size
            s, t, u, v = engine.random(size).T
            s, t = 2 * s - 1, 2 * t - 1
            if self.profile.round:
                s, t = concentric(s, t)
            opening = np.stack([s * self.half_width[0], t * self.half_width[1], np.zeros(size)])
            origin = pose.points(opening)
            direction = pose.directions(self.directions(u, v))
            direction /= np.linalg.norm(direction, axis=0)
            if symmetric:
                origin, direction = mirror_images(origin), mirror_images(direction)
            yield Rays(origin, direction, np.full(images * size, self.flux / count))
