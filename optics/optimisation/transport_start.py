"""The surface to start from: optimal transport, Snell's law, and a fit of slopes in THB space.

The light of a source without extent has one direction at every point of the rear surface.  Optimal
transport from its density there to the target tells where each point should send it, Snell's law
which slope does so.  Where the rays spread inside the lens, density and directions depend on the
shape that is looked for; they are traced again on the shape found, a few times.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import isinf
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.sparse.linalg import LinearOperator, cg

from optics.optimisation.indicators import summed_over_cells
from optics.optimisation.optimal_transport import transport
from optics.system import problem_rays, source_profile, target_irradiance, target_screen
from optics.target import BSplineWindow, Screen, Splat
from optics.tracing import Tracer
from thbcad.hierarchy import MultilevelBasis
from thbcad.lens import require_sound
from thbcad.surfaces import THBSurface

if TYPE_CHECKING:
    from optics.problem import Problem
    from optics.runtime import Backend
    from thbcad.hierarchy import THBSpace
    from thbcad.lens import FreeformSurface, Lens

SNELL_STEPS = 4
TRACED_STEPS = 3  # of tracing to the shape found and finding another
FIT_STEPS = 60
CELLS_PER_PIXEL = 2
LEAST_CELLS, MOST_CELLS = 64, 512
MOST_TRACED = 256  # cells where the rays are traced, RAYS_PER_CELL in each direction
RAYS_PER_CELL = 4
INSIDE = 0.97  # of z_freedom
HALVINGS = (
    20  # at most, of a sag that crosses the front: the gap is linear in the sag and positive without it
)
DARK = 1e-3  # of the greatest irradiance: nothing is sent there
LEAST_WEIGHT = 1e-3  # of cells without light
STEEPEST = 0.15  # least z of the normal's vector: steeper slopes are not asked for

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Bundle:
    """Light at the rear surface, on a grid of cells.

    x, y : (nx,), (ny,) cell centres, mm.  direction : three arrays (nx, ny), unit vectors inside the lens.
    emitted : called with (nx, ny), returns the density of flux on such a grid.  weight : (nx, ny), of the
        slopes in a fit.
    """

    x: Floats
    y: Floats
    direction: Sequence[Floats]
    emitted: Callable[[tuple[int, ...]], Floats]
    weight: Floats


class TransportStart:
    """Rear slopes that send the light of a source without extent to the target.

    A Lambertian source is taken as a point in its middle.  `fit` gives the sag with these slopes in any THB
    space.
    parallel : the rays are parallel inside the lens.
    """

    def __init__(self, problem: Problem, lens: Lens, light: Floats, backend: Backend) -> None:
        self._problem, self._lens = problem, lens
        screen = target_screen(problem)
        self._lit, self._centre, self._half = _lit_part(
            target_irradiance(light, screen, problem.target.placing, 1.0), screen
        )
        self._cells = [int(np.clip(CELLS_PER_PIXEL * n, LEAST_CELLS, MOST_CELLS)) for n in screen.pixels]
        self._bound = INSIDE * problem.lens.rear.freeform.z_freedom
        self.reach, self.crosses = 0.0, False
        self._bundle: Bundle
        self._slopes: list[Floats]
        self.parallel = (
            problem.source.kind == "collimated" and lens.front.sag is None and lens.front.conic.is_plane
        )
        if self.parallel:
            self._shape_parallel()
        else:
            self._cells = [min(n, MOST_TRACED) for n in self._cells]
            self._shape_traced(backend)

    def fit(self, space: THBSpace) -> THBSurface:
        """Return the sag in a THB space over x, y in mm; `reach` keeps the greatest |c| it asked for.

        A sag that exceeds z_freedom or crosses the front is scaled down, which moves the light part of the
        way.
        """
        bundle = self._bundle
        sag = fit_slopes(space, bundle.x, bundle.y, *self._slopes, bundle.weight)
        self.reach, self.crosses = float(np.abs(sag.coefficients).max()), False
        kept = sag.coefficients * min(1.0, self._bound / self.reach) if self.reach else sag.coefficients
        for _ in range(HALVINGS):
            try:
                require_sound(self._lens.with_rear(self._lens.rear.with_sag(THBSurface(space, kept))))
                break
            except ValueError:
                kept, self.crosses = kept / 2, True
        return THBSurface(space, kept)

    def misfit(self, sag: THBSurface) -> Floats:
        """Return the sum over every leaf cell of the squared deviation of a sag's slopes from those asked
        for, (n_cells,)."""
        bundle, (zx, zy) = self._bundle, self._slopes
        deviation = (sag.grid(bundle.x, bundle.y, (1, 0)) - zx) ** 2 + (
            sag.grid(bundle.x, bundle.y, (0, 1)) - zy
        ) ** 2
        return summed_over_cells(sag.space, bundle.x, bundle.y, bundle.weight * deviation)

    @property
    def within(self) -> bool:
        """Whether the sag of the last fit kept to z_freedom and clear of the front."""
        return self.reach <= self._bound and not self.crosses

    @property
    def note(self) -> str:
        """A sentence for the user where z_freedom or the thickness is too small for the transport map, or
        ""."""
        if self.within:
            return ""
        asked = f"the transport map asks for a sag of +-{self.reach:.3g} mm"
        if self.reach > max(self._lens.rear.half_width):
            return f"{asked}, more than the lens is wide: are the units right, is the target within reach?"
        if self.crosses:
            return f"{asked}, which would bring the rear to the front; raise lens.thickness for better light"
        return (
            f"{asked}, more than z_freedom allows; raise lens.rear.freeform.z_freedom above "
            f"{self.reach / INSIDE:.3g} for better light"
        )

    def _shape_parallel(self) -> None:
        """Find the slopes for parallel rays: density and directions do not depend on the rear's shape."""
        source, lens = self._problem.source, self._lens
        half = [min(s, f) for s, f in zip(source.half_width, lens.front.half_width)]
        profile, reach = source_profile(self._problem), [b / s for b, s in zip(half, source.half_width)]

        def emitted(grid: tuple[int, ...]) -> Floats:
            s, t = (r * ((2 * np.arange(n) + 1) / n - 1) for n, r in zip(grid, reach))
            return profile(s[:, None], t[None, :])

        x, y = _centres(half, self._cells)
        along = np.zeros(self._cells)
        self._bundle = Bundle(x, y, (along, along, along + 1), emitted, np.ones(self._cells))
        arrival = self._arrival(self._bundle, half)
        height = lens.thickness + lens.rear.conic(x[:, None], y[None, :])
        for _ in range(SNELL_STEPS):
            slopes, _ = self._snell(self._bundle, arrival, height)
            height = lens.thickness + _integrated(*slopes, x, y)
        self._slopes = self._above_conic(lens.rear, slopes)

    def _shape_traced(self, backend: Backend) -> None:
        """Find the slopes for rays that spread inside the lens, on the sag's own mesh refined once or
        twice."""
        lens = self._lens
        space = lens.rear.sag.space
        for level in range(min(2, self._problem.lens.rear.freeform.max_level)):
            space = space.refine({level: space.cells[:, 1:]})
        sag = THBSurface(space, np.zeros(space.dim))
        for _ in range(TRACED_STEPS):
            lens = lens.with_rear(lens.rear.with_sag(sag))
            self._bundle = _traced_bundle(backend, self._problem, lens, self._cells)
            x, y = self._bundle.x, self._bundle.y
            slopes, sound = self._snell(
                self._bundle,
                self._arrival(self._bundle, lens.rear.half_width),
                lens.thickness + lens.rear.grid(x, y),
            )
            sound &= self._bundle.weight > LEAST_WEIGHT
            self._slopes = [np.where(sound, s, 0.0) for s in self._above_conic(lens.rear, slopes)]
            self._bundle = replace(self._bundle, weight=np.where(sound, self._bundle.weight, LEAST_WEIGHT))
            sag = self.fit(space)

    def _arrival(self, bundle: Bundle, half: Sequence[float]) -> tuple[Floats, Floats]:
        """Return the target coordinates (mm, or degrees in the far field) to which transport sends the
        bundle's cells."""

        def density(grid: tuple[int, ...]) -> Floats:
            pixels = min(grid[0], self._lit.shape[1]), min(grid[1], self._lit.shape[0])
            return target_irradiance(self._lit, Screen(self._half, pixels), "stretch", 1.0)[::-1].T

        aspect = np.sqrt(half[0] * self._half[0] / (half[1] * self._half[1]))
        found = transport(density, self._cells, aspect, bundle.emitted)
        return self._centre[0] + self._half[0] * found.tx, self._centre[1] + self._half[1] * found.ty

    def _snell(
        self, bundle: Bundle, arrival: Sequence[Floats], height: Floats
    ) -> tuple[tuple[Floats, Floats], NDArray[np.bool_]]:
        """Return the slopes (zx, zy) that refract the bundle towards the arrival points, and where they are
        not too steep.

        The normal lies along n d_in - d_out.
        """
        if isinf(self._problem.target_z):
            dx, dy = (np.tan(np.radians(a)) for a in arrival)
            dz = np.ones_like(dx)
        else:
            dx, dy, dz = (
                arrival[0] - bundle.x[:, None],
                arrival[1] - bundle.y[None, :],
                self._problem.target_z - height,
            )
        length = np.sqrt(dx * dx + dy * dy + dz * dz)
        normal = [self._lens.index * a - d / length for a, d in zip(bundle.direction, (dx, dy, dz))]
        sound = normal[2] > STEEPEST
        across = np.where(sound, normal[2], 1.0)
        return (-normal[0] / across, -normal[1] / across), sound

    def _above_conic(self, rear: FreeformSurface, slopes: Sequence[Floats]) -> list[Floats]:
        x, y = self._bundle.x[:, None], self._bundle.y[None, :]
        return [s - rear.conic(x, y, d) for s, d in zip(slopes, ((1, 0), (0, 1)))]


