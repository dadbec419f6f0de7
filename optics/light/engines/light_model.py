"""What a design loop needs of an engine: the light of a lens on a screen, and its derivatives.

An engine follows light by its own means: exact rays, a renderer, meshes.  The loop sees these protocols only,
and whoever starts it hands the engine in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from optics.scene.receivers import Screen, Window
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.splines import KnotVector


@dataclass(frozen=True, eq=False)
class Film:
    """What is to be measured, and by which rays.

    rays : their number in x and y; the corners of cells where there is no window.
    window : in which rays are measured; None measures cells, exactly on the pixels.
    axes : directions (0 for x, 1 for y) of mirror symmetry, in which half of the light may do.
    fresh : seed that draws other rays than those of the optimiser; cells are always the same.
    """

    screen: Screen
    rays: tuple[int, int]
    window: Window | None = None
    axes: Sequence[int] = ()
    fresh: tuple[int, ...] | None = None

    @property
    def drawing(self) -> tuple[object, ...]:
        """What tells the rays of a source that measure it, where these are no corners of cells."""
        return tuple(self.rays), tuple(self.axes), self.fresh


class Light(Protocol):
    """The light of one lens, from which derivatives can be pulled back, any number of times."""

    @property
    def image(self) -> Floats:
        """Irradiance on the screen's pixels with their margin, (rows, columns), W/mm^2.

        In the far field it is in W per square degree.
        """
        ...

    @property
    def lost(self) -> float:
        """Sum of flux d^2, W mm^2, with the distance d of a landing point from the target rectangle.

        An engine without landing points takes the target's larger half-width for d.
        """
        ...

    def pull_back(
        self, image_bar: Floats, lost_bar: float = 0.0, knots: Sequence[Sequence[KnotVector]] | None = None
    ) -> list[Floats]:
        """Return the derivative by each sag's coefficients from those by `image` and `lost`.

        knots : two knot vectors for every free surface; the derivative is then that by a net over these
            knots.  Of degree 1 it is that by the heights of a bilinear grid, whose vertices are the knots
            (thesis 6.2).
        """
        ...


class LightModel(Protocol):
    """The map from the coefficients of every sag, front first, to the light on a screen."""

    @property
    def screen(self) -> Screen: ...

    def light(self, coefficients: Sequence[Floats]) -> Light: ...

    def image(self, coefficients: Sequence[Floats]) -> Floats:
        """Return `Light.image` alone."""
        ...

    def push_forward(
        self, coefficients: Sequence[Floats], directions: Sequence[Floats]
    ) -> tuple[Floats, Floats]:
        """Return the image, and its derivative along a direction in the coefficients."""
        ...

    def filtered(self, image: Floats) -> Floats:
        """Return an irradiance that is constant on every pixel as the engine would measure it."""
        ...


class Engine(Protocol):
    """What makes light models of lenses."""

    def model(self, system: System, film: Film) -> LightModel:
        """Return the LightModel of a system with the meshes of a lens."""
        ...
