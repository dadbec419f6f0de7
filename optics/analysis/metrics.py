"""What the lens delivers, measured in float64 on box pixels, with light that the optimiser has not seen.

Light of one direction at every point of the source is measured as cells (`light_of_cells`), exact but for
their size.  That of an extended source is measured as rays of two scrambled Sobol sequences.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import reduce
from math import isqrt, sqrt
from operator import add
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from optics.analysis.light_of_cells import cell_irradiance
from optics.target import PixelWindow, Splat
from optics.tracing import Tracer

if TYPE_CHECKING:
    from optics.runtime import Backend, DrArray
    from optics.system import OpticalSystem
    from optics.target import Screen
    from optics.tracing import SequentialFates
    from thbcad.lens import Lens

CELLS_PER_PIXEL, CELLS_PER_SPAN = 8, 6  # in each direction
LEAST_CELLS = 64
COARSER = 2  # the second grid, with which the first is compared
ORDER = 1.05  # of the error in the number of cells; 1 of the map, 1.5 of what pixel borders cut: measured
RAYS_PER_PIXEL = 11  # of extended sources, in each direction, for each of the two ray sets
BLUR = 0.5 / RAYS_PER_PIXEL  # pixels: a ray that lands so near to a border counts for both pixels
LEAST_PER_PIXEL, MOST_RAYS = 3, 4096  # on large screens: so many per pixel, or so many per direction
DARK = 0.01  # of the greatest irradiance: what counts as dark
RAYS_AT_ONCE = 1 << 19  # more only take more memory

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Measurement:
    """What a lens delivers.

    irradiance, target : (rows, columns), W/mm^2; in the far field intensities
    metrics : numbers by name
    """

    irradiance: NDArray[np.float64]
    target: NDArray[np.float64]
    metrics: dict[str, Any]


def measure(system: OpticalSystem, lens: Lens, backend: Backend) -> Measurement:
    """Return the Measurement of a lens.  backend : of double precision.

    `rel_l2_floor` is the estimator's own error of the irradiance, relative to the target: from two grids of
    cells, whose errors fall with the square of the cells' size, or from two sets of rays.
    """
    screen, flux = system.target.screen(), system.problem.source.flux
    estimate = _by_rays if system.source.extended else _by_cells
    irradiance, error, by_fate = estimate(system, lens, screen, backend)
    target = system.target.irradiance(screen, by_fate.transmitted)
    shown = screen.projection()  # in the far field intensities are compared
    irradiance, target, error = irradiance / shown, target / shown, error / shown
    metrics = compare(irradiance, target)
    metrics["rel_l2_floor"] = float(np.linalg.norm(error) / np.linalg.norm(target))
    metrics["estimator"] = "rays" if system.source.extended else "cells"
    metrics["efficiency"] = by_fate.on_target / flux
    metrics["lit_efficiency"] = float((irradiance * shown)[target > 0].sum() * screen.pixel_area / flux)
    metrics["stray"] = by_fate.off_target / flux
    metrics["fates_w"] = asdict(by_fate)
    return Measurement(irradiance, target, metrics)


def _by_cells(
    system: OpticalSystem, lens: Lens, screen: Screen, backend: Backend
) -> tuple[Floats, Floats, SequentialFates]:
    """Return (irradiance, its error, flux by fate)."""
    spans = [0, 0]
    for sag in lens.sags:
        embedding = sag.space.embedding
        spans = [max(n, kv.dim - kv.degree) for n, kv in zip(spans, (embedding.kv_u, embedding.kv_v))]
    wanted = [max(CELLS_PER_PIXEL * n, CELLS_PER_SPAN * k) for n, k in zip(screen.pixels, spans)]
    most = [max(LEAST_PER_PIXEL * n, MOST_RAYS) for n in screen.pixels]
    counts = [_prime_from(max(LEAST_CELLS, min(w, m))) for w, m in zip(wanted, most)]
    fewer = [_prime_from(round(n / COARSER)) for n in counts]
    fine, fates = cell_irradiance(system, lens, screen, counts, backend)
    coarse, _ = cell_irradiance(system, lens, screen, fewer, backend)
    return fine, (fine - coarse) / _excess((counts[0] * counts[1] / (fewer[0] * fewer[1])) ** ORDER), fates


def _excess(ratio: float) -> float:
    """Return how large the difference of two grids' images is, in errors of the finer one.

    ratio : of their errors.  Errors that have the same form leave ratio - 1, independent ones
    sqrt(ratio^2 + 1), and cells of a lens something between: their mean in proportion.  For a ratio of 4 both
    are 17 % away.
    """
    return sqrt((ratio - 1) * sqrt(ratio**2 + 1))


def _prime_from(least: int) -> int:
    """Return the least prime from `least` on: grids of different primes share no lines but their borders."""
    n = least
    while any(n % k == 0 for k in range(2, isqrt(n) + 1)):
        n += 1
    return n


def _by_rays(
    system: OpticalSystem, lens: Lens, screen: Screen, backend: Backend
) -> tuple[Floats, Floats, SequentialFates]:
    """Return (irradiance, its error, flux by fate)."""
    rng = np.random.default_rng(system.problem.run.seed)
    images, fates = [], []
    for extra in (0, 1):
        counts = [
            min(RAYS_PER_PIXEL * n, max(LEAST_PER_PIXEL * n, MOST_RAYS)) + 2 * extra + 1
            for n in screen.pixels
        ]
        image, by_fate = _trace(system, lens, screen, counts, rng, backend)
        images.append(image)
        fates.append(by_fate)
    return (images[0] + images[1]) / 2, (images[0] - images[1]) / 2, fates[0]


def compare(irradiance: NDArray[np.float64], target: NDArray[np.float64]) -> dict[str, Any]:
    """Return rel_l2, psnr_db and ssim of two images, both scaled to unit mean.

    None stands for a metric that is not defined: psnr_db of equal images, ssim of images narrower than its
    least window of 3 pixels.
    """
    from skimage.metrics import structural_similarity

    if irradiance.sum() <= 0:
        return {"rel_l2": 1.0, "psnr_db": 0.0, "ssim": 0.0}
    e, t = irradiance / irradiance.mean(), target / target.mean()
    peak = float(t.max())
    window = min(7, (min(t.shape) - 1) // 2 * 2 + 1)
    similarity = structural_similarity(e, t, data_range=peak, win_size=window) if window >= 3 else None
    error = float(np.mean((e - t) ** 2))
    return {
        "rel_l2": rel_l2(irradiance, target),
        "psnr_db": float(10 * np.log10(peak**2 / error)) if error else None,
        "ssim": None if similarity is None else float(similarity),
    }


def rel_l2(irradiance: NDArray[np.float64], target: NDArray[np.float64]) -> float:
    """Return ||E - T|| / ||T|| of two images, both scaled to unit mean; 1 of a dark one."""
    if irradiance.sum() <= 0:
        return 1.0
    e, t = irradiance / irradiance.mean(), target / target.mean()
    return float(np.linalg.norm(e - t) / np.linalg.norm(t))


def dark_fraction(target: NDArray[np.float64]) -> float:
    """Return the fraction of pixels with at most DARK of the greatest irradiance."""
    return float((target <= DARK * target.max()).mean())


def _trace(
    system: OpticalSystem,
    lens: Lens,
    screen: Screen,
    counts: Sequence[int],
    fresh: np.random.Generator,
    backend: Backend,
) -> tuple[NDArray[np.float64], SequentialFates]:
    """Return (irradiance, flux by fate) of fresh rays, traced in parts."""
    splat = Splat(backend, screen, PixelWindow(BLUR))
    image: DrArray = 0.0
    fates = []
    for part in system.source.parts(counts, fresh, RAYS_AT_ONCE):
        tracer = Tracer(backend, lens, part, system.target.z)
        with backend.dr.suspend_grad():
            _, landing = tracer.trace([sag.coefficients for sag in lens.sags])
            image = image + splat(landing.x, landing.y, landing.flux)
            fates.append(tracer.fates(landing, screen.half_width))
    return image.numpy().reshape(screen.shape, order="F"), reduce(add, fates)
