"""The map from coefficients to irradiance, with its derivatives, as scripts use it.

    E = model(c),    E, pull = model.vjp(c),    pull(w) = J' w,    model.jvp(c, d) = E, J d

J is the derivative of the irradiance by the coefficients.  numpy goes in and comes out.  Nothing is kept
between calls, so any number of models can be used in turn; `pull` holds what it needs as long as it lives.
Calls from several threads are safe: they wait for each other, since Dr.Jit's kernels use all cores anyway.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from numbers import Integral

import numpy as np
from numpy.typing import ArrayLike

from optics.base.runtime import UserError, device
from optics.designing.optimisation import Objective, vertex_knots
from optics.interface.api.coefficient_vectors import Coefficients, image_of, packed, vectors
from optics.light.engines import LightModel
from optics.scene.photometry import PER_STERADIAN
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.hierarchy import THBSpace

Pull = Callable[[ArrayLike], Coefficients]


def unit_of(system: System) -> float:
    """Return the factor from measurements to the unit of scripts: W per square degree become W/sr."""
    return PER_STERADIAN if system.target.far_field else 1.0


class Model:
    """Irradiance on the target's pixels as a differentiable function of the sag coefficients.

    Made by `System.model`, and made so again where it is copied or pickled.  Irradiance is (rows, columns),
    W/mm^2; in the far field it is intensity, W/sr.  For W read lm where that is `source.unit`.  Of a plate
    it is the light of one lens with its own source, and `System.measure` has that of all.

    >>> system = System(problem)  # of the problem in the example of Problem
    >>> space = system.space()
    >>> irradiance = system.model(space, rays=(33, 33))(np.zeros(space.dim))
    >>> round(float(irradiance.mean()) * 40**2, 4)  # of 1 W, behind two faces that reflect 4 % each
    0.9216
    """

    def __init__(
        self,
        spaces: tuple[THBSpace, ...],
        light: LightModel,
        objective: Objective,
        again: Callable[[], Model],
    ) -> None:
        self._spaces, self._light, self._objective, self._again = spaces, light, objective, again
        self._scale = (PER_STERADIAN if light.screen.angular else 1.0) / light.screen.projection()

    def __reduce__(self) -> tuple[Callable[[], Model], tuple[()]]:
        return self._again, ()

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of the irradiance."""
        return self._light.screen.shape

    @property
    def target(self) -> Floats:
        """The target irradiance, measured as this model measures, (rows, columns).

        Its flux is what the unoptimised lens sends on.
        """
        return self._shown(self._objective.target)

    def __call__(self, coefficients: Coefficients) -> Floats:
        """Return the irradiance.

        Raises UserError : coefficients of another shape or space, or numbers that are not finite.
        """
        with device():
            return self._shown(self._light.light(vectors(coefficients, self._spaces)).image)

    def vjp(self, coefficients: Coefficients) -> tuple[Floats, Pull]:
        """Return the irradiance, and the function that maps dL/dE to dL/dc.

        Raises UserError : as of a call; the function too, of a dL/dE of another shape.
        """
        with device():
            light = self._light.light(vectors(coefficients, self._spaces))

        def pull(slope: ArrayLike) -> Coefficients:
            bar = self._scale * image_of(slope, self.shape, "dL/dE")
            with device():
                return packed(light.pull_back(self._light.screen.pad(bar)))

        return self._shown(light.image), pull

    def jvp(self, coefficients: Coefficients, direction: Coefficients) -> tuple[Floats, Floats]:
        """Return the irradiance, and its derivative along a direction in the coefficients.

        Raises UserError : as of a call.
        """
        at = vectors(coefficients, self._spaces)
        along = vectors(direction, self._spaces, "the direction")
        with device():
            image, slope = self._light.push_forward(at, along)
        return self._shown(image), self._shown(slope)

    def vertex_gradients(
        self, coefficients: Coefficients, slope: ArrayLike, counts: tuple[int, int] = (449, 449)
    ) -> Coefficients:
        """Return the derivative of a loss by the heights of a grid of vertices over every free surface.

        It is what refinement by vertex gradients looks at (thesis 6.2).

        slope : dL/dE, (rows, columns).
        counts : of vertices in x and y, from border to border.  The result is (nx, ny); of two free surfaces
            a tuple, front first.

        Raises UserError : as of a call, or a dL/dE of another shape.
        """
        at = vectors(coefficients, self._spaces)
        bar = self._scale * image_of(slope, self.shape, "dL/dE")
        pair = isinstance(counts, Sequence | np.ndarray) and len(counts) == 2
        if not pair or not all(isinstance(n, Integral) and n >= 2 for n in counts):
            raise UserError(f"counts must be two whole numbers from 2 on, got {counts!r}")
        with device():
            screen = self._light.screen
            nx, ny = map(int, counts)
            knots = [vertex_knots((space.kv_u.stop, space.kv_v.stop), (nx, ny)) for space in self._spaces]
            return packed(self._light.light(at).pull_back(screen.pad(bar), 0.0, knots))

    def loss(self, coefficients: Coefficients) -> tuple[float, Coefficients]:
        """Return the project's own loss and its gradient, see `optics.designing.optimisation.Objective`.

        Raises UserError : as of a call.
        """
        with device():
            found = self._objective(vectors(coefficients, self._spaces))
        return found.loss, packed(found.gradients)

    def _shown(self, image: Floats) -> Floats:
        return self._scale * self._light.screen.crop(image)
