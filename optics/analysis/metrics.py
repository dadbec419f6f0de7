"""What the lens delivers, measured on fresh rays in float64 with box pixels.

A ray of a grid stands for a cell of the source.  The light of the cell arrives spread over about 1 /
RAYS_PER_PIXEL of a pixel, and a ray that lands so close to a border counts for both pixels.  On sharp edges
this removes most of the moire between rays and pixels.  It changes nothing else, which `rel_l2_floor`
measures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import reduce
from operator import add
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from optics.target import PixelWindow, Splat
from optics.tracing import Tracer

if TYPE_CHECKING:
    from optics.runtime import Backend, DrArray
    from optics.system import OpticalSystem
    from optics.target import Screen
    from optics.tracing import SequentialFates
    from thbcad.lens import Lens

RAYS_PER_PIXEL = 11  # in each direction, for each of the two ray sets
LEAST_PER_PIXEL, MOST_RAYS = 3, 4096  # on large screens: so many per pixel, or so many per direction
DARK = 0.01  # of the greatest irradiance: what counts as dark
RAYS_AT_ONCE = 1 << 21


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

    Two ray sets are traced, neither of which the optimisation has seen.  Their mean is the irradiance, their
    difference measures the error of the estimator (`rel_l2_floor`).
    """
    screen, flux = system.target.screen(), system.problem.source.flux
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
    irradiance, by_fate = (images[0] + images[1]) / 2, fates[0]
    target = system.target.irradiance(screen, by_fate.transmitted)
    shown = screen.projection()  # in the far field intensities are compared
    irradiance, target, images = irradiance / shown, target / shown, [image / shown for image in images]
    metrics = compare(irradiance, target)
    metrics["rel_l2_floor"] = float(np.linalg.norm(images[0] - images[1]) / 2 / np.linalg.norm(target))
    metrics["efficiency"] = by_fate.on_target / flux
    metrics["lit_efficiency"] = float((irradiance * shown)[target > 0].sum() * screen.pixel_area / flux)
    metrics["stray"] = by_fate.off_target / flux
    metrics["fates_w"] = asdict(by_fate)
    return Measurement(irradiance, target, metrics)


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
        "rel_l2": float(np.linalg.norm(e - t) / np.linalg.norm(t)),
        "psnr_db": float(10 * np.log10(peak**2 / error)) if error else None,
        "ssim": None if similarity is None else float(similarity),
    }


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
    splat = Splat(backend, screen, PixelWindow(0.5 / RAYS_PER_PIXEL))
    image: DrArray = 0.0
    fates = []
    for part in system.source.parts(counts, fresh, RAYS_AT_ONCE):
        tracer = Tracer(backend, lens, part, system.target.z)
        with backend.dr.suspend_grad():
            _, landing = tracer.trace([sag.coefficients for sag in lens.sags])
            image = image + splat(landing.x, landing.y, landing.flux)
            fates.append(tracer.fates(landing, screen.half_width))
    return image.numpy().reshape(screen.shape, order="F"), reduce(add, fates)