def _traced_bundle(backend: Backend, problem: Problem, lens: Lens, cells: Sequence[int]) -> Bundle:
    """Return the light of the problem's source, taken without extent, as it meets a lens's rear."""
    source = problem.source
    if source.kind == "lambertian":
        problem = replace(problem, source=replace(source, kind="point", exponent=1.0))
    rays = problem_rays(problem, [RAYS_PER_CELL * n + 1 for n in cells])
    with backend.dr.suspend_grad():
        hits, direction, flux = Tracer(backend, lens, rays, problem.target_z).at_rear(
            [sag.coefficients for sag in lens.sags]
        )

    def density(grid: Sequence[int], carried: object) -> Floats:
        screen = Screen(lens.rear.half_width, (grid[0], grid[1]))
        image = Splat(backend, screen, BSplineWindow(2))(hits.x, hits.y, carried).numpy()
        return image.reshape(screen.shape, order="F")[::-1].T

    emitted = density(cells, flux)
    dark = emitted <= DARK * emitted.mean()
    nearest = tuple(distance_transform_edt(dark, return_distances=False, return_indices=True))
    mean = [(density(cells, flux * d) / np.where(dark, 1.0, emitted))[nearest] for d in direction]
    weight = np.where(dark, 0.0, np.minimum(emitted / emitted.mean(), 1.0))
    return Bundle(
        *_centres(lens.rear.half_width, cells),
        mean,
        lambda grid: density(grid, flux),
        np.maximum(weight, LEAST_WEIGHT),
    )


