"""An engine for benches: Mitsuba's particle tracer, a diffuse screen, and a camera (thesis 5.2.2).

The light paths are random: an irradiance has noise, and so has
every derivative.  A derivative has other paths than its picture, so that it is right in the mean; see
`thbcad bench engines` for the cosine of the angle between such a gradient and the exact one.  The optimiser
that averages over steps is Adam.  Other coefficients have other paths, the same ones always the same.

Images and derivatives are float32.  There are no landing points.  The screen is at least twice as wide and
tall as the target.  With the flux Phi that passes the lens, the irradiance E on the pixels, of area A, and
their distance d <= r from the target,

    lost = r^2 Phi - sum of E A (r^2 - d^2),

so that light that the camera does not see is charged as if it were at the distance r, the target's larger
half-width.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil, pi
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from optics import design, load_problem
from optics.base.runtime import Backend, UserError
from optics.designing.optimisation import transmitted_flux
from optics.exchange.mitsuba import (
    REFLECTANCE,
    LensMesh,
    current_mitsuba,
    lens_mesh,
    load_mitsuba,
    mitsuba_backend,
    scene_dictionary,
)
from optics.light.engines import Film
from optics.scene.receivers import GaussianWindow, Screen, filter_image
from optics.scene.system import System
from thbcad.splines import KnotVector

Floats = NDArray[np.float64]
WIDER = 2  # times the target in each direction
# source, front, rear, screen: light that is reflected in the lens, about 1e-3, is left out;
# with it a derivative takes three times as long
TRACER = {"type": "ptracer", "max_depth": 4}
LAST = 1 << 31  # of the seeds


def camera_engine(threads: int = 0) -> CameraEngine:
    """Return the engine in Mitsuba's mono variant.

    threads : of all Dr.Jit kernels, 0 for all cores.

    Raises UserError : as `load_mitsuba`.
    """
    return CameraEngine(mitsuba_backend(load_mitsuba(threads=threads)))


@dataclass(frozen=True, eq=False)
class CameraEngine:
    """Light models that a camera sees: an `Engine`.

    backend : of the exact tracer, which measures the flux that passes the lens.
    """

    backend: Backend

    def model(self, system: System, film: Film) -> CameraModel:
        """Return the light model of a system with the meshes of a lens, see `Engine`.

        It measures in a Gaussian window of `optimizer.sigma` pixels, by `optimizer.rays_per_pixel` squared
        light paths per pixel.

        Raises UserError : as `scene_dictionary`; a problem without Fresnel's losses.
        """
        settings = system.problem.optimizer
        if not settings.fresnel:
            raise UserError("Mitsuba's glass reflects: optimizer.fresnel must be true, got false")
        passing = transmitted_flux(system, self.backend)
        seed = system.problem.run.seed if film.fresh is None else int(film.fresh.integers(LAST))
        paths = ceil(settings.rays_per_pixel**2)
        return CameraModel(system, lens_mesh(system.designed), film.screen, passing, paths, seed)


class CameraModel:
    """A `LightModel` of the picture of a screen.

    passing : flux that passes the lens, W.  paths : per pixel of the screen.
    """

    def __init__(
        self, system: System, mesh: LensMesh, screen: Screen, passing: float, paths: int, seed: int
    ) -> None:
        self.screen = screen
        self._mitsuba, self._mesh, self._paths, self._seed = current_mitsuba(), mesh, paths, seed
        self._window = GaussianWindow(system.problem.optimizer.sigma)
        self._wide = wide_screen(screen)
        seen = scene_dictionary(system, mesh, self._wide, self._window.sigma)
        self._scene = self._mitsuba.load_dict(seen | {"integrator": TRACER})
        self._parameters = self._mitsuba.traverse(self._scene)
        greatest = max(screen.half_width) ** 2
        beside = (np.maximum(np.abs(c) - h, 0) for c, h in zip(self._wide.centres, screen.half_width))
        bx, by = beside
        squares = np.minimum(bx[None, :] ** 2 + by[:, None] ** 2, greatest)
        self._unseen = greatest * passing
        self._charges = self._wide.pixel_area * (squares - greatest)

    def light(self, coefficients: Sequence[Floats]) -> CameraLight:
        """Return the light of a lens as the camera sees it."""
        return CameraLight(self, coefficients)

    def image(self, coefficients: Sequence[Floats]) -> Floats:
        """Return the irradiance that the camera sees, (rows, columns)."""
        return self.light(coefficients).image

    def filtered(self, image: Floats) -> Floats:
        """Return an irradiance that is constant on every pixel as it is measured here."""
        return filter_image(image, self._window)

    def seen(self, coefficients: Sequence[Floats]) -> tuple[Floats, float]:
        """Return (irradiance on the padded screen, lost light)."""
        self._placed(coefficients)
        integrator, mi = self._scene.integrator(), self._mitsuba
        with mitsuba_backend(mi).dr.suspend_grad():
            picture = integrator.render(self._scene, 0, seed=self._seed_of(coefficients), spp=self._paths)
        image = _irradiance(picture)
        return self._cropped(image), self._unseen + float(np.vdot(self._charges, image))

    def pull_back(
        self,
        coefficients: Sequence[Floats],
        image_bar: Floats,
        lost_bar: float,
        knots: Sequence[Sequence[KnotVector]] | None = None,
    ) -> list[Floats]:
        """Return the derivative by coefficients, or by nets over other knots."""
        dr, mi = mitsuba_backend(self._mitsuba).dr, self._mitsuba
        leaves = self._placed(coefficients)
        bars = np.pad(image_bar, self._border()) + lost_bar * self._charges
        weights = mi.TensorXf((pi / REFLECTANCE * bars[:, ::-1, None]).astype(np.float32))
        other = mi.sample_tea_32(self._seed_of(coefficients), 1)[0]
        integrator = self._scene.integrator()
        integrator.render_backward(
            self._scene, self._parameters, weights, 0, seed=int(other), spp=self._paths
        )
        dr.enqueue(dr.ADMode.Backward, *self._buffers())
        dr.traverse(dr.ADMode.Backward)
        return self._mesh.pull_back(leaves, knots)

    def push_forward(
        self, coefficients: Sequence[Floats], directions: Sequence[Floats]
    ) -> tuple[Floats, Floats]:
        """Return the image, and its derivative along a direction in the coefficients."""
        image = self.image(coefficients)
        dr, mi = mitsuba_backend(self._mitsuba).dr, self._mitsuba
        leaves = self._placed(coefficients)
        self._mesh.set_directions(mi, leaves, directions)
        dr.forward_to(self._buffers())
        other = mi.sample_tea_32(self._seed_of(coefficients), 1)[0]
        change = self._scene.integrator().render_forward(
            self._scene, self._parameters, 0, seed=int(other), spp=self._paths
        )
        return image, self._cropped(_irradiance(change))

    def _placed(self, coefficients: Sequence[Floats]) -> list[Any]:
        """Move the lens, and return the leaves by which its vertices can be derived."""
        leaves = self._mesh.leaves(self._mitsuba, coefficients)
        self._mesh.follow(self._mitsuba, self._parameters, leaves)
        return leaves

    def _buffers(self) -> list[Any]:
        """Return what of the scene changes with the coefficients."""
        dr = mitsuba_backend(self._mitsuba).dr
        names = ("vertex_positions", "vertex_normals")
        buffers = [values for key, values in self._parameters if key.endswith(names)]
        return [buffer for buffer in buffers if dr.grad_enabled(buffer)]

    def _seed_of(self, coefficients: Sequence[Floats]) -> int:
        """Return the seed of a lens: other ones have other light paths."""
        return crc32(b"".join(c.tobytes() for c in coefficients), self._seed) % LAST

    def _border(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Return how many pixels the wide screen has around the padded one."""
        rows, columns = ((a - b) // 2 for a, b in zip(self._wide.shape, self.screen.padded))
        return (rows, rows), (columns, columns)

    def _cropped(self, image: Floats) -> Floats:
        (above, _), (left, _) = self._border()
        rows, columns = self.screen.padded
        return image[above : above + rows, left : left + columns].copy()


class CameraLight:
    """The light of a lens as a camera sees it; every pull-back follows light paths of its own."""

    def __init__(self, model: CameraModel, coefficients: Sequence[Floats]) -> None:
        self._model, self._coefficients = model, coefficients
        self.image, self.lost = model.seen(coefficients)

    def pull_back(
        self, image_bar: Floats, lost_bar: float = 0.0, knots: Sequence[Sequence[KnotVector]] | None = None
    ) -> list[Floats]:
        """Return the derivative by each sag's coefficients, or by a net over other knots, see `Light`."""
        return self._model.pull_back(self._coefficients, image_bar, lost_bar, knots)


def wide_screen(screen: Screen) -> Screen:
    """Return pixels of the same size around a screen: WIDER, and at least as many as with its margin."""
    (columns, rows), (tall, wide), (px, py) = screen.pixels, screen.padded, screen.pitch
    wide += 2 * max(0, ceil((WIDER * columns - wide) / 2))  # the same number on both sides
    tall += 2 * max(0, ceil((WIDER * rows - tall) / 2))
    return replace(screen, half_width=(wide * px / 2, tall * py / 2), pixels=(wide, tall), margin=0)


def _irradiance(picture: Any) -> Floats:
    """Return the irradiance of a picture; the camera sees +x on its left."""
    return pi / REFLECTANCE * np.array(picture, dtype=np.float64)[..., 0][:, ::-1]


def main(problem: str, folder: str) -> None:
    """Design the lens of a problem file into a result folder, as `thbcad design` does, by this engine."""
    design(load_problem(problem), engine=camera_engine()).save(folder)


if __name__ == "__main__":
    main(*sys.argv[1:])
