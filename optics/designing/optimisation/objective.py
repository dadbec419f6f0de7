"""The objective of one level and its gradient by the THB coefficients of every free surface.

    L(c) = ||E + B - T||^2 / ||T||^2 + w sum_k phi_k d_k^2 / (r^2 Phi) + v (1 - Phi_lit / Phi) + shape

E is the irradiance on the target's pixels and a dark margin around them, as an engine measures it, and T the
target irradiance there, measured in the same window (thesis 5.4, squared and normalised).  B is what other
ways through the lens bring at the start; what the rear changes of it is part of E.  Phi is the flux asked
for.  The second term is a penalty on light beside the target: d_k is the distance of landing point k from the
target rectangle, r the target's larger half-width.  The third is one on light that misses the pixels where
T > 0, wherever it is lost.  The last is `ShapePenalty`.

A far-sighted objective takes (D, W D) in place of ||D||^2 for the difference D = E + B - T, with

    W = (epsilon - Laplace)^-1,

the norm of H^-1, to which the Wasserstein distance tends as E nears T: light that is missing somewhere
attracts light from afar, and ripples of few pixels count little.  Pixels are the unit of length.

Where pixels have parts, D is on these, and what differs within a pixel counts WITHIN as much as its mean:
W = P + WITHIN (1 - P), with P the means over pixels.

Source: R. Peyre, Comparison between W2 distance and H^-1 norm, and localization of Wasserstein distance,
ESAIM: COCV 24 (2018).
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
from scipy.fft import dctn, idctn

from optics.designing.optimisation.zone_loss import ZoneLoss
from optics.designing.penalties import ShapePenalty
from optics.light.engines import Light, LightModel
from optics.scene.receivers import merged
from thbcad.checks import Floats
from thbcad.splines import KnotVector

# with 0.3 pictures on few pixels have four times as much rel_l2 (noise on 48 x 48), with 0.01 a ramp is more
# uneven within pixels by half
WITHIN = 0.03


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The loss, its gradients by each sag's coefficients, fit = ||E + B - T|| / ||T||, and what zones add."""

    loss: float
    gradients: list[Floats]
    fit: float
    zones: float = 0.0


