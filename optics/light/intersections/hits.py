"""Rays on the device, where they meet a surface, and how derivatives of the light by its changes act there.

`KnownHits` serves parallel rays along z, `SearchedHits` all others.  Both answer the same question: `meet`
gives the points where rays meet the surface conic + spline(net), with z, zx, zy there as differentiable
leaves.  `pull_back` turns derivatives by these leaves into derivatives by spline coefficients:

    dL/dC = sum over rays of  gz N_i N_j + gx N_i' N_j + gy N_i N_j'.

The meeting point itself depends on the surface and on the ray; implicit differentiation brings
that in, so that no derivative passes through the iterations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from types import ModuleType
from typing import TypeAlias

import numpy as np
from scipy.sparse import csr_array

from optics.base.runtime import Backend, DrArray
from optics.light.intersections.ray_roots import conic_jet
from optics.scene.paths import HeightError
from optics.scene.sources import RayGrid, Rays
from thbcad.checks import Floats
from thbcad.outlines import Outline
from thbcad.sags import Conic
from thbcad.splines import KnotVector

Vector: TypeAlias = "tuple[DrArray, DrArray, DrArray]"

SETTLED = 1e-9  # mm: what is looked for in landing points is thousands of it


@dataclass(eq=False)
class Stokes:
    """Polarisation of rays on the device.

    q, u, v : the Stokes parameters over the intensity, Q / I, U / I, V / I.
    across : normal to the rays, of any length: light that swings along it has q = 1.
    """

    q: DrArray
    u: DrArray
    v: DrArray
    across: Vector


@dataclass(eq=False)
class DeviceRays:
    """Rays on the device of the backend.

    origin : mm.  direction : unit vectors.  flux : W.  inside : the mask of rays in glass.
    stokes : None is unpolarised light.
    """

    origin: Vector
    direction: Vector
    flux: DrArray = None
    inside: DrArray | bool = False
    stokes: Stokes | None = None

    def at(self, t: DrArray) -> Vector:
        """Return the points at the path length t, mm."""
        x, y, z = (o + t * d for o, d in zip(self.origin, self.direction))
        return x, y, z


def device_flux(backend: Backend, flux: Floats) -> DrArray:
    """Return the flux of rays on the device; one number where all rays carry the same."""
    if (flux == flux.flat[0]).all():
        return backend.opaque(flux.flat[0])
    return backend.array(flux)


def on_device(backend: Backend, rays: Rays, flux: DrArray) -> DeviceRays:
    """Return rays on the device.  flux : of them, as `device_flux`."""
    ox, oy, oz = (backend.array(row) for row in rays.origin)
    dx, dy, dz = (backend.array(row) for row in rays.direction)
    return DeviceRays((ox, oy, oz), (dx, dy, dz), flux)


@dataclass(eq=False)
class Hits:
    """Meeting points as Dr.Jit arrays: position (x, y, height above the vertex), slopes, masks.

    found : the ray meets the surface or its extension.  hit : within the outline.
    leaves : the arrays z, zx, zy that carry gradients.  at : x and y at which these were evaluated.
    dr : the drjit module.
    """

    x: DrArray
    y: DrArray
    z: DrArray
    zx: DrArray
    zy: DrArray
    found: DrArray
    hit: DrArray
    leaves: tuple[DrArray, ...]
    at: tuple[DrArray, DrArray]
    dr: ModuleType

    def taken_gradients(self) -> list[DrArray]:
        """Return the derivatives by the leaves (z, zx, zy), which then carry none."""
        gradients = [leaf.grad for leaf in self.leaves]
        self.dr.eval(gradients)  # together: one kernel
        self.dr.clear_grad(self.leaves)
        return gradients


def raised_hits(
    backend: Backend, error: HeightError, meet: Callable[[DrArray | float], Hits], most: int
) -> Hits:
    """Return the Hits of a surface to whose height an error is added.

    A ray meets z = f + dh where the ray that is lowered by dh meets f.  Every step evaluates dh where the ray
    met the surface before, until it changes by less than SETTLED.  A step takes the error times dh' tan, tan
    the slope of the ray to z.

    meet : called with a height, mm, returns the Hits with f of rays that are lowered by it.
    most : steps; 0 for rays along z, which meet both surfaces at the same x and y.
    """
    hits = meet(0.0)
    jet = error.jet(hits.x.numpy(), hits.y.numpy())
    height = np.zeros_like(jet[0]) if most else jet[0]
    for _ in range(most):
        if np.abs(jet[0] - height).max(where=hits.hit.numpy(), initial=0.0) <= SETTLED:
            break
        height = jet[0]
        hits = meet(backend.array(height))
        jet = error.jet(hits.x.numpy(), hits.y.numpy())
    lifted, zx, zy = (backend.array(row) for row in (height, *jet[1:]))
    return replace(hits, z=hits.z + lifted, zx=hits.zx + zx, zy=hits.zy + zy)


def rim_fade(backend: Backend, point: Sequence[DrArray], outline: Outline, width: float) -> DrArray:
    """Return 1 inside an outline, falling to 0 at its rim by 3 s^2 - 2 s^3: in each direction of a rectangle,
    else with the gauge.

    point : x and y, mm.  width : of the fall, a fraction of the half-width.
    """
    dr, factor = backend.dr, 1.0
    if outline.is_rectangle:
        depths = [(h - dr.abs(a)) * (1 / (width * h)) for a, h in zip(point, outline.half_width)]
    else:
        depths = [(1 - gauge(backend, outline, *point)) * (1 / width)]
    for depth in depths:
        s = dr.clip(depth, 0, 1)
        factor = factor * (s * s * (3 - 2 * s))
    return factor


def gauge(backend: Backend, outline: Outline, x: DrArray, y: DrArray) -> DrArray:
    """Return `Outline.gauge` of points on the device, mm."""
    dr, opaque = backend.dr, backend.opaque
    u, v = (dr.abs(a) * opaque(1 / h) for a, h in zip((x, y), outline.half_width))
    straight = dr.maximum(u, v)
    if outline.is_rectangle:
        return straight
    rx, ry = outline.relative_corners
    p, q = (1 - rx) / rx, (1 - ry) / ry
    a, b = u * opaque(1 / rx), v * opaque(1 / ry)
    half, squares = a * opaque(p) + b * opaque(q), a * a + b * b
    at_corner = (v > u * opaque(1 - ry)) & (u > v * opaque(1 - rx))
    square = half * half - opaque(p * p + q * q - 1) * squares
    # elsewhere no root of zero may meet a derivative
    root = dr.sqrt(dr.select(at_corner & (square > 0), square, 1))
    return dr.select(at_corner, squares / dr.select(at_corner, half + root, 1), straight)


class KnownHits:
    """Parallel rays along z: x and y are known before, evaluation is one constant matrix.

    The rays form a grid, so the matrix is a Kronecker product of two sparse ones.  Rays beside the surface
    carry hit = False.

    x, y : mm, of all rays, (n,) Dr.Jit arrays; rays beside the surface are moved to its rim.
    """

    def __init__(
        self, backend: Backend, beam: RayGrid, conic: Conic, outline: Outline, knots: Sequence[KnotVector]
    ) -> None:
        dr, self._backend = backend.dr, backend
        self.shape = len(beam.x), len(beam.y)
        self._points = [np.clip(s, -h, h) for s, h in zip((beam.x, beam.y), outline.half_width)]
        self._matrices = [_value_and_slope(kv, s) for kv, s in zip(knots, self._points)]
        # along x: the number of the first function that is not zero, value and slope of each from there on
        (first, values), (_, slopes) = (knots[0].basis(self._points[0], order) for order in (0, 1))
        pairs = [(backend.array(value), backend.array(slope)) for value, slope in zip(values.T, slopes.T)]
        self._basis = backend.Index(first.astype(np.uint32)), pairs
        self._length = dr.opaque(backend.Index, self.shape[1])
        self._per_length = dr.opaque(backend.types.Float64, 1 / self.shape[1])
        self.x, self.y = (self._on_rays(row, axis) for axis, row in enumerate(self._points))
        self._hit = self._inside((beam.x, beam.y))
        if not outline.is_rectangle:
            self._hit &= gauge(backend, outline, self.x, self.y) <= 1
            dr.eval(self._hit)
        self._base = conic_jet(backend, conic, self.x, self.y)[:3]

    def meet(self, net: Floats) -> Hits:
        """Return the Hits of the beam with a sag net."""
        dr, leaves = self._backend.dr, self._jet(net)
        dr.enable_grad(*leaves)
        z, zx, zy = (base + leaf for base, leaf in zip(self._base, leaves))
        return Hits(
            x=self.x,
            y=self.y,
            z=z,
            zx=zx,
            zy=zy,
            found=dr.ones(dr.mask_t(self.x), 1),
            hit=self._hit,
            leaves=leaves,
            at=(self.x, self.y),
            dr=dr,
        )

    def jet(self, hits: Hits, net: Floats) -> tuple[DrArray, ...]:
        """Return z, zx, zy of a sag net alone at the meeting points."""
        return self._jet(net)

    def _jet(self, net: Floats) -> tuple[DrArray, ...]:
        """Return z, zx, zy of a net.

        y first, by matrices, since the net is much smaller than the grid; then x, at every ray on the device.
        """
        dr, backend = self._backend.dr, self._backend
        values, slopes = (backend.array((b @ net.T).T) for b in self._matrices[1])
        first, functions = self._basis
        ray, line = self._rays()
        at = (dr.gather(backend.Index, first, line) - line) * self._length + ray
        z, zx, zy = (dr.zeros(backend.Float, dr.width(ray)) for _ in range(3))
        for k, (weights, derivatives) in enumerate(functions):
            value, slope = (dr.gather(backend.Float, row, at + k * self._length) for row in (values, slopes))
            weight, derivative = (dr.gather(backend.Float, row, line) for row in (weights, derivatives))
            z, zx, zy = z + weight * value, zx + derivative * value, zy + weight * slope
        dr.schedule(z, zx, zy)  # evaluated with what first needs them, and kept for the way back
        return z, zx, zy

    def _rays(self) -> tuple[DrArray, DrArray]:
        """Return the numbers of the rays, and those of their lines along y."""
        ray = self._backend.dr.arange(self._backend.Index, self.shape[0] * self.shape[1])
        # exact, and far faster than a division of integers
        line = self._backend.Index((self._backend.types.Float64(ray) + 0.5) * self._per_length)
        return ray, line

    def _on_rays(self, row: Floats, axis: int) -> DrArray:
        """Return numbers along x (0) or y (1) of every ray; they are looked up again in every kernel."""
        ray, line = self._rays()
        index = line if axis == 0 else ray - line * self._length
        return self._backend.dr.gather(self._backend.Float, self._backend.array(row), index)

    def _inside(self, beam: Sequence[Floats]) -> DrArray:
        """Return which rays meet the surface, and not its rim."""
        dr = self._backend.dr
        inside = [np.equal(row, at) for row, at in zip(self._points, beam)]
        if all(row.all() for row in inside):
            return dr.ones(dr.mask_t(self._backend.Float), dr.width(self.x))
        x, y = (self._on_rays(row.astype(float), axis) for axis, row in enumerate(inside))
        return (x > 0) & (y > 0)

    def pull_back(self, hits: Hits, knots: Sequence[KnotVector] | None = None) -> Floats:
        """Return dL/dC on the surface's knots, or on other knots over the same rectangle."""
        matrices = self._matrices
        if knots is not None:
            matrices = [_value_and_slope(kv, s) for kv, s in zip(knots, self._points)]
        (a0, a1), (b0, b1) = matrices
        gz, gx, gy = (g.numpy().reshape(self.shape) for g in hits.taken_gradients())
        along = a0.T @ gz + a1.T @ gx
        return (b0.T @ along.T + b1.T @ (a0.T @ gy).T).T


def _value_and_slope(kv: KnotVector, points: Floats) -> tuple[csr_array, csr_array]:
    return kv.collocation(points), kv.collocation(points, 1)
