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

from optics.mitsuba.loading import current_mitsuba, mitsuba_backend
from optics.optimisation import stage_window
from optics.results import ResultFolder
from optics.system import OpticalSystem
from optics.target import Splat
from optics.tracing import Tracer
from thbcad.lens import FreeformSurface
from thbcad.surfaces import THBSurface

if TYPE_CHECKING:
    from optics.runtime import Backend, DrArray
    from optics.tracing import Hits
    from thbcad.lens import Lens

Floats = NDArray[np.float64]
NAME = "thbcad"


class ExactFilm:
    """The irradiance of a problem's target on a film, and its derivatives by the coefficients of the sags.

    The sags go front first.

    pixels : (columns, rows).  spp : rays per pixel, about.
    """

    def __init__(
        self, backend: Backend, system: OpticalSystem, lens: Lens, pixels: Sequence[int], spp: int
    ) -> None:
        columns, rows = (int(n) for n in pixels)
        screen = replace(system.target.screen(), pixels=(columns, rows))
        counts = [ceil(sqrt(spp) * n) for n in (columns, rows)]
        self.shape = rows, columns
        surfaces = (lens.front, lens.rear)
        self._free = [(s.half_width, s.sag.space) for s in surfaces if s.sag is not None]
        self._backend = backend
        self._tracer = Tracer(backend, lens, system.source.rays(counts), system.target.z)
        self._splat = Splat(backend, screen, stage_window(system.problem, final=True))

    def image(self, coefficients: Sequence[Floats]) -> Floats:
        """Return the irradiance, (rows, columns)."""
        with self._backend.dr.suspend_grad():
            _, image = self._trace(coefficients)
        return self._picture(image)

    def pull_back(self, coefficients: Sequence[Floats], gradient: Floats) -> list[Floats]:
        """Return the derivative by the coefficients from that by the image, (rows, columns)."""
        dr = self._backend.dr
        with dr.resume_grad():
            hits, image = self._trace(coefficients)
            dr.backward(dr.sum(image * self._backend.array(gradient.T)))
        return self._tracer.pull_back(hits)

    def push_forward(self, coefficients: Sequence[Floats], directions: Sequence[Floats]) -> Floats:
        """Return the derivative of the image, (rows, columns), along a direction in the coefficients."""
        dr = self._backend.dr
        with dr.resume_grad():
            hits, image = self._trace(coefficients)
            for hit, (half_width, space), direction in zip(hits, self._free, directions):
                sag = FreeformSurface(half_width, sag=THBSurface(space, direction))
                for leaf, slope in zip(hit.leaves, _jet_at(hit, sag)):
                    dr.set_grad(leaf, self._backend.array(slope))
            dr.enqueue(dr.ADMode.Forward, *(leaf for hit in hits for leaf in hit.leaves))
            dr.traverse(dr.ADMode.Forward)
            return self._picture(dr.grad(image))

    def _trace(self, coefficients: Sequence[Floats]) -> tuple[list[Hits], DrArray]:
        hits, landing = self._tracer.trace(coefficients)
        return hits, self._splat(landing.x, landing.y, landing.flux)

    def _picture(self, image: DrArray) -> Floats:
        return image.numpy().reshape(self.shape, order="F")


def _jet_at(hits: Hits, surface: FreeformSurface) -> list[Floats]:
    """Return height and slopes of a surface at the x and y of meeting points, (n,) each; zeros for misses."""
    dr = hits.dr
    hit = np.broadcast_to(hits.hit.numpy(), dr.width(hits.x))
    x, y = (dr.detach(a).numpy()[hit] for a in (hits.x, hits.y))
    rows = [np.zeros(len(hit)) for _ in range(3)]
    for row, derivative in zip(rows, ((0, 0), (1, 0), (0, 1))):
        row[hit] = surface(x, y, derivative)
    return rows


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
        self._film: ExactFilm | None = None

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

    def film(self, scene: Any, sensor: Any, spp: int) -> ExactFilm:
        """Return the film of a sensor; spp = 0 is what its sampler says."""
        sensor = scene.sensors()[sensor] if isinstance(sensor, int) else sensor
        key = *map(int, sensor.film().size()), spp or sensor.sampler().sample_count()
        if self._film is None or key != self._key:
            self._key = key
            self._film = ExactFilm(self._backend, self._system, self._lens, key[:2], key[2])
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
            return _tensor(mi, p.film(scene, sensor, spp).push_forward(p.values(), p.directions()))

        def render_backward(
            self, scene: Any, params: Any, grad_in: Any, sensor: Any = 0, seed: int = 0, spp: int = 0
        ) -> None:
            p, gradient = self._parameters, np.array(grad_in, dtype=np.float64)[..., 0]
            p.accumulate(p.film(scene, sensor, spp).pull_back(p.values(), gradient))

        def to_string(self) -> str:
            return f"{NAME}[{', '.join(self._parameters.named)}]"

    return ExactIntegrator


def _tensor(mi: ModuleType, picture: Floats) -> Any:
    return mi.TensorXf(picture.astype(np.float32)[..., None])