class Objective:
    """Loss and gradient for one mesh, screen and set of rays.

    Call it with the THB coefficients of every sag, front first.

    model : of the light.
    target, background : irradiance on the screen's pixels, which may be parts, without margin, W/mm^2.
    far_sighted : it takes the norm of H^-1.
    zones : what those of the target add.
    parts : of every pixel, in each direction, that are the screen's pixels.
    """

    def __init__(
        self,
        model: LightModel,
        target: Floats,
        lost_flux_weight: float,
        dark_flux_weight: float = 0.0,
        shape: ShapePenalty | None = None,
        background: Floats | None = None,
        far_sighted: bool = False,
        zones: ZoneLoss | None = None,
        parts: int = 1,
    ) -> None:
        self._zones, self._parts = zones, parts
        self._model, self._shape, self._dark = model, shape, dark_flux_weight
        self._weights = _of_h_minus_1(model.screen.padded) if far_sighted else None
        screen = model.screen
        self._target = np.asfortranarray(model.filtered(screen.pad(target)))  # as images of rays are
        around = 0.0 if background is None else model.filtered(screen.pad(background))
        self._missing = np.asfortranarray(self._target - around)
        scale = target.sum() * screen.pixel_area * max(screen.half_width) ** 2
        self._norm = 1.0 / np.square(self._target).sum()
        self._lost_weight = lost_flux_weight / scale
        self._reward = (self._target > 0) * (dark_flux_weight / self._target.sum())

    def __call__(self, coefficients: Sequence[Floats]) -> Evaluation:
        """Return the Evaluation at the coefficients of every sag, front first."""
        light = self._model.light(coefficients)
        loss, fit, by_image = self._penalised(light)
        missed = 0.0
        if self._zones:
            missed, by_zones = self._zones(light.image + self._target - self._missing)
            loss, by_image = loss + missed, by_image + by_zones
        gradients = light.pull_back(by_image, self._lost_weight)
        if self._shape is None:
            return Evaluation(loss, gradients, fit, missed)
        more, slopes = self._shape(coefficients)
        return Evaluation(loss + more, [g + s for g, s in zip(gradients, slopes)], fit, missed)

    @property
    def target(self) -> Floats:
        """The target irradiance on the padded screen, measured as the light is, W/mm^2."""
        return self._target

    @property
    def shape(self) -> ShapePenalty | None:
        """The penalty on the shape."""
        return self._shape

    def with_shape(self, shape: ShapePenalty | None) -> Objective:
        """Return the objective with another penalty on the shape."""
        other = copy(self)
        other._shape = shape
        return other

    def image(self, coefficients: Sequence[Floats]) -> Floats:
        """Return the measured irradiance on the target's pixels, of their parts the means, W/mm^2."""
        return merged(self._model.screen.crop(self._model.image(coefficients)), self._parts)

    def vertex_gradients(
        self, coefficients: Sequence[Floats], knots: Sequence[Sequence[KnotVector]]
    ) -> list[Floats]:
        """Return |dL/dZ| for the vertices of a bilinear grid over every free surface (thesis 6.2).

        knots : for each, two knot vectors of degree 1, whose knots are the vertices.
        """
        light = self._model.light(coefficients)
        _, _, by_image = self._penalised(light)
        return [np.abs(g) for g in light.pull_back(by_image, self._lost_weight, knots)]

    def curvature(self, coefficients: Sequence[Floats], count: int, seed: int) -> list[list[Floats]]:
        """Return vectors J^T s / ||T|| with random signs s.

        J is the derivative of the measured irradiance by the coefficients.  The mean square of the vectors is
        half the diagonal of the Gauss-Newton Hessian of the fit.

        Source: C. Bekas, E. Kokiopoulou, Y. Saad, An estimator for the diagonal of a matrix, Appl. Numer.
        Math. 57 (2007).
        """
        rng, scale, out = np.random.default_rng(seed), np.sqrt(self._norm), []
        light = self._model.light(coefficients)
        for _ in range(count):
            signs = rng.choice((-1.0, 1.0), self._target.size).reshape(self._target.shape, order="F")
            out.append(light.pull_back(scale * self._weighted(signs, 0.5)))
        return out

    def _penalised(self, light: Light) -> tuple[float, float, Floats]:
        """Return (loss without the shape, fit, the loss's derivative by the image)."""
        difference = light.image - self._missing
        seen, weighted = self._of_pixels(difference), self._weighted(difference)
        fit = self._norm * float(np.square(seen).sum())
        charged = fit if weighted is difference else self._norm * float((difference * weighted).sum())
        loss = charged + self._lost_weight * light.lost + self._dark
        loss -= float((light.image * self._reward).sum())
        return loss, float(np.sqrt(fit)), 2 * self._norm * weighted - self._reward

    def _weighted(self, image: Floats, power: float = 1.0) -> Floats:
        """Return W^power of an image, (rows, columns)."""
        if self._weights is None:
            share = WITHIN**power
            return image if self._parts == 1 else share * image + (1 - share) * self._of_pixels(image)
        return np.asarray(idctn(self._weights**power * dctn(image, norm="ortho"), norm="ortho"))

    def _of_pixels(self, image: Floats) -> Floats:
        """Return the means of an image over whole pixels, (rows, columns)."""
        if self._parts == 1:
            return image
        means, out = merged(image, self._parts), np.empty_like(image)
        for row, column in np.ndindex(self._parts, self._parts):
            out[row :: self._parts, column :: self._parts] = means
        return out


def _of_h_minus_1(shape: tuple[int, int]) -> Floats:
    """Return the eigenvalues of W on cosines; epsilon is that of the longest.  shape : of images."""
    squares = [(np.pi * np.arange(n) / n) ** 2 for n in shape]
    return 1 / (squares[0][:, None] + squares[1][None, :] + (np.pi / max(shape)) ** 2)
