"""What the cusps of a tool do to the light: their blur on the target, the picture with them, and its rel_l2.

A pass of the tool adds slopes that range over a vector w (`thbcad.tools.Cusps`).  Light that crosses one pass
is spread over J w on the target, with the Jacobian J of the landing points by the slope, which holds Snell's
law at the ray and the way to the target: about L (n - 1) step / R for a ball of radius R.

Cusps are much finer than pixels on the lens, so that every small part of it holds all phases of a pass alike.
The light is therefore the mean over phases u from -1/2 to 1/2 of the light of lenses whose slopes are off by
u w, with the smooth field w: traced exactly at the corners of cells.

This is geometrical optics: cusps also diffract light, into orders wavelength / step apart.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import Backend
from optics.light.analysis import coloured, rel_l2, unit_mean
from optics.light.measuring import MappedCells
from optics.light.tracing import Tracer
from optics.scene.paths import LightPath, SlopeErrors
from optics.scene.receivers import Screen
from optics.scene.sources import RayGrid, Rays
from optics.scene.system import System
from optics.tolerancing.machining.tool_order import ToolOrder
from thbcad.checks import Floats
from thbcad.splines import BSplineSurface
from thbcad.tools import Cusps, ball_cusps, nose_cusps

TILT = 1e-5  # of the central differences: their error is its square, 1e-10, times the third derivative
CELLS_PER_PIXEL, LEAST_CELLS = 3, 257  # in each direction
PHASES_PER_PIXEL, LEAST_PHASES, MOST_PHASES = 2, 4, 32  # of the blur where it is widest


@dataclass(frozen=True, eq=False)
class LandingResponse:
    """Rays that land on the target: where they cross a surface, how they follow its slope.

    landed : which of the rays that were traced these are, (m,) bool
    x, y : (n,) mm, on the surface.  flux : (n,)
    jacobian : (2, 2, n), d(landing x, y) / d(dz/dx, dz/dy): mm, in the far field degrees
    """

    landed: NDArray[np.bool_]
    x: Floats
    y: Floats
    flux: Floats
    jacobian: Floats


def landing_response(system: System, backend: Backend, name: str, side: int) -> LandingResponse:
    """Return the response to slopes of the "front" or the "rear", for about side x side rays of the source.

    Central differences of the exact trace; the surfaces stay where they are.
    """
    path, rays = system.path, system.source.rays((side, side))
    surface = system.number_of(name)
    x, y = crossings(path, backend, surface, rays)
    half_width = system.target.screen().half_width
    columns, alive = [], np.ones(len(x), bool)
    flux = np.zeros(len(x))
    for tilt in np.eye(2) * TILT:
        ends = []
        for sign in (1.0, -1.0):
            errors = slope_errors(path, surface, sign * tilt[:, None])
            points, flux = traced_points(path.with_slope_errors(errors), backend, rays)
            # light off the target blurs no picture; near total reflection it would outweigh all other
            alive &= (flux > 0) & (np.abs(points) <= np.array(half_width)[:, None]).all(axis=0)
            ends.append(points)
        columns.append((ends[0] - ends[1]) / (2 * TILT))
    jacobian = np.stack(columns, axis=1)
    return LandingResponse(alive, x[alive], y[alive], flux[alive], jacobian[..., alive])


def traced_points(path: LightPath, backend: Backend, rays: RayGrid | Rays) -> tuple[Floats, Floats]:
    """Return (landing points (2, n), flux (n,)) of rays along a path."""
    tracer = Tracer(backend, path, rays)
    with backend.dr.suspend_grad():
        _, landing = tracer.trace()
        every = backend.dr.zeros(backend.Float, rays.flux.size)
        arrays = [landing.x + every, landing.y + every, landing.flux + every]
        backend.dr.eval(arrays)
    x, y, flux = (a.numpy().astype(np.float64) for a in arrays)
    return np.stack([x, y]), flux


def crossings(path: LightPath, backend: Backend, surface: int, rays: RayGrid | Rays) -> tuple[Floats, Floats]:
    """Return x and y, (n,) each, where rays cross a surface of a number, inside it."""
    tracer = Tracer(backend, path, rays if surface else rays.rays(path.before))
    with backend.dr.suspend_grad():
        hits, _, _ = tracer.at(surface)
        every = backend.dr.zeros(backend.Float, rays.flux.size)
        arrays = [hits.x + every, hits.y + every]
        backend.dr.eval(arrays)
    half_width = path.surfaces[surface].shape.half_width
    x, y = (np.clip(a.numpy(), -h, h) for a, h in zip(arrays, half_width))
    return x, y


def slope_errors(path: LightPath, surface: int, error: Floats | None) -> SlopeErrors:
    """Return errors of the slopes of one surface of a number, None is none."""
    return [error if k == surface else None for k in range(len(path.surfaces))]


@dataclass(frozen=True, eq=False)
class CuspBlur:
    """Blur and cusps at rays on a surface, (n,) each; NaN where the tool does not fit.

    x, y : mm.  flux : of the rays.  pixels : whole width of the blur, for each mm of the step or feed
    heights : mm, of the cusps, for each mm^2 of the step or feed squared
    """

    x: Floats
    y: Floats
    flux: Floats
    pixels: Floats
    heights: Floats

    def worst(self) -> tuple[float, float, float]:
        """Return (pixels for each mm, x, y) of the greatest blur."""
        k = int(np.nanargmax(self.pixels))
        return float(self.pixels[k]), float(self.x[k]), float(self.y[k])

    @property
    def rms(self) -> float:
        """Root of the mean square over the light, pixels for each mm."""
        known = np.isfinite(self.pixels)
        return float(np.sqrt(np.average(self.pixels[known] ** 2, weights=self.flux[known])))

    @property
    def unknown(self) -> float:
        """Fraction of the light that crosses places where the tool does not fit."""
        return float(self.flux[~np.isfinite(self.pixels)].sum() / self.flux.sum())


def cusp_blur(graph: BSplineSurface, response: LandingResponse, screen: Screen, order: ToolOrder) -> CuspBlur:
    """Return the blur of a tool's cusps at rays.

    graph : of the surface, with air above it (`thbcad.tools.air_side`).  Slopes of cusps and blur grow with
    the step, heights with its square.
    """
    x, y = response.x, response.y
    cusps = cusps_of(graph, x, y, order, 1.0)
    moved = np.einsum("ijn,jn->in", response.jacobian, cusps.slopes)
    pitch = np.array([2 * h / n for h, n in zip(screen.half_width, screen.pixels)])
    return CuspBlur(x, y, response.flux, np.hypot(*(moved / pitch[:, None])), cusps.height)


def cusps_of(graph: BSplineSurface, x: Floats, y: Floats, order: ToolOrder, pitch: float) -> Cusps:
    """Return the cusps of an ordered tool at positions (n,) for a step or feed, mm."""
    if order.ball is not None:
        return ball_cusps(graph, x, y, order.ball, pitch, order.rows)
    assert order.nose is not None  # cusps are asked for of a tool
    return nose_cusps(graph, x, y, order.nose, pitch)


@dataclass(frozen=True, eq=False)
class CuspLight:
    """The picture with cusps, (rows, columns) of unit mean, and rel_l2 of the lens without and with them."""

    picture: Floats
    without: float
    with_cusps: float


def light_with_cusps(
    system: System,
    backend: Backend,
    name: str,
    slopes: Callable[[Floats, Floats], Floats],
    widest: float,
) -> CuspLight | None:
    """Return the light of a lens whose "front" or "rear" has cusps; None for a source with extent, and of a
    plate before a plane, whose light is a sum.

    slopes : the range of slopes at positions x, y, (2, n).  widest : pixels, the greatest blur
    """
    if system.source.extended or system.blurred or len(system.seen_receivers) > 1:
        return None
    screen = system.target.screen()
    colours = [
        (weight, _by_phase(system, path, backend, name, slopes))
        for weight, path in coloured(system, system.path)
    ]

    def light(phase: float) -> Floats:
        return sum((weight * picture(phase) for weight, picture in colours), np.zeros(screen.shape))

    count = min(max(LEAST_PHASES, ceil(PHASES_PER_PIXEL * widest)), MOST_PHASES)
    picture = sum((light((k + 0.5) / count - 0.5) for k in range(count)), np.zeros(screen.shape))
    target = system.target.irradiance(screen, 1.0) / screen.projection()
    return CuspLight(unit_mean(picture), rel_l2(light(0.0), target), rel_l2(picture, target))


def _by_phase(
    system: System,
    path: LightPath,
    backend: Backend,
    name: str,
    slopes: Callable[[Floats, Floats], Floats],
) -> Callable[[float], Floats]:
    """Return the picture of one wavelength at a phase u: an irradiance, in the far field an intensity."""
    screen = system.target.screen()
    shown = screen.projection()
    cells = system.source.cells([max(LEAST_CELLS, CELLS_PER_PIXEL * n) for n in screen.pixels])
    rays = cells.rays()
    mapped = MappedCells(backend, screen, cells.emitted, rays.flux, cells.turned)
    surface = system.number_of(name)
    field = slopes(*crossings(path, backend, surface, rays))

    def light(phase: float) -> Floats:
        errors = slope_errors(path, surface, phase * field if phase else None)
        points, flux = traced_points(path.with_slope_errors(errors), backend, rays)
        x, y, passing = map(backend.array, (*points, flux))
        with backend.dr.suspend_grad():
            image = mapped(x, y, passing, passing > 0).numpy()
        return np.asarray(image.reshape(screen.shape, order="F") / shown)

    return light
