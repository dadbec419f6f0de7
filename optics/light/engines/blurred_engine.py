"""Light models of blurred light: another engine makes the sharp light, which is convolved.

A beam that diverges, and rough surfaces, ask for the mean over many directions.  Where the blur is nearly the
same everywhere, one sharp image and a convolution do: exact cells stay free of noise, and an evaluation costs
little more.  The convolution is symmetric, so that its adjoint is the same.  The light of a plate is that of
one lens, blurred by their places.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from optics.light.blur import BlurOnto, Spread
from optics.light.engines.light_model import Engine, Film, Light, LightModel
from optics.scene.receivers import Screen
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.splines import KnotVector

FINEST = 4  # parts of a pixel in each direction: more cost memory, and no design became better by them


@dataclass(frozen=True, eq=False)
class BlurredEngine:
    """An `Engine` whose models blur the light of another's."""

    sharp: Engine
    blur: Spread

    def model(self, system: System, film: Film) -> BlurredModel:
        """Return the light model of a sharp system, see `Engine`.

        An even border of blurred light needs sharp light beside the target, as far as the blur reaches.  So
        the sharp light counts as lost from there on, and the blurred light is seen on the target alone.

        Raises UserError : see `Blur.widened`.
        """
        narrow, margin = replace(film.screen, margin=0), film.screen.margin
        parts, seen = self.blur.parts(narrow, FINEST), 0 if isinstance(self.sharp, BlurredEngine) else margin
        blurred = self.blur.onto(narrow, parts, seen)  # blurred light that is displaced has no margin either
        wide = replace(blurred.wide, margin=parts * margin)
        model = self.sharp.model(system, replace(film, screen=wide))
        return BlurredModel(model, blurred, narrow)


def sharp_engine(engine: Engine) -> Engine:
    """Return the engine whose light another one blurs, or this one."""
    while isinstance(engine, BlurredEngine):
        engine = engine.sharp
    return engine


@dataclass(frozen=True, eq=False)
class BlurredModel:
    """A `LightModel` of blurred light.

    sharp : the model of the light before, on a wider screen with finer pixels where the blur is narrow: what
        lies within a pixel is moved as well.  blurred : from that screen to `screen`.
    """

    sharp: LightModel
    blurred: BlurOnto
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
        return self.blurred.narrowed(self.sharp.filtered(self.blurred.spread(image)))


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
        return self.sharp.pull_back(self.model.blurred.back(image_bar), lost_bar, knots)
