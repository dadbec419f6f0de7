"""Run time and error of the methods for irradiance and gradient: one `Point` per method and number of rays.

Times are of one thread and of tracing and measuring alone: rays, meshes and scenes are ready.  The error of
the gradient is that of the derivative of ||E - T||^2 / ||T||^2 by all THB coefficients.

`ptracer`'s camera has a film with the same Gaussian filter, so that all methods measure the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import perf_counter
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.rows.row import Row, median_seconds
from benchmarks.tracing.error_cases import WINDOW, Case, Reference, grid_rays
from optics.base.runtime import Backend, load_backend
from optics.designing.optimisation import Objective
from optics.light.engines import TracedModel
from optics.light.measuring import Splat
from optics.light.tracing import Tracer
from optics.scene.receivers import filter_image
from oracles.error_measures import Point, relative, slope_of_fit
from oracles.ray_samplings import jittered_points, random_points, sampled_rays, sobol_points

if TYPE_CHECKING:
    from optics.exchange.mitsuba import LensMesh, MeshTracer

Floats = NDArray[np.float64]
COUNTS = tuple(1 << k for k in (14, 16, 18, 20))
MOST, LONG = 1 << 21, 1 << 22  # rays of a gradient; of a longer run in single precision, irradiance only
MESH_COUNTS = COUNTS[:3]
VERTICES = (449, 449)
SPP, GRADIENT_SPP = (1, 4, 8), 4
REPEATS = 3
CAMERA = "Mitsuba ptracer + camera"
BOX, GAUSSIAN = "box pixels", "Gaussian window"
SAMPLINGS = {"random": random_points, "jittered": jittered_points, "Sobol": sobol_points}
CLEAR, STATUS = Path("/proc/self/clear_refs"), Path("/proc/self/status")


@dataclass(frozen=True)
class Method:
    """One method for a case.  irradiance : returns (rows, columns), W/mm^2.  gradient : one array per
    sag."""

    name: str
    rays: int
    irradiance: Callable[[], Floats]
    gradient: Callable[[], list[Floats]]


def quantity(window: str) -> str:
    """Return what is compared, in the words of the rows."""
    return f"irradiance, {window}"


@dataclass(frozen=True)
class Noise:
    """Relative L2 noise of a picture by a number of light paths, which took some seconds."""

    value: float
    seconds: float
    paths: int

    def seconds_at(self, error: float) -> float:
        """Return the time at which the noise has fallen to an error, as 1 / sqrt(time)."""
        return self.seconds * (self.value / error) ** 2

    def ratio(self, name: str, seconds: float, error: float, window: str, limit: float | None = None) -> Row:
        """Return the row of the time at an error, extrapolated, to the seconds of another method in the same
        window."""
        note = f"at error {error:.2g}: {self.seconds_at(error):.3g} s, by noise {self.value:.2g} in "
        note += f"{self.seconds:.3g} s and noise ~ time^(-1/2); ours {seconds:.3g} s"
        value = self.seconds_at(error) / seconds
        return Row(
            name,
            value,
            "",
            note,
            limit,
            ">=",
            quantity=quantity(window),
            estimator=name.partition(", ")[2],
            error=error,
            extrapolated=True,
        )


def exact_points(case: Case, truth: Reference, counts: Sequence[int] = COUNTS) -> list[Point]:
    """Return the points of the exact tracer: four samplings in double, two in single precision."""
    out = []
    for precision in ("double", "single"):
        backend, short = load_backend(precision, 1), {"double": "f64", "single": "f32"}[precision]
        for name in ("grid", "Sobol") if precision == "single" else ("grid", *SAMPLINGS):
            few = counts[:-1] if name in ("random", "jittered") else counts
            for count in (*counts, LONG) if precision == "single" else few:
                rays = (
                    grid_rays(case, count)
                    if name == "grid"
                    else sampled_rays(
                        case.system.problem.source, case.system.designed, SAMPLINGS[name], count
                    )
                )
                tracer = Tracer(backend, case.system.path, rays)
                out.append(_point(case, truth, backend, tracer, f"ours, {name}, {short}", rays.flux.size))
    return out


def mesh_points(case: Case, truth: Reference, counts: Sequence[int] = MESH_COUNTS) -> list[Point]:
    """Return the points of Mitsuba's meshes with analytic normals and direct splats, on the exact tracer's
    grids or Sobol points."""
    from optics.exchange.mitsuba import LensMesh, MeshTracer

    out, mesh = [], LensMesh.uniform(case.system.designed, VERTICES)
    collimated = case.system.source.collimated
    for count in counts:
        rays = (
            grid_rays(case, count)
            if collimated
            else sampled_rays(case.system.problem.source, case.system.designed, sobol_points, count)
        )
        tracer = MeshTracer(mesh, rays, case.system.target.receiver)
        out.append(_point(case, truth, tracer.backend, tracer, "Mitsuba mesh + splat", rays.flux.size))
    return out


def camera_points(case: Case, truth: Reference) -> list[Point]:
    """Return the points of Mitsuba's particle tracer and camera; the gradient for few rays only, it takes
    long."""
    from optics.exchange.mitsuba import LensMesh, current_mitsuba, mitsuba_scene

    mi, mesh, out = current_mitsuba(), LensMesh.uniform(case.system.designed, VERTICES), []
    scene = mitsuba_scene(case.system, mesh)
    camera = gaussian_camera(mi, scene, case)
    for spp in SPP:
        seconds = median_seconds(
            lambda n=spp: np.array(mi.render(scene, sensor=camera, spp=n, seed=1)), REPEATS
        )
        image = _seen(mi.render(scene, sensor=camera, spp=spp, seed=7))
        slow = error = megabytes = np.nan
        if spp == GRADIENT_SPP:
            gradient, slow, megabytes = _timed_gradient(mi, case, mesh, scene, camera)
            error = relative(gradient, truth.gradient)
        out.append(
            Point(
                case.name,
                CAMERA,
                spp * image.size,
                seconds,
                relative(image, truth.image),
                slow,
                error,
                megabytes,
            )
        )
    return out


def _timed_gradient(
    mi: ModuleType, case: Case, mesh: LensMesh, scene: Any, camera: Any
) -> tuple[Floats, float, float]:
    """Return (gradient, seconds, MB) of one run after a warm one."""
    parameters = mi.traverse(scene)
    _camera_gradient(mi, case, mesh, parameters, scene, camera)
    before, start = _reset_peak(), perf_counter()
    gradient = _camera_gradient(mi, case, mesh, parameters, scene, camera)
    return gradient, perf_counter() - start, _peak() - before


def _seen(picture: Any) -> Floats:
    """Return the irradiance of a white screen, (rows, columns), from a picture of the dark one; the camera
    sees +x on its left."""
    from optics.exchange.mitsuba import REFLECTANCE

    return np.pi / REFLECTANCE * np.array(picture, dtype=np.float64)[..., 0][:, ::-1]


def camera_noise(case: Case, window: str, paths: int = SPP[-1]) -> Noise:
    """Return the noise of the camera's picture in box pixels or in the Gaussian window.

    Two pictures are sqrt(2) noises apart.  Light by other paths than front, rear, screen is seen alike
    in both, unlike in `Point`.  paths : per pixel.
    """
    from optics.exchange.mitsuba import LensMesh, current_mitsuba, mitsuba_scene

    mi = current_mitsuba()
    scene = mitsuba_scene(case.system, LensMesh.uniform(case.system.designed, VERTICES))
    camera = scene.sensors()[0] if window == BOX else gaussian_camera(mi, scene, case)
    np.array(mi.render(scene, sensor=camera, spp=1))  # compiles
    pictures, seconds = [], []
    for seed in (7, 8, 9):
        start = perf_counter()
        pictures.append(_seen(mi.render(scene, sensor=camera, spp=paths, seed=seed)))
        seconds.append(perf_counter() - start)
    one, other, _ = pictures
    apart = np.square(one - other).sum() / 2
    noise = float(np.sqrt(apart / (np.square((one + other) / 2).sum() - apart / 2)))
    return Noise(noise, median(seconds), paths * one.size)


def gaussian_camera(mi: ModuleType, scene: Any, case: Case) -> Any:
    """Return the scene's camera with a film of the case's pixels that filters with WINDOW, which the box of
    the other does not."""
    seen = mi.traverse(scene.sensors()[0])
    columns, rows = case.screen.pixels
    return mi.load_dict(
        {
            "type": "perspective",
            "fov": float(seen["x_fov"][0]),
            "fov_axis": "x",
            "to_world": mi.ScalarTransform4f(np.array(seen["to_world"].matrix).reshape(4, 4)),
            "near_clip": float(seen["near_clip"]),
            "far_clip": float(seen["far_clip"]),
            "film": {
                "type": "hdrfilm",
                "width": columns,
                "height": rows,
                "pixel_format": "luminance",
                "rfilter": {"type": "gaussian", "stddev": WINDOW.sigma},
            },
        }
    )


def _camera_gradient(
    mi: ModuleType, case: Case, mesh: LensMesh, parameters: Any, scene: Any, camera: Any
) -> Floats:
    """Return the gradient by the coefficients through camera and meshes; the same rays serve image and
    derivative."""
    from optics.exchange.mitsuba import REFLECTANCE, mitsuba_backend

    double = mitsuba_backend(mi)
    dr, leaves = double.dr, [double.array(c) for c in case.coefficients]
    dr.enable_grad(*leaves)
    mesh.update(mi, parameters, leaves)
    picture = mi.render(scene, parameters, sensor=camera, spp=GRADIENT_SPP, seed=7)
    seed = np.pi / REFLECTANCE * slope_of_fit(_seen(picture), filter_image(case.target, WINDOW))[:, ::-1]
    dr.backward(dr.sum(picture * mi.TensorXf(seed.astype(np.float32)[..., None].copy())))
    return np.concatenate([leaf.grad.numpy() for leaf in leaves])


def _point(
    case: Case, truth: Reference, backend: Backend, tracer: Tracer | MeshTracer, method: str, rays: int
) -> Point:
    """Return the point of a tracer whose rays are ready, with Splat and Objective."""
    screen = case.screen
    splat = Splat(backend, screen, WINDOW)
    objective = Objective(TracedModel(backend, tracer, screen, WINDOW), case.target, 0.0)

    def irradiance() -> Floats:
        with backend.dr.suspend_grad():
            _, landing = tracer.trace(case.coefficients)
            return splat(landing.x, landing.y, landing.flux).numpy().reshape(screen.shape, order="F")

    return _measured(
        case, truth, Method(method, rays, irradiance, lambda: objective(case.coefficients).gradients)
    )


def _measured(case: Case, truth: Reference, method: Method) -> Point:
    """Return the point of a method, without the gradient where rays are many."""
    seconds = median_seconds(method.irradiance, REPEATS)
    error = relative(method.irradiance().astype(np.float64), truth.image)
    if method.rays > MOST:
        return Point(case.name, method.name, method.rays, seconds, error, np.nan, np.nan, np.nan)
    slow = median_seconds(method.gradient, REPEATS)
    load_backend("double", 1).dr.flush_malloc_cache()
    before = _reset_peak()
    gradient = np.concatenate(method.gradient())
    megabytes = _peak() - before
    slope = relative(gradient, truth.gradient)
    return Point(case.name, method.name, method.rays, seconds, error, slow, slope, megabytes)


def _reset_peak() -> float:
    """Return the megabytes in use, from which `_peak` counts on."""
    CLEAR.write_text("5")
    return _status("VmRSS")


def _peak() -> float:
    return _status("VmHWM")


def _status(name: str) -> float:
    """Return a line of the kernel's account of this process, MB."""
    line = next(line for line in STATUS.read_text().splitlines() if line.startswith(name))
    return int(line.split()[1]) / 1024
