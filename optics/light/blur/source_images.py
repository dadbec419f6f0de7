"""The images of the source that a designed lens throws through patches of its rear (thesis 7.5, outlook)."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from optics.base.runtime import Backend
from optics.light.blur.convolution import blur_of
from optics.light.tracing import Tracer
from optics.scene.sources import LightSource
from optics.scene.system import System
from thbcad.checks import Bools, Floats, Integers

PATCHES = 16  # in each direction, over the rear
FEWER_PATCHES = PATCHES, 8, 4, 2  # of which the first are taken that know most of the light
RAYS = (2048, 512)
EVEN_WIDTH = sqrt(12)  # of an even spot, in its standard deviation
FEWER_RAYS = (512, 512)  # for the mean over all patches
LEAST_RAYS = 100  # per patch, for its image to be measured
MOST = 0.5  # of the light


@dataclass(frozen=True, eq=False)
class PatchImages:
    """Images of the source through patches of the rear; the first index of a patch goes with x.

    flux : (n, n), W
    width : (2, n, n), mm (degrees in the far field), sqrt(12) times the rms deviation in x and in y, which is
        the side of a uniform rectangle; NaN where too few rays pass
    """

    flux: Floats
    width: Floats

    def smallest(self, fraction: float) -> float:
        """Return the area of an image that this fraction of the light has at most, mm^2 or square degrees."""
        area = np.prod(self.width, axis=0)
        known = np.isfinite(area)
        order = np.argsort(area[known])
        light = np.cumsum(self.flux[known][order])
        return float(area[known][order][np.searchsorted(light, fraction * light[-1])])


def spot_rms(system: System, backend: Backend) -> float:
    """Return how far the light of one point of the rear spreads on the target, mm; in the far field degrees.

    It is the rms deviation in one direction, of x and y together: sqrt((sx^2 + sy^2) / 2).  Of a source with
    extent it is the median over the lens, by flux: near total reflection light is thrown any distance.  It is
    0 of a source without extent and divergence, behind smooth surfaces.  Of several sources it is the
    greatest of any one.  backend : of double precision.
    """
    if system.blurred:
        return blur_of(system, system.path, backend).rms
    extended = [source for source in system.source.each if source.extended]
    return max((_spot_rms(system, source, backend) for source in extended), default=0.0)


def _spot_rms(system: System, source: LightSource, backend: Backend) -> float:
    images, known = _known_images(system, source, backend)
    if not known.any():
        return 0.0
    deviations, flux = np.sqrt(np.mean(images.width[:, known] ** 2, axis=0)) / EVEN_WIDTH, images.flux[known]
    order = np.argsort(deviations)
    light = np.cumsum(flux[order])
    return float(deviations[order][np.searchsorted(light, light[-1] / 2)])


def _known_images(system: System, source: LightSource, backend: Backend) -> tuple[PatchImages, Bools]:
    """Return the images through as many patches as know most of the light, and which of them are known.

    A ray file holds few rays, and of a wide source few meet the lens.
    """
    for patches in FEWER_PATCHES:
        images = patch_images(system, backend, FEWER_RAYS, source, patches)
        known = np.isfinite(images.width).all(axis=0) & (images.flux > 0)
        if images.flux[known].sum() > MOST * images.flux.sum():
            break
    return images, known


def spot_width(system: System, backend: Backend) -> float:
    """Return the full width of the light of one point of the rear, mm; in the far field degrees; 0 if sharp.

    It is that of `Blur.width`; of an extended source that of an even spot with the deviation of `spot_rms`.
    """
    if system.blurred:
        return blur_of(system, system.path, backend).width
    return EVEN_WIDTH * spot_rms(system, backend)


def patch_images(
    system: System,
    backend: Backend,
    rays: tuple[int, int] = RAYS,
    source: LightSource | None = None,
    patches: int = PATCHES,
) -> PatchImages:
    """Trace rays from the whole source and return the PatchImages of a lens.

    backend : of double precision.  rays : their product counts.  source : one of several; None is all.
    patches : in each direction.

    The position in a patch at which a ray leaves the last surface moves its image.  A quadratic in this
    position is fitted to the landing points of every patch, weighted by flux, and subtracted; the rest is the
    image.
    """
    path = system.path
    tracer, last = Tracer(backend, path, (source or system.source).rays(rays)), len(path.surfaces) - 1
    with backend.dr.suspend_grad():
        hits, _, _ = tracer.at(last)
        _, landing = tracer.trace()
        values = [hits.x, hits.y, landing.x, landing.y, landing.flux]
        backend.dr.eval(values)
    x, y, *arrival, flux = (a.numpy() for a in values)
    lit = flux > 0
    positions = [(a[lit] / h + 1) / 2 * patches for a, h in zip((x, y), path.surfaces[last].shape.half_width)]
    cells = [np.clip(np.floor(a).astype(int), 0, patches - 1) for a in positions]
    within = [2 * (a - c) - 1 for a, c in zip(positions, cells)]
    patch = cells[0] * patches + cells[1]
    squares = _residual_squares(patch, within, [a[lit] for a in arrival], flux[lit], patches**2)
    width = np.sqrt(12 * np.maximum(squares, 0)).reshape(2, patches, patches)
    total = np.bincount(patch, flux[lit], patches**2).astype(np.float64).reshape(patches, patches)
    return PatchImages(total, width)


def _residual_squares(
    patch: Integers, within: list[Floats], arrival: list[Floats], flux: Floats, count: int
) -> Floats:
    """Return the mean squares that a quadratic fit in every one of `count` patches leaves, (2, count)."""

    def summed(values: Floats) -> Floats:
        return np.asarray(np.bincount(patch, values, count), dtype=np.float64)

    a, b = within
    basis = [np.ones_like(a), a, b, a * a, a * b, b * b]
    known = np.bincount(patch, minlength=count) >= LEAST_RAYS
    normal = np.stack([[summed(flux * s * t) for t in basis] for s in basis])[..., known].transpose(2, 0, 1)
    squares = np.full((2, count), np.nan)
    total = summed(flux)
    for k, landed in enumerate(arrival):
        off = landed - (summed(flux * landed) / np.where(total > 0, total, 1.0))[patch]
        right = np.stack([summed(flux * s * off) for s in basis])[:, known].T
        fit = np.zeros((count, len(basis)))
        fit[known] = np.linalg.solve(normal, right[..., None])[..., 0]
        left = off - sum(fit[patch, i] * s for i, s in enumerate(basis))
        squares[k, known] = summed(flux * left**2)[known] / total[known]
    return squares
