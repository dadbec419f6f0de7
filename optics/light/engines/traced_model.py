"""The light model of rays that a tracer follows differentiably."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from optics.base.runtime import Backend, DrArray
from optics.light.measuring import MappedCells, Splat
from optics.light.tracing import Landing, RayTracer
from optics.scene.receivers import Screen, Window, filter_image, with_mirror_images
from thbcad.checks import Floats
from thbcad.splines import KnotVector


class TracedModel:
    """A `LightModel` of the landing points of a `RayTracer`.

    window : in which rays are measured, or the map of the cells whose corners the rays are.
    mirrors : directions (0 for x, 1 for y) in which the rays are one half of the light; the other half is its
        mirror image.
    light : W, of all rays, as of `Splat`.
    """

    def __init__(
        self,
        backend: Backend,
        tracer: RayTracer,
        screen: Screen,
        window: Window | MappedCells,
        mirrors: Sequence[int] = (),
        light: float | None = None,
    ) -> None:
        self.screen = screen
        self._backend, self._tracer = backend, tracer
        self._mirrors = mirrors
        self._window = None if isinstance(window, MappedCells) else window
        self._cells = window if isinstance(window, MappedCells) else None
        self._splat = None if isinstance(window, MappedCells) else Splat(backend, screen, window, light)

    def light(self, coefficients: Sequence[Floats]) -> TracedLight:
        """Return the light of a lens; its image and what is lost are known, derivatives come when asked."""
        return TracedLight(self, coefficients)

    def image(self, coefficients: Sequence[Floats]) -> Floats:
        """Return the irradiance on the padded screen, (rows, columns), without derivatives."""
        with self._backend.dr.suspend_grad():
            _, landing = self._tracer.trace(coefficients)
            return self._picture(self._measured(landing))

    def push_forward(
        self, coefficients: Sequence[Floats], directions: Sequence[Floats]
    ) -> tuple[Floats, Floats]:
        """Return the image, and its derivative along a direction in the coefficients."""
        dr = self._backend.dr
        with dr.resume_grad():
            traced, landing = self._tracer.trace(coefficients)
            image = self._measured(landing)
            dr.enqueue(dr.ADMode.Forward, *self._tracer.set_directions(traced, directions))
            dr.traverse(dr.ADMode.Forward)
            slope = dr.grad(image) + dr.zeros(self._backend.Float, dr.width(image))
            return self._picture(dr.detach(image)), self._picture(slope)

    def filtered(self, image: Floats) -> Floats:
        """Return an irradiance that is constant on every pixel as it is measured here."""
        return image if self._window is None else filter_image(image, self._window)

    def traced(self, coefficients: Sequence[Floats]) -> tuple[Any, DrArray, DrArray]:
        """Return (what the tracer pulls back, image, what is lost): of the rays, without mirror images."""
        dr = self._backend.dr
        with dr.resume_grad():
            traced, landing = self._tracer.trace(coefficients)
            hx, hy = self.screen.half_width
            beside_x = dr.maximum(dr.abs(landing.x) - hx, 0)
            beside_y = dr.maximum(dr.abs(landing.y) - hy, 0)
            far = landing.flux * (beside_x * beside_x + beside_y * beside_y)
            dr.schedule(far)  # with what the image needs of the rays
            image, lost = self._measured(landing), dr.sum(far)
            dr.eval(image, lost)
        return traced, image, lost

    def shown(self, image: DrArray, lost: DrArray) -> tuple[Floats, float]:
        """Return image and lost light of the rays and of their mirror images."""
        return self._picture(image), 2 ** len(self._mirrors) * float(lost.numpy()[0])

    def pull_back(
        self,
        traced: tuple[Any, DrArray, DrArray],
        image_bar: Floats,
        lost_bar: float,
        knots: Sequence[Sequence[KnotVector]] | None = None,
    ) -> list[Floats]:
        """Return the derivative by coefficients, or by nets over other knots."""
        dr, (hits, image, lost) = self._backend.dr, traced
        dr.set_grad(image, self._backend.array(with_mirror_images(image_bar, self._mirrors).T))
        dr.set_grad(lost, self._backend.Float(2 ** len(self._mirrors) * lost_bar))
        dr.enqueue(dr.ADMode.Backward, image, lost)
        dr.traverse(dr.ADMode.Backward, dr.ADFlag.ClearVertices)  # what was traced is kept
        return self._tracer.pull_back(hits, knots)

    def _measured(self, landing: Landing) -> DrArray:
        if self._splat is not None:
            return self._splat(landing.x, landing.y, landing.flux)
        assert self._cells is not None
        return self._cells(landing.x, landing.y, landing.flux, landing.definite)

    def _picture(self, image: DrArray) -> Floats:
        """Return an image of the rays with its mirror images, (rows, columns)."""
        picture = np.asarray(image.numpy(), dtype=np.float64).reshape(self.screen.padded, order="F")
        return with_mirror_images(picture, self._mirrors)


class TracedLight:
    """The light of a lens with its Dr.Jit graph, which is traced again where a pull-back was stopped."""

    def __init__(self, model: TracedModel, coefficients: Sequence[Floats]) -> None:
        self._model, self._coefficients = model, coefficients
        self._traced: tuple[Any, DrArray, DrArray] | None = model.traced(coefficients)
        self.image, self.lost = model.shown(*self._traced[1:])

    def pull_back(
        self, image_bar: Floats, lost_bar: float = 0.0, knots: Sequence[Sequence[KnotVector]] | None = None
    ) -> list[Floats]:
        """Return the derivative by each sag's coefficients, or by a net over other knots, see `Light`."""
        traced = self._traced or self._model.traced(self._coefficients)
        self._traced = None  # it holds the half of a derivative until the end
        slopes = self._model.pull_back(traced, image_bar, lost_bar, knots)
        self._traced = traced
        return slopes
