"""The light of a perturbed lens: by the same cells for all, of extended sources by a fixed set of rays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cached_property, partial, reduce
from math import isqrt
from operator import add

import numpy as np

from optics.base.runtime import Backend
from optics.light.analysis import REPLICATES, Light, LightEstimate, box_screen, coloured, traced_cells
from optics.light.measuring import Splat
from optics.light.tracing import Landing, SequentialFates, Tracer
from optics.scene.paths import SlopeErrors
from optics.scene.receivers import BoxWindow
from optics.scene.sources import RayGrid, Rays, SourceCells
from optics.scene.system import System, require_light_of_one_lens
from optics.tolerancing.perturbations.perturbation import NOMINAL, Perturbation
from optics.tolerancing.perturbations.perturbed_parts import PerturbedParts, perturbed_media
from thbcad.checks import Floats
from thbcad.poses import Pose

Trace = Callable[["RayGrid | Rays"], tuple[Tracer, "Landing"]]

# in each direction: with 3 on pearl.toml rel_l2 is off by 2e-4, less than a hundredth of what 0.1 mm changes
CELLS_PER_PIXEL, LEAST_CELLS = 3, 128
RAYS_PER_PIXEL = 32  # half a gigabyte of them on 512^2 pixels
RAYS_AT_ONCE = 1 << 19  # more only take more memory
CORNERS_AT_ONCE = 1 << 18  # two processes side by side take 0.7 GB then; half of it takes twice the time
FRESH = 3  # stream of random numbers: rays that the optimiser has not fitted
WIDER = 1.05  # of the front: as far as cells of a wider beam reach, so that the front's rim cuts them
HEIGHTS = 33  # of the front, in each direction: how far it reaches up and down
SHIFT_RAYS = (65, 65)  # which tell how far light moves


class PerturbedLight:
    """The map from a Perturbation to the light on the target; what never changes is built once.

    Light goes by the faces of the path alone.  Every call traces the same cells or rays, which the optimiser
    has not seen, so that differences of light are those of the perturbations; where a parallel beam moves, as
    many, where it meets the first.

    backend : of double precision.  per_pixel : cells in each direction, or rays; None is the usual number.
    floats : the target follows the light, see `aimed`.

    Raises UserError : a plate before a plane, whose light is the sum over its lenses.
    """

    def __init__(
        self, system: System, backend: Backend, per_pixel: int | None = None, floats: bool = False
    ) -> None:
        require_light_of_one_lens(system, "tolerances")
        self.system, self.backend, self.floats = system, backend, floats
        self.screen, boxes = system.target.screen(), box_screen(system)
        self._screens = [self.screen] if boxes is None else [self.screen, boxes]
        self.by_cells = not (system.source.extended or system.blurred)
        self._shown = self.screen.projection()
        path = system.path
        self._media = [(weight, one.media) for weight, one in coloured(system, path)]
        self._first, self._before = path.surfaces[0], path.before
        pixels, self._shaded = self.screen.pixels, not system.axial
        if self.by_cells:
            counts = [max(LEAST_CELLS, (per_pixel or CELLS_PER_PIXEL) * n) for n in pixels]
            self._counts = counts
            self.cells: SourceCells = system.source.cells(counts, *self._lit(self.parts(NOMINAL), WIDER))
        else:
            rays = (per_pixel or RAYS_PER_PIXEL) * pixels[0] * pixels[1]
            self._counts = 2 * [isqrt(rays // REPLICATES) + 1]
            self._draw()
        self._shaded = self._shaded and self()[1].blocked > 0

    def _draw(self) -> None:
        """Take replicates of rays of the source, with errors of slopes."""
        fresh = self._fresh(REPLICATES)
        sets = self.system.source.replicates(REPLICATES, self._counts, fresh, RAYS_AT_ONCE)
        self._rays = [list(parts) for parts in sets]
        self._errors = [[self._slope_errors(rays.flux.size, fresh) for rays in parts] for parts in self._rays]

    def _slope_errors(self, rays: int, fresh: np.random.Generator) -> SlopeErrors:
        """Return the errors of the slopes of all surfaces where rays meet them."""
        return [fresh.normal(0, rms, (2, rays)) if rms else None for rms in self.system.slope_rms]

    def _fresh(self, replicate: int) -> np.random.Generator:
        return np.random.default_rng((self.system.problem.run.seed, FRESH, replicate))

    def __call__(self, perturbation: Perturbation = NOMINAL) -> tuple[Floats, SequentialFates]:
        """Return (irradiance (rows, columns), W/mm^2, in the far field W/degree^2; flux by fate, W)."""
        light, fates = self.estimate(perturbation)
        return light.irradiance / self._shown, fates

    def estimate(self, perturbation: Perturbation = NOMINAL) -> tuple[LightEstimate, SequentialFates]:
        """Return (flux per du dv on the target's pixels and boxes, flux by fate, W)."""
        colours = self.colours(self.aimed(perturbation))
        lights = [(weight, *self._light(parts)) for weight, parts, _ in colours]
        return (
            reduce(add, (light * weight for weight, light, _ in lights)),
            reduce(add, (fates * weight for weight, _, fates in lights)),
        )

    def parts(self, perturbation: Perturbation) -> PerturbedParts:
        """Return the perturbed parts.  Bodies that take none of the design's light are left out."""
        return PerturbedParts.of(self.system, perturbation, self._shaded)

    def moved_by(self, perturbation: Perturbation) -> float:
        """Return how far light moves on the target, flux-weighted mean, mm (degrees in the far field)."""
        apart, flux = self._moves(perturbation)
        return float((flux * np.hypot(*apart)).sum() / flux.sum()) if flux.any() else 0.0

    def aimed(self, perturbation: Perturbation) -> Perturbation:
        """Return it with the target moved as far as the light is on average, where the target follows it.

        The target moves in its own plane, and in the far field it turns.  The average is over the flux of the
        light that the design brings to the target.
        """
        if not self.floats:
            return perturbation
        apart, flux = self._moves(perturbation)
        flux = np.where((np.abs(self._at_rest[:2].T) <= self.screen.half_width).all(axis=1), flux, 0.0)
        dx, dy = ((flux * apart).sum(axis=1) / (flux.sum() or 1.0)).tolist()
        if self.system.target.far_field:
            return perturbation + Perturbation(target_tilt=(-np.radians(dy), np.radians(dx), 0.0))
        tilted = Pose.at(rotation_vector=perturbation.target_tilt)
        x, y, z = tilted.directions(np.array((dx, dy, 0.0))).tolist()
        return perturbation + Perturbation(target_shift=(x, y, z))

    def _moves(self, perturbation: Perturbation) -> tuple[Floats, Floats]:
        """Return how far single rays move on the target, (2, n), and their flux, (n,), 0 where they miss."""
        before, behind = self._at_rest, self._landed(perturbation)
        flux = np.where((before[2] > 0) & (behind[2] > 0), before[2], 0.0)
        return np.where(flux > 0, behind[:2] - before[:2], 0.0), flux

    @cached_property
    def _at_rest(self) -> Floats:
        return self._landed(NOMINAL)

    def _landed(self, perturbation: Perturbation) -> Floats:
        """Return x, y and flux of single rays on the target, (3, n)."""
        parts = self.parts(perturbation)
        _, landing = self.trace_through(parts)(parts.rays(self._single_rays))
        return np.array([a.numpy() for a in (landing.x, landing.y, landing.flux)])

    @cached_property
    def _single_rays(self) -> Rays:
        return self.system.source.rays(SHIFT_RAYS).rays(self._before)

    def colours(self, perturbation: Perturbation) -> Iterator[tuple[float, PerturbedParts, Trace]]:
        """Yield weight, parts, and what traces rays through them, of every wavelength."""
        parts = self.parts(perturbation)
        for weight, media in self._media:
            path = parts.path.in_media(perturbed_media(self.system, media, perturbation))
            coloured = replace(parts, path=path)
            yield weight, coloured, self.trace_through(coloured)

    def on_lens(self, perturbation: Perturbation, s: Floats, t: Floats) -> Floats:
        """Return x and y, (2, n, m) mm, where rays from s (n,) and t (m,) of the source meet the last free
        surface; NaN where they miss it."""
        _, parts, trace = next(self.colours(perturbation))
        every_s, every_t = (v.ravel() for v in np.meshgrid(s, t, indexing="ij"))
        rays = parts.rays(self.cells.at(every_s, every_t, np.ones(every_s.size)))
        tracer, _ = trace(rays)
        with self.backend.dr.suspend_grad():
            hits, _, flux = tracer.at(parts.path.shaped)
        at = [np.where(flux.numpy() > 0, v.numpy(), np.nan) for v in (hits.x, hits.y)]
        return np.reshape(at, (2, len(s), len(t)))

    def trace_through(self, parts: PerturbedParts, errors: SlopeErrors | None = None) -> Trace:
        """Return what traces rays through perturbed parts, whose slopes may err."""
        backend, path = self.backend, parts.path.with_slope_errors(errors) if errors else parts.path

        def trace(rays: RayGrid | Rays) -> tuple[Tracer, Landing]:
            tracer = Tracer(backend, path, rays)
            return tracer, tracer.landed()

        return trace

    def _light(self, parts: PerturbedParts) -> tuple[LightEstimate, SequentialFates]:
        """Return the light of one wavelength, as if it had all of the flux."""
        if self.by_cells:
            cells = parts.cells(self._cells_of(parts))
            trace = self.trace_through(parts)
            images, fate = traced_cells(trace, self._screens, cells, self.backend, CORNERS_AT_ONCE)
            if not cells.parallel:  # such rays do not know of the light that has none
                fate = fate.and_missing(cells.missed)
            return LightEstimate.exact(Light.of(images, fate.on_target, fate.off_target)), fate
        lights, fates = zip(*map(partial(self._light_of_rays, parts), range(REPLICATES)))
        return LightEstimate.of_replicates(lights), reduce(add, fates) / REPLICATES

    def _light_of_rays(self, parts: PerturbedParts, replicate: int) -> tuple[Light, SequentialFates]:
        """Return the light of one replicate of the rays, and its flux by fate."""
        splats = [Splat(self.backend, screen, BoxWindow()) for screen in self._screens]
        images, fates = [np.zeros(screen.shape) for screen in self._screens], []
        for part, errors in zip(self._rays_of(parts, replicate), self._errors[replicate]):
            rays = parts.rays(part.rays(self._before))
            tracer, landing = self.trace_through(parts, errors)(rays)
            with self.backend.dr.suspend_grad():
                for image, splat in zip(images, splats):
                    light = splat(landing.x, landing.y, landing.flux).numpy()
                    image += light.reshape(image.shape, order="F")
            fate = tracer.fates(landing, self.screen.half_width)
            missed = part.missed if isinstance(part, RayGrid) else 0.0
            fates.append(fate.and_missing(missed))
        every = reduce(add, fates)
        return Light.of(images, every.on_target, every.off_target), every

    def _rays_of(self, parts: PerturbedParts, replicate: int) -> Iterable[RayGrid | Rays]:
        """Return rays of the source, before it moves; of a parallel beam those that meet the first face."""
        source = self.system.source
        if not source.collimated:
            return self._rays[replicate]
        return source.parts(self._counts, self._fresh(replicate), RAYS_AT_ONCE, *self._lit(parts, 1.0))

    def _cells_of(self, parts: PerturbedParts) -> SourceCells:
        """Return cells of the source, before it moves; of a parallel beam those that meet the first face."""
        source, first = self.system.source, parts.path.surfaces[0]
        rests = parts.source.is_identity and parts.size == 1.0 and first.pose == self._first.pose
        if rests or not source.collimated:
            return self.cells
        return source.cells(self._counts, *self._lit(parts, WIDER))

    def _lit(self, parts: PerturbedParts, wider: float) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return (half-widths, middle) of a rectangle in a parallel beam, mm.

        wider : times the rectangle in which the surface that light meets first lies there.
        """
        hx, hy = parts.half_width
        box = np.meshgrid((-hx, hx), (-hy, hy), self._heights)
        to_source = parts.source.inverse() @ parts.path.surfaces[0].pose
        x, y, _ = to_source.points((box[0], box[1], box[2]))
        (a, b), (c, d) = ((v.min() / parts.size, v.max() / parts.size) for v in (x, y))
        return (wider * (b - a) / 2, wider * (d - c) / 2), ((a + b) / 2, (c + d) / 2)

    @cached_property
    def _heights(self) -> tuple[float, float]:
        """Least and greatest z of the surface that light meets first, mm."""
        shape = self._first.shape
        hx, hy = shape.half_width
        x, y = np.meshgrid(np.linspace(-hx, hx, HEIGHTS), np.linspace(-hy, hy, HEIGHTS))
        z = shape(x.ravel(), y.ravel())
        return float(z.min()), float(z.max())
