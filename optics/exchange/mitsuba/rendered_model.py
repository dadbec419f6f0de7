"""The engine "mitsuba-exact": a light model that Mitsuba renders, and whose derivatives it brings back.

Every light is a scene of its own: the integrator of a light model, and the coefficients as its parameters.
`mi.render` gives the picture; `dr.backward` from it gives the derivatives by the parameters.  Tensors are
float32: weights that go back are rounded, so that derivatives differ from those of the model by about 1e-7 of
their terms.  The picture is completed by what float32 took from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import DrArray
from optics.exchange.mitsuba.integrator import light_integrator
from optics.exchange.mitsuba.loading import current_mitsuba, mitsuba_backend
from optics.light.engines import Engine, Film, LightModel
from optics.scene.receivers import Screen
from optics.scene.system import OpticalSystem
from thbcad.lens import Lens
from thbcad.splines import KnotVector

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RenderingEngine:
    """Light models of another engine, rendered by Mitsuba: an `Engine`."""

    traced: Engine

    def model(self, system: OpticalSystem, lens: Lens, film: Film) -> RenderedModel:
        """Return the light model of a system with the meshes of a lens, see `Engine`."""
        free = {"front": lens.front.sag, "rear": lens.rear.sag}
        names = [name for name, sag in free.items() if sag is not None]
        return RenderedModel(self.traced.model(system, lens, film), names)


class RenderedModel:
    """A `LightModel` that Mitsuba renders.

    traced : the model under the integrator.  names : of the free surfaces, front first.
    """

    def __init__(self, traced: LightModel, names: Sequence[str]) -> None:
        self.traced, self._names = traced, names
        self._mitsuba = current_mitsuba()
        self._backend = mitsuba_backend(self._mitsuba)
        sensor = {
            "type": "perspective",
            "film": {"type": "hdrfilm", "pixel_format": "luminance"},
        }  # the light model needs none
        self._sensor = self._mitsuba.load_dict(sensor)

    @property
    def screen(self) -> Screen:
        return self.traced.screen

    def light(self, coefficients: Sequence[Floats]) -> RenderedLight:
        """Return the light of a lens as Mitsuba renders it."""
        return RenderedLight(self, coefficients)

    def image(self, coefficients: Sequence[Floats]) -> Floats:
        """Return the rendered irradiance, (rows, columns)."""
        return self.light(coefficients).image

    def push_forward(
        self, coefficients: Sequence[Floats], directions: Sequence[Floats]
    ) -> tuple[Floats, Floats]:
        """Return the rendered irradiance, and its derivative along a direction in the coefficients."""
        _, tensor = self.rendered(coefficients, directions)
        return completed(tensor), completed(self._backend.dr.forward_to(tensor))

    def filtered(self, image: Floats) -> Floats:
        """Return an irradiance that is constant on every pixel as it is measured here."""
        return self.traced.filtered(image)

    def rendered(
        self, coefficients: Sequence[Floats], directions: Sequence[Floats] = ()
    ) -> tuple[list[DrArray], Any]:
        """Return (the coefficients as parameters of a scene, the tensor that is rendered of it).

        directions : derivatives that go forward from the coefficients.
        """
        mi, dr = self._mitsuba, self._backend.dr
        integrator = light_integrator(self.traced, dict(zip(self._names, coefficients)))
        scene = mi.load_dict({"type": "scene", "integrator": integrator, "sensor": self._sensor})
        parameters = mi.traverse(scene)
        leaves = [parameters[f"integrator.{name}_coefficients"] for name in self._names]
        dr.enable_grad(*leaves)
        for leaf, direction in zip(leaves, directions):
            dr.set_grad(leaf, self._backend.array(direction))
        return leaves, mi.render(scene, parameters)

    def pull_back(
        self, rendered: tuple[list[DrArray], Any], image_bar: Floats, lost_bar: float
    ) -> list[Floats]:
        """Return the derivative by the coefficients; it uses up what was rendered."""
        dr, (leaves, tensor) = self._backend.dr, rendered
        bars = np.stack([image_bar, np.full_like(image_bar, lost_bar), np.zeros_like(image_bar)], axis=-1)
        dr.backward(dr.sum(tensor * self._mitsuba.TensorXf(bars.astype(np.float32)), axis=None))
        return [np.array(np.broadcast_to(leaf.grad.numpy(), len(leaf))) for leaf in leaves]


class RenderedLight:
    """The light of a lens in Mitsuba's tensor, which the first pull-back uses up; another renders again."""

    def __init__(self, model: RenderedModel, coefficients: Sequence[Floats]) -> None:
        self._model, self._coefficients = model, coefficients
        self._rendered: tuple[list[DrArray], Any] | None = model.rendered(coefficients)
        tensor = self._rendered[1]
        self.image = completed(tensor)
        self.lost = float(np.array(tensor, dtype=np.float64)[..., 1].sum())

    def pull_back(self, image_bar: Floats, lost_bar: float = 0.0) -> list[Floats]:
        """Return the derivative by each sag's coefficients from those by `image` and `lost`."""
        rendered = self._rendered or self._model.rendered(self._coefficients)
        self._rendered = None
        return self._model.pull_back(rendered, image_bar, lost_bar)

    def vertex_gradients(
        self, image_bar: Floats, lost_bar: float, knots: Sequence[Sequence[KnotVector]]
    ) -> list[Floats]:
        """Return the derivative by the heights of a bilinear grid over every free surface (thesis 6.2).

        They are no parameters of the scene: the light under the integrator gives them.
        """
        return self._model.traced.light(self._coefficients).vertex_gradients(image_bar, lost_bar, knots)


def completed(tensor: Any) -> Floats:
    """Return the irradiance of a tensor of `light_integrator`, with what float32 took from it."""
    channels = np.array(tensor, dtype=np.float64)
    return channels[..., 0] + channels[..., 2]
