"""Light models of blurred light: another engine makes the sharp light, which is convolved.

A beam that diverges, and rough surfaces, ask for the mean over many directions.  Where the blur is nearly the
same everywhere, one sharp image and a convolution do: exact cells stay free of noise, and an evaluation costs
little more.  The convolution is symmetric, so that its adjoint is the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from optics.light.blur import Blur, Convolution
from optics.light.engines.light_model import Engine, Film, Light, LightModel
from optics.scene.receivers import Screen
from optics.scene.system import OpticalSystem
from thbcad.checks import Floats
from thbcad.lens import Lens
from thbcad.splines import KnotVector

FINEST = 4  # parts of a pixel in each direction: more cost memory, and no design became better by them


@dataclass(frozen=True, eq=False)
class BlurredEngine:
    """An `Engine` whose models blur the light of another's."""

    sharp: Engine
    blur: Blur

    def model(self, system: OpticalSystem, lens: Lens, film: Film) -> BlurredModel:
        """Return the light model of a sharp system, see `Engine`.

        An even border of blurred light needs sharp light beside the target, as far as the blur reaches.  So
        the sharp light counts as lost from there on, and the blurred light is seen on the target alone.

        Raises UserError : see `Blur.widened`.
        """
        narrow = replace(film.screen, margin=0)
        times = self.blur.parts(narrow, FINEST)
        wide = self.blur.widened(narrow).finer(times)
        wide = replace(wide, margin=times * film.screen.margin)
        model = self.sharp.model(system, lens, replace(film, screen=wide))
        return BlurredModel(model, self.blur, narrow)


def sharp_engine(engine: Engine) -> Engine:
    """Return the engine whose light another one blurs, or this one."""
    return engine.sharp if isinstance(engine, BlurredEngine) else engine


@dataclass(frozen=True, eq=False)
class BlurredModel:
    """A `LightModel` of blurred light.

    sharp : the model of the light before, on a wider screen with finer pixels where the blur is narrow: what
        lies within a pixel is moved as well.
    """

    sharp: LightModel
    blur: Blur
    screen: Screen

    def light(self, coefficients: Sequence[Floats]) -> BlurredLight:
        light = self.sharp.light(coefficients)
        return BlurredLight(self, light, self.blurred(light.image))

    def image(self, coefficients: Sequence[Floats]) -> Floats:
        """Return `Light.image` alone."""
        return self.blurred(self.sharp.image(coefficients))

    def push_forward(
        self, coefficients: Sequence[Floats], directions: Sequence[Floats]
    ) -> tuple[Floats, Floats]:
        """Return the image, and its derivative along a direction in the coefficients."""
        image, slope = self.sharp.push_forward(coefficients, directions)
        return self.blurred(image), self.blurred(slope)

    def filtered(self, image: Floats) -> Floats:
        """Return an irradiance that is constant on every pixel as the sharp engine would measure it."""
        return self._narrow(self.sharp.filtered(self._wide(image)))

    def blurred(self, image: Floats) -> Floats:
        """Return the blur of an image on the wide screen, on the narrow one."""
        return self._narrow(self._convolution(image))

    def blurred_back(self, image_bar: Floats) -> Floats:
        """Return the adjoint of `blurred`."""
        return self._convolution(self._wide(image_bar)) / self._times**2

    @cached_property
    def _convolution(self) -> Convolution:
        return self.blur.convolution(self.sharp.screen, self.sharp.screen.padded)

    @property
    def _times(self) -> int:
        """How many pixels of the wide screen make one of the narrow one, in each direction."""
        return round(self.screen.pitch[0] / self.sharp.screen.pitch[0])

    @property
    def _extra(self) -> int:
        """Pixels of the wide screen on every side of the narrow one."""
        return (self.sharp.screen.padded[0] - self._times * self.screen.padded[0]) // 2

    def _wide(self, image: Floats) -> Floats:
        fine = image.repeat(self._times, axis=0).repeat(self._times, axis=1)
        return np.pad(fine, self._extra)

    def _narrow(self, image: Floats) -> Floats:
        extra, times = self._extra, self._times
        inner = image[extra : image.shape[0] - extra, extra : image.shape[1] - extra]
        rows, columns = (n // times for n in inner.shape)
        return inner.reshape(rows, times, columns, times).mean(axis=(1, 3))


@dataclass(frozen=True, eq=False)
class BlurredLight:
    """The blurred `Light` of one lens."""

    model: BlurredModel
    sharp: Light
    image: Floats

    @property
    def lost(self) -> float:
        """As of the sharp light: the blur moves as much light out as in."""
        return self.sharp.lost

    def pull_back(
        self, image_bar: Floats, lost_bar: float = 0.0, knots: Sequence[Sequence[KnotVector]] | None = None
    ) -> list[Floats]:
        """Return the derivative by each sag's coefficients, or by a net over other knots, see `Light`."""
        return self.sharp.pull_back(self.model.blurred_back(image_bar), lost_bar, knots)
