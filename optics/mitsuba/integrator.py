"""The exact tracer as a Mitsuba integrator, "thbcad".

`register()` makes it known to the variant that is set; then ``mi.load_dict({"type": "thbcad", "result":
"exports/pearl"})`` reads a result folder.  `exact_integrator` makes one from Python objects.  ``mi.render``
returns the irradiance of the target in W/mm^2 (far field: W per square degree) as a tensor (rows, columns,
1): row 0 lies at +y and column 0 at -x, as one sees the screen when one looks back at the lens.  The film's
size gives the pixels, and the problem's `optimizer.window` measures them.

The rays are those of the problem's source, spp of them per pixel on a fixed grid (or Sobol set); seeds change
nothing.  Surfaces are the splines themselves, not meshes, traced in double precision.

The parameters "front_coefficients" and "rear_coefficients" (Float64, of the surfaces that are free) are
differentiable, in backward and in forward mode.  The scene's shapes and emitters play no part.

Mitsuba 3.9.1 can construct no shape written in Python.  When it can, the splines belong in such a shape,
which serves every integrator, and this one is no longer needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from math import ceil, sqrt
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from optics.engines import TracedModel
from optics.mitsuba.loading import current_mitsuba, mitsuba_backend
from optics.optimisation import stage_window
from optics.results import ResultFolder
from optics.system import OpticalSystem
from optics.tracing import Tracer

if TYPE_CHECKING:
    from optics.runtime import Backend
    from thbcad.lens import Lens

Floats = NDArray[np.float64]
NAME = "thbcad"


class _Parameters:
    """The coefficients that Mitsuba may change, and what is prepared for the last film."""

    def __init__(self, backend: Backend, system: OpticalSystem, lens: Lens) -> None:
        self._backend, self._system, self._lens = backend, system, lens
        free = {"front": lens.front.sag, "rear": lens.rear.sag}
        self.named = {
            f"{name}_coefficients": backend.array(sag.coefficients)
            for name, sag in free.items()
            if sag is not None
        }
        self._key: tuple[int, ...] = ()
        self._film: TracedModel | None = None

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

    def film(self, scene: Any, sensor: Any, spp: int) -> TracedModel:
        """Return the light model of a sensor's film; spp = 0 is what its sampler says."""
        sensor = scene.sensors()[sensor] if isinstance(sensor, int) else sensor
        columns, rows = map(int, sensor.film().size())
        key = columns, rows, spp or sensor.sampler().sample_count()
        if self._film is None or key != self._key:
            self._key, system = key, self._system
            screen = replace(system.target.screen(), pixels=(columns, rows))
            rays = system.source.rays([ceil(sqrt(key[2]) * n) for n in (columns, rows)])
            tracer = Tracer(self._backend, self._lens, rays, system.target.z)
            window = stage_window(system.problem, final=True)
            self._film = TracedModel(self._backend, tracer, screen, window)
        return self._film


def register() -> None:
    """Make the integrator "thbcad" known to Mitsuba's variant, llvm_ad_mono where none is set.

    Raises
    ------
    UserError : as `load_mitsuba`.
    """
    mi = current_mitsuba()

    def make(properties: Any) -> Any:
        problem, lens, _ = ResultFolder(properties["result"]).read()
        return _integrator_class(mi, mi.variant())(properties, OpticalSystem(problem), lens)

    mi.register_integrator(NAME, make)


def exact_integrator(system: OpticalSystem, lens: Lens) -> Any:
    """Return the integrator of a system and a lens, mi.Integrator.

    It serves ``mi.render``, or ``mi.load_dict`` of a scene.

    Raises
    ------
    UserError : as `load_mitsuba`.
    """
    mi = current_mitsuba()
    return _integrator_class(mi, mi.variant())(mi.Properties(), system, lens)


@cache
def _integrator_class(mi: ModuleType, variant: str) -> type:
    """Return the class for the variant that is set: Mitsuba's base class is another one in each."""
    backend = mitsuba_backend(mi)

    base: Any = mi.CppADIntegrator

    class ExactIntegrator(base):
        def __init__(self, properties: Any, system: OpticalSystem, lens: Lens) -> None:
            super().__init__(properties)
            self._parameters = _Parameters(backend, system, lens)

        def traverse(self, callback: Any) -> None:
            for name, values in self._parameters.named.items():
                callback.put(name, values, mi.ParamFlags.Differentiable)

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
            return _tensor(mi, p.film(scene, sensor, spp).image(p.values()))

        def render_forward(
            self, scene: Any, params: Any, sensor: Any = 0, seed: int = 0, spp: int = 0
        ) -> Any:
            p = self._parameters
            return _tensor(mi, p.film(scene, sensor, spp).push_forward(p.values(), p.directions())[1])

        def render_backward(
            self, scene: Any, params: Any, grad_in: Any, sensor: Any = 0, seed: int = 0, spp: int = 0
        ) -> None:
            p, gradient = self._parameters, np.array(grad_in, dtype=np.float64)[..., 0]
            p.accumulate(p.film(scene, sensor, spp).light(p.values()).pull_back(gradient))

        def to_string(self) -> str:
            return f"{NAME}[{', '.join(self._parameters.named)}]"

    return ExactIntegrator


def _tensor(mi: ModuleType, picture: Floats) -> Any:
    return mi.TensorXf(picture.astype(np.float32)[..., None])
