"""The engines that run a design through Mitsuba, by the names that problem files give them.

"mitsuba-mesh": rays through meshes of the lens, traced by Mitsuba.  Normals are those of the splines at the
vertices and interpolated between them, so that slopes err by h^2 / 8 of their second derivative, with the
spacing h of the vertices.  At least PER_SPAN of these lie on every knot span of the finest level, on which
the optimiser bends the surface.  Mitsuba meets the triangles in single precision, and derivatives pass
through float32.

"mitsuba-exact": a light model that Mitsuba renders, and whose derivatives it brings back.  Every light is a
scene of its own: the integrator of a light model, and the coefficients as its parameters.  `mi.render` gives
the picture; `dr.backward` from it gives the derivatives by the parameters.  Tensors are float32: weights that
go back are rounded, so that derivatives differ from those of the model by about 1e-7 of their terms.  The
picture is completed by what float32 took from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import ceil
from typing import Any

import numpy as np

from optics.base.runtime import Backend, DrArray, UserError
from optics.exchange.mitsuba.integrator import light_integrator
from optics.exchange.mitsuba.loading import current_mitsuba, load_mitsuba, mitsuba_backend
from optics.exchange.mitsuba.mesh import LensMesh
from optics.exchange.mitsuba.mesh_tracer import MeshTracer
from optics.exchange.mitsuba.scene import absorbs, coated, require_open
from optics.light.engines import (
    SOFT_RIM,
    DrawnRays,
    Engine,
    ExactEngine,
    Film,
    LightModel,
    TracedModel,
    measured_rays,
)
from optics.scene.receivers import Screen
from optics.scene.sources import RayGrid, Rays
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.lens import Lens
from thbcad.splines import KnotVector

PER_SPAN = 2  # least vertices per knot span of the finest level, in each direction
FEWEST = 448  # spaces between the vertices, in each direction
INSIDE = 1 - 1e-6  # of the half-width: a ray on the rim itself could miss the mesh in single precision


def require_meshable(system: System) -> None:
    """Refuse what meshes do not know.

    Raises UserError : stops, a clear aperture, coatings or absorption.
    """
    require_open(system)
    if coated(system) or absorbs(system):
        raise UserError(
            "meshes for Mitsuba are of clear and bare glass: leave out absorption and the reflectance of "
            'lenses, or trace with optimizer.engine = "exact" or "mitsuba-exact"'
        )


@dataclass(frozen=True, eq=False)
class MeshEngine:
    """Light models of rays through meshes: an `Engine`.

    backend : of Mitsuba's single precision.  drawn : the rays, which stages of a design have in common.
    """

    backend: Backend
    drawn: DrawnRays = field(default_factory=DrawnRays, repr=False)

    def model(self, system: System, film: Film) -> TracedModel:
        """Return the light model of a system with the meshes of a lens, see `Engine`."""
        lens = system.designed
        require_meshable(system)
        rays, window, mirrors = measured_rays(self.backend, system, film, self.drawn)
        tracer = MeshTracer(
            lens_mesh(lens),
            _within(rays, lens),
            system.target.receiver,
            soft_rim=0.0 if system.parallel else SOFT_RIM,
            fresnel=system.problem.optimizer.fresnel,
        )
        return TracedModel(self.backend, tracer, film.screen, window, mirrors)


def lens_mesh(lens: Lens) -> LensMesh:
    """Return a lens's mesh with PER_SPAN vertices per knot span of its finest level, or more."""
    spaces = [sag.space for sag in lens.sags]
    spans = [
        max(row) << max(space.levels - 1 for space in spaces)
        for row in zip(*((space.kv_u.spans, space.kv_v.spans) for space in spaces))
    ]
    return LensMesh.uniform(lens, [n * max(PER_SPAN, ceil(FEWEST / n)) + 1 for n in spans])


def _within(rays: RayGrid | Rays, lens: Lens) -> RayGrid | Rays:
    """Return the rays of a beam, with those on the rim of a surface led just within."""
    if not isinstance(rays, RayGrid):
        return rays
    lines = []
    for line, half_widths in zip((rays.x, rays.y), zip(lens.front.half_width, lens.rear.half_width)):
        for h in half_widths:
            line = np.where(np.abs(np.abs(line) - h) <= (1 - INSIDE) * h, INSIDE * np.sign(line) * h, line)
        lines.append(line)
    x, y = lines
    return replace(rays, x=x, y=y)


@dataclass(frozen=True, eq=False)
class RenderingEngine:
    """Light models of another engine, rendered by Mitsuba: an `Engine`."""

    traced: Engine

    def model(self, system: System, film: Film) -> RenderedModel:
        """Return the light model of a system with the meshes of a lens, see `Engine`."""
        names = [name for name, surface, _ in system.designed.faces if surface.sag is not None]
        return RenderedModel(self.traced.model(system, film), names)


class RenderedModel:
    """A `LightModel` that Mitsuba renders.

    traced : the model under the integrator.  names : of the free surfaces, front first.
    """

    def __init__(self, traced: LightModel, names: Sequence[str]) -> None:
        self.traced, self._names = traced, names
        self._mitsuba = current_mitsuba()
        self._backend = mitsuba_backend(self._mitsuba)
        film = {"type": "hdrfilm", "pixel_format": "luminance"}  # the light model needs no sensor
        self._sensor = self._mitsuba.load_dict({"type": "perspective", "film": film})

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

    def pull_back(
        self, image_bar: Floats, lost_bar: float = 0.0, knots: Sequence[Sequence[KnotVector]] | None = None
    ) -> list[Floats]:
        """Return the derivative by each sag's coefficients, or by a net over other knots, see `Light`.

        Such a net is no parameter of the scene: the light under the integrator gives it.
        """
        if knots is not None:
            return self._model.traced.light(self._coefficients).pull_back(image_bar, lost_bar, knots)
        rendered = self._rendered or self._model.rendered(self._coefficients)
        self._rendered = None
        return self._model.pull_back(rendered, image_bar, lost_bar)


def completed(tensor: Any) -> Floats:
    """Return the irradiance of a tensor of `light_integrator`, with what float32 took from it."""
    channels = np.array(tensor, dtype=np.float64)
    return channels[..., 0] + channels[..., 2]


def mitsuba_engine(name: str, threads: int = 0) -> Engine:
    """Return the engine of a name; Mitsuba runs in its mono variant.

    name : "mitsuba-exact", whose rays meet the splines themselves; "mitsuba-mesh", whose rays meet meshes.
    threads : of all Dr.Jit kernels, 0 for all cores.

    Raises UserError : as `load_mitsuba`.  ValueError : another name.
    """
    mitsuba = load_mitsuba(threads=threads)
    if name == "mitsuba-exact":
        return RenderingEngine(ExactEngine(mitsuba_backend(mitsuba)))
    if name == "mitsuba-mesh":
        return MeshEngine(mitsuba_backend(mitsuba, "single"))
    raise ValueError(f"there is no engine {name!r} in Mitsuba")
