"""The exact tracer as a Mitsuba integrator, "thbcad", and an integrator of any light model.

`register()` makes it known to the variant that is set; then ``mi.load_dict({"type": "thbcad", "result":
"exports/pearl"})`` reads a result folder.  `exact_integrator` makes one from Python objects.  ``mi.render``
returns the irradiance of the target in W/mm^2 (far field: W per square degree) as a tensor (rows, columns,
1): row 0 lies at +y and column 0 at -x, as one sees the screen when one looks back at the lens.  The film's
size gives the pixels, and the problem's `optimizer.window` measures them.

The rays are those of the problem's source, spp of them per pixel on a fixed grid (or Sobol set); seeds change
nothing.  Surfaces are the splines themselves, not meshes, traced in double precision.

`light_integrator` renders what a light model measures, margin and mirror images included, whatever the
sensor is.  Its tensor has two channels more.  One is for the light that misses the target: every pixel holds
`Light.lost` / number of pixels, so that the channel's sum is what is lost.  The other, "rounding", is what
float32 took from the irradiance, for a loss near its minimum; no derivative goes through it.

Mitsuba's tensors are float32: what a render returns, and what comes back to it, is rounded to 6e-8 of every
pixel.  What lies between is in double precision.

The parameters "front_coefficients" and "rear_coefficients" (Float64, of the surfaces that are free) are
differentiable, in backward and in forward mode.  Pixels are float32 both ways, so a derivative errs by about
1e-7 of the sum of its terms' sizes; near a minimum, where these cancel, that is much of the gradient, unless
the loss adds the channel "rounding".  The scene's shapes and emitters play no part.

Mitsuba 3.9.1 can construct no shape written in Python.  When it can, the splines belong in such a shape,
which serves every integrator, and this one is no longer needed.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from math import ceil, sqrt
from types import ModuleType
from typing import Any

import numpy as np

from optics.base.runtime import Backend
from optics.designing.optimisation import stage_window
from optics.exchange.mitsuba.loading import current_mitsuba, mitsuba_backend
from optics.exchange.results import ResultFolder
from optics.light.engines import Light, LightModel, TracedModel
from optics.light.tracing import Tracer
from optics.scene.system import System
from thbcad.checks import Floats

Models = Callable[[Any, int], LightModel]  # of a sensor and its samples per pixel

NAME = "thbcad"


class _Parameters:
    """The coefficients that Mitsuba may change, and the light at those of the last render.

    A derivative that is asked for after its render needs no second trace.
    """

    def __init__(self, backend: Backend, coefficients: dict[str, Floats], models: Models) -> None:
        self._backend, self._models = backend, models
        self.named = {f"{name}_coefficients": backend.array(values) for name, values in coefficients.items()}
        self._last: tuple[LightModel, list[Floats], Light] | None = None

    def values(self) -> list[Floats]:
        """Return the coefficients, (dim,) each."""
        return [self._backend.dr.detach(p).numpy() for p in self.named.values()]

    def directions(self) -> list[Floats]:
        """Return the derivatives that are attached to the coefficients in forward mode, (dim,) each."""
        return [np.broadcast_to(self._backend.dr.grad(p).numpy(), len(p)) for p in self.named.values()]

    def accumulate(self, gradients: Sequence[Floats]) -> None:
        """Add derivatives to those of the coefficients."""
        for values, gradient in zip(self.named.values(), gradients):
            self._backend.dr.accum_grad(values, self._backend.array(gradient))

    def model(self, scene: Any, sensor: Any, spp: int) -> LightModel:
        """Return the light model of a sensor; spp = 0 is what its sampler says."""
        sensor = scene.sensors()[sensor] if isinstance(sensor, int) else sensor
        return self._models(sensor, spp or sensor.sampler().sample_count())

    def light(self, model: LightModel) -> Light:
        """Return the light at the coefficients as they are, with what derivatives need."""
        values = self.values()
        if self._last is not None:
            traced, at, light = self._last
            if traced is model and all(map(np.array_equal, at, values)):
                return light
        self._last = None  # its memory goes to the next one
        light = model.light(values)
        self._last = model, values, light
        return light

    @property
    def wanted(self) -> bool:
        """Whether derivatives by a coefficient are asked for."""
        with self._backend.dr.resume_grad():
            return any(self._backend.dr.grad_enabled(p) for p in self.named.values())


def register() -> None:
    """Make the integrator "thbcad" known to Mitsuba's variant, the mono one where none is set.

    Raises UserError : as `load_mitsuba`.
    """
    mi = current_mitsuba()

    def make(properties: Any) -> Any:
        return _exact(mi, properties, ResultFolder(properties["result"]).read().system)

    mi.register_integrator(NAME, make)


def exact_integrator(system: System) -> Any:
    """Return the integrator of a system and a lens, mi.Integrator.

    It serves ``mi.render``, or ``mi.load_dict`` of a scene.

    Raises UserError : as `load_mitsuba`.
    """
    mi = current_mitsuba()
    return _exact(mi, mi.Properties(), system)


def light_integrator(model: LightModel, coefficients: dict[str, Floats]) -> Any:
    """Return the integrator of a light model, with the channels irradiance, lost, rounding, mi.Integrator.

    coefficients : (dim,) of the sags of "front" and "rear", those that are free, front first.
    """
    mi = current_mitsuba()
    parameters = _Parameters(mitsuba_backend(mi), coefficients, lambda sensor, spp: model)
    return _integrator_class(mi, mi.variant())(mi.Properties(), parameters, True)


def _exact(mi: ModuleType, properties: Any, system: System) -> Any:
    backend = mitsuba_backend(mi)
    coefficients = {name: s.sag.coefficients for name, s, _ in system.designed.faces if s.sag is not None}

    @cache
    def film(columns: int, rows: int, spp: int) -> TracedModel:
        screen = replace(system.target.screen(), pixels=(columns, rows))
        rays = system.source.rays([ceil(sqrt(spp) * n) for n in (columns, rows)])
        tracer = Tracer(backend, system.path, rays)
        return TracedModel(backend, tracer, screen, stage_window(system.problem, final=True))

    parameters = _Parameters(
        backend, coefficients, lambda sensor, spp: film(*map(int, sensor.film().size()), spp)
    )
    return _integrator_class(mi, mi.variant())(properties, parameters, False)


@cache
def _integrator_class(mi: ModuleType, variant: str) -> type:
    """Return the class for the variant that is set: Mitsuba's base class is another one in each."""

    base: Any = mi.CppADIntegrator

    class LightIntegrator(base):
        """parameters : of the scene.  lost : add the channels "lost" and "rounding"."""

        def __init__(self, properties: Any, parameters: _Parameters, lost: bool) -> None:
            super().__init__(properties)
            self._parameters, self._lost = parameters, lost

        def traverse(self, callback: Any) -> None:
            for name, values in self._parameters.named.items():
                callback.put(name, values, mi.ParamFlags.Differentiable)

        def aov_names(self) -> list[str]:
            return ["lost", "rounding"] if self._lost else []

        def render(
            self,
            scene: Any,
            sensor: Any = 0,
            seed: int = 0,
            spp: int = 0,
            develop: bool = True,
            evaluate: bool = True,
        ) -> Any:
            p = self._parameters
            model = p.model(scene, sensor, spp)
            if not (self._lost or p.wanted):
                return _tensor(mi, model.image(p.values()))
            light = p.light(model)
            if not self._lost:
                return _tensor(mi, light.image)
            return _tensor(mi, *_channels(light.image, light.lost))

        def render_forward(
            self, scene: Any, params: Any, sensor: Any = 0, seed: int = 0, spp: int = 0
        ) -> Any:
            p = self._parameters
            model, values, directions = p.model(scene, sensor, spp), p.values(), p.directions()
            _, change = model.push_forward(values, directions)
            if not self._lost:
                return _tensor(mi, change)
            slopes = model.light(values).pull_back(np.zeros(change.shape), 1.0)
            return _tensor(mi, *_channels(change, sum(float(g @ d) for g, d in zip(slopes, directions))))

        def render_backward(
            self, scene: Any, params: Any, grad_in: Any, sensor: Any = 0, seed: int = 0, spp: int = 0
        ) -> None:
            p, gradient = self._parameters, np.array(grad_in, dtype=np.float64)
            lost_bar = float(gradient[..., 1].mean()) if self._lost else 0.0
            p.accumulate(p.light(p.model(scene, sensor, spp)).pull_back(gradient[..., 0], lost_bar))

        def to_string(self) -> str:
            return f"{NAME}[{', '.join(self._parameters.named)}]"

    return LightIntegrator


def _channels(image: Floats, lost: float) -> tuple[Floats, Floats, Floats]:
    """Return an irradiance, the lost light spread over its pixels, and what float32 takes from it."""
    return image, np.full_like(image, lost / image.size), image - image.astype(np.float32)


def _tensor(mi: ModuleType, *channels: Floats) -> Any:
    return mi.TensorXf(np.stack(channels, axis=-1).astype(np.float32))
