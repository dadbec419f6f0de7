"""The light of front and rear with the changes of light by other ways, as the rear shapes it.

Light that was reflected within a lens leaves it by the rear.  Its rays within are kept as they are; what they
make on the screen follows the rear:

    E(c) = E_path(c) + E_within(c_rear) - E_within(c_rear at the start).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from optics.base.runtime import Backend
from optics.light.engines.light_model import Film, Light, LightModel
from optics.light.engines.traced_model import TracedModel
from optics.light.tracing import Tracer
from optics.scene.paths import LightPath
from optics.scene.receivers import Screen
from optics.scene.sources import Rays
from thbcad.checks import Floats
from thbcad.splines import KnotVector


def light_within(backend: Backend, path: LightPath, rays: Rays, film: Film) -> TracedModel:
    """Return the light model of rays within a lens that meet nothing but its rear.

    path : through front and rear.  rays : in its frame.
    film : its axes are directions in which the light is averaged with its mirror image.
    """
    assert film.window is not None
    last = replace(path, surfaces=path.surfaces[-1:], media=path.media[-2:])
    flux = rays.flux / 2 ** len(film.axes)
    tracer = Tracer(backend, last, replace(rays, flux=flux), proven=False)
    return TracedModel(backend, tracer, film.screen, film.window, film.axes, float(flux.sum()))


@dataclass(frozen=True, eq=False)
class JointModel:
    """A `LightModel` of light along the path, and of changes of light by other ways.

    path : of all sags.  within : of the rear's sag, the last one.  before : image of `within` at the start.
    """

    path: LightModel
    within: LightModel
    before: Floats | float

    @property
    def screen(self) -> Screen:
        return self.path.screen

    def light(self, coefficients: Sequence[Floats]) -> JointLight:
        path, within = self.path.light(coefficients), self.within.light(coefficients[-1:])
        return JointLight(path, within, path.image + within.image - self.before)

    def image(self, coefficients: Sequence[Floats]) -> Floats:
        """Return `Light.image` alone."""
        return self.path.image(coefficients) + self.within.image(coefficients[-1:]) - self.before

    def push_forward(
        self, coefficients: Sequence[Floats], directions: Sequence[Floats]
    ) -> tuple[Floats, Floats]:
        """Return the image, and its derivative along a direction in the coefficients."""
        image, slope = self.path.push_forward(coefficients, directions)
        other, turned = self.within.push_forward(coefficients[-1:], directions[-1:])
        return image + other - self.before, slope + turned

    def filtered(self, image: Floats) -> Floats:
        """Return an irradiance that is constant on every pixel as it is measured here."""
        return self.path.filtered(image)


@dataclass(frozen=True, eq=False)
class JointLight:
    """The `Light` of a `JointModel`."""

    path: Light
    within: Light
    image: Floats

    @property
    def lost(self) -> float:
        """As of the light along the path."""
        return self.path.lost

    def pull_back(
        self, image_bar: Floats, lost_bar: float = 0.0, knots: Sequence[Sequence[KnotVector]] | None = None
    ) -> list[Floats]:
        """Return the derivative by each sag's coefficients, or by a net over other knots, see `Light`."""
        *fixed, rear = self.path.pull_back(image_bar, lost_bar, knots)
        (within,) = self.within.pull_back(image_bar, knots=None if knots is None else knots[-1:])
        return [*fixed, rear + within]