def _centres(half: Sequence[float], cells: Sequence[int]) -> tuple[Floats, Floats]:
    x, y = (h * ((2 * np.arange(n) + 1) / n - 1) for h, n in zip(half, cells))
    return x, y


def _lit_part(image: Floats, screen: Screen) -> tuple[Floats, tuple[float, float], tuple[float, float]]:
    """Return the least rectangle of an irradiance that holds all light but for DARK of the greatest, its
    centre and half-widths, mm."""
    bright = image > DARK * image.max()
    rows, columns = (np.flatnonzero(bright.any(axis=axis)) for axis in (1, 0))
    (hx, hy), (r0, r1, c0, c1) = screen.half_width, (rows[0], rows[-1] + 1, columns[0], columns[-1] + 1)
    wide, tall = hx / image.shape[1], hy / image.shape[0]  # half a pixel
    centre = float((c0 + c1) * wide - hx), float(hy - (r0 + r1) * tall)
    return image[r0:r1, c0:c1], centre, (float((c1 - c0) * wide), float((r1 - r0) * tall))


def _integrated(zx: Floats, zy: Floats, x: Floats, y: Floats) -> Floats:
    """Return a height whose slopes are about (zx, zy), zero in the middle.

    Trapezoids along the middle row and from there along the columns: good enough for
    distances, the fit itself uses the slopes.
    """
    i, j = len(x) // 2, len(y) // 2
    along = np.concatenate([[0.0], np.cumsum((zx[1:, j] + zx[:-1, j]) / 2 * np.diff(x))])
    across = np.concatenate(
        [np.zeros((len(x), 1)), np.cumsum((zy[:, 1:] + zy[:, :-1]) / 2 * np.diff(y), axis=1)], axis=1
    )
    return (along - along[i])[:, None] + across - across[:, j : j + 1]


def fit_slopes(space: THBSpace, x: Floats, y: Floats, zx: Floats, zy: Floats, weight: Floats) -> THBSurface:
    """Return the THB surface over x, y in mm whose slopes fit (zx, zy) on a grid best.

    weight : (nx, ny), of the squares.  Least squares by conjugate gradients in the multilevel system.  The
        constant that slopes
    leave open is chosen so that the greatest and the least coefficient are opposite.
    """
    basis, embedding = MultilevelBasis(space), space.embedding
    (a0, a1), (b0, b1) = (
        (kv.collocation(s), kv.collocation(s, 1)) for kv, s in ((embedding.kv_u, x), (embedding.kv_v, y))
    )
    a0t, a1t, b0t, b1t = (m.T.tocsr() for m in (a0, a1, b0, b1))

    def transposed(gx: Floats, gy: Floats) -> Floats:
        net = a1t @ (b0t @ gx.T).T + a0t @ (b1t @ gy.T).T
        return basis.adjoint(embedding.adjoint(net))

    def normal(weights: Floats) -> Floats:
        net = embedding.coefficients(basis.coefficients(weights))
        return transposed(weight * (b0 @ (a1 @ net).T).T, weight * (b1 @ (a0 @ net).T).T)

    system = LinearOperator((basis.size, basis.size), matvec=normal, dtype=np.float64)
    weights, _ = cg(system, transposed(weight * zx, weight * zy), rtol=1e-8, maxiter=FIT_STEPS)
    c = basis.coefficients(weights)
    return THBSurface(space, c - (c.max() + c.min()) / 2)
