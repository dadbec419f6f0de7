"""The objective of one level and its gradient by the THB coefficients of every free surface.

    L(c) = ||E - T||^2 / ||T||^2 + w sum_k phi_k d_k^2 / (r^2 Phi) + v (1 - Phi_lit / Phi) + shape

E is the irradiance on the target's pixels and a dark margin around them, T the target irradiance there
(thesis 5.4, squared and normalised): that of mapped cells on the pixels themselves, or that of rays in a
smooth window, in which T is measured too.  Phi is the flux asked for.  The second term charges light beside
the target: d_k is the distance of landing point k from the target rectangle, r the target's larger
half-width.  The third charges light that misses the pixels where T > 0, wherever it is lost.  The last is
`ShapePenalty`.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from optics.target import MappedCells, Splat, filter_image

if TYPE_CHECKING:
    from optics.runtime import Backend, DrArray
    from optics.shape import ShapePenalty
    from optics.target import Screen, Window
    from optics.tracing import Landing, RayTracer
    from thbcad.splines import KnotVector


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The loss, its gradients by each sag's coefficients, and fit = ||E - T|| / ||T||."""

    loss: float
    gradients: list[NDArray[np.float64]]
    fit: float


class Objective:
    """Loss and gradient for one mesh, screen and set of rays.

    Call it with the THB coefficients of every sag, front first.

    window : in which rays are measured, or the map of the cells whose corners the rays are.
    target : irradiance on the screen's pixels without margin, W/mm^2.
    mirrors : directions (0 for x, 1 for y) in which the rays are one half of the light; the other half is its
        mirror image.
    """

    def __init__(
        self,
        backend: Backend,
        tracer: RayTracer,
        screen: Screen,
        window: Window | MappedCells,
        target: NDArray[np.float64],
        lost_flux_weight: float,
        dark_flux_weight: float = 0.0,
        shape: ShapePenalty | None = None,
        mirrors: Sequence[int] = (),
    ) -> None:
        self._backend, self._tracer, self._shape = backend, tracer, shape
        self._screen = screen
        pixels = np.arange(screen.padded[0] * screen.padded[1]).reshape(screen.padded, order="F")
        self._mirrored = [backend.Index(np.flip(pixels, 1 - axis).ravel(order="F")) for axis in mirrors]
        measured = screen.pad(target)
        if isinstance(window, MappedCells):
            self._cells: MappedCells | None = window
        else:
            self._cells, self._splat = None, Splat(backend, screen, window)
            measured = filter_image(measured, window)
        self._target = backend.array(measured.T)
        scale = target.sum() * screen.pixel_area * max(screen.half_width) ** 2
        self._norm = backend.dr.opaque(backend.Float, 1.0 / np.square(measured).sum())
        self._charge = backend.dr.opaque(backend.Float, lost_flux_weight / scale)
        self._dark = dark_flux_weight
        self._reward = (
            backend.array((measured.T > 0) * (dark_flux_weight / measured.sum()))
            if dark_flux_weight
            else None
        )

    def __call__(self, coefficients: Sequence[NDArray[np.float64]]) -> Evaluation:
        """Return the Evaluation at the coefficients of every sag, front first."""
        loss, fit, hits, _ = self._backward(coefficients)
        gradients = self._tracer.pull_back(hits)
        if self._shape is None:
            return Evaluation(loss, gradients, fit)
        more, slopes = self._shape(coefficients)
        return Evaluation(loss + more, [g + s for g, s in zip(gradients, slopes)], fit)

    @property
    def shape(self) -> ShapePenalty | None:
        """What the shape is charged for."""
        return self._shape

    def charging(self, shape: ShapePenalty | None) -> Objective:
        """Return the objective with other charges for the shape."""
        other = copy(self)
        other._shape = shape
        return other

    def image(self, coefficients: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        """Return the measured irradiance on the target's pixels, W/mm^2."""
        _, _, _, image = self._backward(coefficients)
        return self._screen.crop(image.numpy().reshape(self._screen.padded, order="F"))

    def vertex_gradients(
        self, coefficients: Sequence[NDArray[np.float64]], knots: Sequence[Sequence[KnotVector]]
    ) -> list[NDArray[np.float64]]:
        """Return |dL/dZ| for the vertices of a bilinear grid over every free surface (thesis 6.2).

        knots : for each, two knot vectors of degree 1, whose knots are the vertices.
        """
        _, _, hits, _ = self._backward(coefficients)
        return [np.abs(g) for g in self._tracer.pull_back(hits, knots)]

    def curvature(
        self, coefficients: Sequence[NDArray[np.float64]], count: int, seed: int
    ) -> list[list[NDArray[np.float64]]]:
        """Return vectors J^T s / ||T|| with random signs s.

        J is the derivative of the measured irradiance by the coefficients.  The mean square of the vectors is
        half the diagonal of the Gauss-Newton Hessian of the fit.

        Source: C. Bekas, E. Kokiopoulou, Y. Saad, An estimator for the diagonal of a matrix, Appl. Numer.
        Math. 57 (2007).
        """
        dr, rng, out = self._backend.dr, np.random.default_rng(seed), []
        for _ in range(count):
            hits, landing = self._tracer.trace(coefficients)
            image = self._irradiance(landing)
            signs = self._backend.array(rng.choice((-1.0, 1.0), dr.width(self._target)))
            dr.backward(dr.sum(image * signs) * dr.sqrt(self._norm))
            out.append(self._tracer.pull_back(hits))
        return out

    def _irradiance(self, landing: Landing) -> DrArray:
        if self._cells is None:
            image = self._splat(landing.x, landing.y, landing.flux)
        else:
            image = self._cells(landing.x, landing.y, landing.flux, landing.definite)
        for pixels in self._mirrored:
            image = image + self._backend.dr.gather(self._backend.Float, image, pixels)
        return image

    def _backward(
        self, coefficients: Sequence[NDArray[np.float64]]
    ) -> tuple[float, float, list[Any], DrArray]:
        """Return (loss without the shape, fit, what the tracer pulls back, measured irradiance)."""
        dr = self._backend.dr
        hits, landing = self._tracer.trace(coefficients)
        image = self._irradiance(landing)
        fit = dr.sum(dr.square(image - self._target)) * self._norm
        hx, hy = self._screen.half_width
        beside_x = dr.maximum(dr.abs(landing.x) - hx, 0)
        beside_y = dr.maximum(dr.abs(landing.y) - hy, 0)
        lost = dr.sum(landing.flux * (beside_x * beside_x + beside_y * beside_y)) * self._charge
        lost = lost * 2 ** len(self._mirrored)
        total = fit + lost
        if self._reward is not None:
            total = total + self._dark - dr.sum(image * self._reward)
        dr.backward(total)
        return float(total.numpy()[0]), float(np.sqrt(fit.numpy()[0])), hits, image
