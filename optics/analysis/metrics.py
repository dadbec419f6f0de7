"""What the lens delivers, measured on fresh rays in float64 with box pixels.

A ray of a grid stands for a cell of the source, whose light arrives spread over about 1 / RAYS_PER_PIXEL of a
pixel: it is shared between two pixels when it lands so close to their border.  On sharp edges
that removes most of the moire between rays and pixels and changes nothing else
(`rel_l2_floor` tells).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from optics.system import ray_parts, target_irradiance, target_screen
from optics.target import PixelWindow, Splat
from optics.tracing import FluxBudget, Tracer

if TYPE_CHECKING:
    from optics.problem import Problem
    from optics.runtime import Backend, DrArray
    from optics.target import Screen
    from thbcad.lens import Lens

RAYS_PER_PIXEL = 11  # in each direction, for each of the two ray sets
LEAST_PER_PIXEL, MOST_RAYS = 3, 4096  # on large screens: so many per pixel, or so many per direction
RAYS_AT_ONCE = 1 << 21


@dataclass(frozen=True, eq=False)
class Measurement:
    """irradiance, target : (rows, columns), W/mm^2, intensities in the far field; figures : the metrics that
    the README explains."""

    irradiance: NDArray[np.float64]
    target: NDArray[np.float64]
    figures: dict[str, Any]


def measure(backend: Backend, problem: Problem, lens: Lens, light: NDArray[np.float64]) -> Measurement:
    """Return the Measurement of a lens.  backend : of double precision.

    Two ray sets, neither of which the optimisation has seen, are traced; their mean is the
    irradiance and their difference tells the estimator's own error (`rel_l2_floor`).
    """
    screen = target_screen(problem)
    rng = np.random.default_rng(problem.run.seed)
    images, budgets = [], []
    for extra in (0, 1):
        rays = [
            min(RAYS_PER_PIXEL * n, max(LEAST_PER_PIXEL * n, MOST_RAYS)) + 2 * extra + 1
            for n in screen.pixels
        ]
        image, budget = _trace(backend, problem, lens, screen, rays, rng)
        images.append(image)
        budgets.append(budget)
    irradiance = (images[0] + images[1]) / 2
    budget = budgets[0]
    target = target_irradiance(light, screen, problem.target.placing, budget.transmitted)
    shown = screen.projection()  # in the far field intensities are compared
    irradiance, target, images = irradiance / shown, target / shown, [image / shown for image in images]
    figures = compare(irradiance, target)
    figures["rel_l2_floor"] = float(np.linalg.norm(images[0] - images[1]) / 2 / np.linalg.norm(target))
    figures["efficiency"] = budget.on_target / problem.source.flux
    figures["lit_efficiency"] = float(
        (irradiance * shown)[target > 0].sum() * screen.pixel_area / problem.source.flux
    )
    figures["stray"] = budget.off_target / problem.source.flux
    figures["flux_budget_w"] = asdict(budget)
    return Measurement(irradiance, target, figures)


def compare(irradiance: NDArray[np.float64], target: NDArray[np.float64]) -> dict[str, Any]:
    """Return rel_l2, psnr_db and ssim of two images, both scaled to unit mean.

    None stands for a figure that is not defined: psnr_db of equal images, ssim of images
    narrower than its least window of 3 pixels.
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


def _trace(
    backend: Backend,
    problem: Problem,
    lens: Lens,
    screen: Screen,
    rays: Sequence[int],
    fresh: np.random.Generator,
) -> tuple[NDArray[np.float64], FluxBudget]:
    """Return (irradiance, FluxBudget) of fresh rays, traced in parts."""
    splat = Splat(backend, screen, PixelWindow(0.5 / RAYS_PER_PIXEL))
    image: DrArray
    budget: FluxBudget | None
    image, budget = 0.0, None
    for part in ray_parts(problem, rays, fresh, RAYS_AT_ONCE):
        tracer = Tracer(backend, lens, part, problem.target_z)
        with backend.dr.suspend_grad():
            _, landing = tracer.trace([sag.coefficients for sag in lens.sags])
            image = image + splat(landing.x, landing.y, landing.flux)
            here = tracer.budget(landing, screen.half_width)
        budget = here if budget is None else budget + here
    return image.numpy().reshape(screen.shape, order="F"), budget
