"""What the lens delivers, measured in float64 on box pixels, with light that the optimiser has not seen.

Light of one direction at every point of the source is measured as cells (`light_of_cells`), exact but for
their size.  That of an extended source is measured as rays (`light_of_rays`).  Spreading light is also
followed on all non-sequential paths through the closed lens (`nonsequential_light`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from math import hypot
from operator import add
from typing import Any

import numpy as np

from optics.base.runtime import Backend
from optics.light.analysis.closed_lens_light import OtherLight
from optics.light.analysis.judgement import (
    Verdict,
    delivery_checks,
    judged,
    rays_to_decide,
    uniformity_checks,
)
from optics.light.analysis.light_by_all_ways import AllLight, all_light, estimate_of, estimator_of
from optics.light.analysis.light_estimate import LightEstimate
from optics.light.analysis.light_of_cells import grid_irradiance
from optics.light.analysis.light_of_rays import ray_count, ray_numbers
from optics.light.analysis.light_of_wavelengths import colour_metrics, light_of_plate, spectral_light
from optics.light.analysis.photometric_metrics import (
    beam_metrics,
    box_screen,
    per_area,
    photometric_metrics,
    polarisation_change,
    uniformity_metrics,
    zone_metrics,
)
from optics.light.blur import spot_rms
from optics.scene.paths import LightPath
from optics.scene.problem import Verify
from optics.scene.receivers import Screen
from optics.scene.system import System
from thbcad.checks import Floats

METRICS_VERSION = 2  # of the numbers in metrics.json; results without one are of the first
MOST_MORE = 4.0  # times the usual rays, which a measurement takes to decide on a limit
SURER = 1.2  # times the rays that the errors of the first ones ask for
FLAT = 1e-9  # of the norm: what varies less has no contrast
DARK = 0.01  # of the greatest irradiance: what counts as dark


@dataclass(frozen=True, eq=False)
class Measurement:
    """What a lens delivers.

    irradiance, target : (rows, columns), W/mm^2; in the far field intensities, W/degree^2; lm for W where
        that is the source's unit
    metrics : numbers by name
    sharp : the irradiance without divergence and roughness, where there are any
    colour : X, Y, Z of the CIE 1931 observer in units of 683 lm/W, (3, rows, columns), of a spectrum's light
        through front and rear
    """

    irradiance: Floats
    target: Floats
    metrics: dict[str, Any]
    sharp: Floats | None = None
    colour: Floats | None = None

    def verdict(self, limits: Verify, notes: Sequence[str] = ()) -> Verdict:
        """Return the verdict on the light alone.  limits : of a problem.  notes : sentences beside it."""
        return judged(self.metrics, delivery_checks(self.metrics, limits), notes, of_file=False)

    def __repr__(self) -> str:
        rows, columns = self.irradiance.shape
        names = [name for name in ("rel_l2_debiased", "efficiency", "stray") if name in self.metrics]
        numbers = ", ".join(f"{name} {self.metrics[name]:.4f}" for name in names)
        return f"Measurement({columns} x {rows} pixels, {numbers})"

    def in_unit(self, unit: float) -> Measurement:
        """Return it with all light times a factor."""
        lights = {name: getattr(self, name) for name in ("irradiance", "target", "sharp", "colour")}
        return replace(self, **{n: unit * light for n, light in lights.items() if light is not None})


def measure(system: System, backend: Backend) -> Measurement:
    """Return the Measurement of a lens.  backend : of double precision.

    The light of a plate is that of all its sources.  Light by non-sequential paths is part of it where it is
    not negligible, and so is light that misses an element and goes on to the target.  `rel_l2_sequential` is
    of light through front and rear alone.  Errors come from replicates, see `LightEstimate`.
    """
    system = system.with_all_sources
    screen, path, estimator = system.target.screen(), system.shaded_path, estimator_of(system)
    blur = spot_rms(system, backend) if system.target.uniform_region is not None else 0.0
    boxes, shown = box_screen(system), screen.projection()  # in the far field intensities are compared
    found = all_light(system, screen, backend, boxes=boxes)
    if (more := _more_rays(system, found, screen, boxes, blur)) > 1:
        found = all_light(system, screen, backend, more, boxes)
    light, direct, fates = found.light, found.direct.estimate, found.direct.fates
    seen = per_area(light, screen, boxes)
    # a target at any scale is compared, also with no light
    target = system.target.irradiance(screen, light.on_target + light.off_target or 1.0) / shown
    irradiance, flux = seen.irradiance, system.problem.flux
    metrics: dict[str, Any] = {"version": METRICS_VERSION}
    metrics |= compare(irradiance, target)
    of_all = seen.error_of_rel_l2(target)
    metrics |= of_all
    metrics |= contrast_error(metrics, target) if system.target.as_picture else {}
    sequential = per_area(direct, screen).error_of_rel_l2(target) if found.added else of_all
    metrics["rel_l2_sequential"] = sequential["rel_l2_debiased"]
    metrics["rel_l2_sequential_error"] = sequential["rel_l2_error"]
    metrics["paths"] = "all" if found.all_ways else "sequential"
    metrics["estimator"] = estimator
    if system.reflects:
        metrics["element"] = "mirror"
    if estimator == "rays":
        metrics |= ray_numbers(system.source, screen, found.rays)
    metrics["efficiency"] = light.on_target / flux
    metrics["efficiency_error"] = light.error_of_on_target / flux
    metrics["lit_efficiency"] = _lit(light.irradiance, target, screen) / flux
    lit_error = hypot(screen.pixel_area * light.error_of_sum(target > 0), float(light.drift.on))
    metrics["lit_efficiency_error"] = lit_error / flux
    # outside the target the light of other ways counts where it is known, however little falls on it
    stray, stray_error = found.off_target
    metrics["stray"] = max(stray, 0.0) / flux
    metrics["stray_error"] = stray_error / flux
    metrics |= photometric_metrics(system, screen, seen, blur)
    metrics |= _zones(system, path, light, found.added, backend)
    metrics |= polarisation_change(system, path, backend)
    metrics[system.units.key("fates")] = fates.by_name
    if found.past and found.past.missed:
        metrics["past_elements"] = found.past.shares(light.on_target, flux)
    if found.other:
        metrics["nonsequential"] = _by_other_ways(system, screen, target, direct, found.other)
    sharp = colour = None
    if estimator == "beams":
        clear = light_of_plate(system.sharp, path, screen, backend, grid_irradiance)
        sharp = clear.estimate.irradiance / shown
        metrics["rel_l2_sharp"] = rel_l2(sharp, target)
    if found.direct.colour is not None:
        colour = found.direct.colour / shown
        estimate = estimate_of(estimator, system)
        one = light_of_plate(system, path, screen, backend, estimate, alone=True)
        metrics["rel_l2_design_wavelength"] = rel_l2(one.estimate.irradiance / shown, target)
        metrics["colour"] = colour_metrics(system, path, colour, screen, backend)
    return Measurement(irradiance, target, metrics, sharp, colour)


def _more_rays(system: System, found: AllLight, screen: Screen, boxes: Screen | None, blur: float) -> float:
    """Return how many times the rays decide on the limits of uniformity; 1 where these do or where that takes
    more than MOST_MORE times."""
    if boxes is None or estimator_of(system) != "rays" or system.source.most_rays <= found.rays:
        return 1.0
    seen = {"uniformity": uniformity_metrics(system, per_area(found.light, screen, boxes), blur)}
    more = max(map(rays_to_decide, uniformity_checks(seen, system.problem.verify)), default=1.0)
    return min(SURER * more, MOST_MORE) if 1 < more <= MOST_MORE else 1.0


def _zones(
    system: System,
    path: LightPath,
    light: LightEstimate,
    added: Sequence[LightEstimate],
    backend: Backend,
) -> dict[str, Any]:
    """Return the metrics of the target's zones.  Light that may have details within pixels is measured once
    more, on finer ones; that of a blur which is wider than a pixel has none.

    light : on the target's pixels.  added : of it, what came by other ways than along the path.
    """
    screen, fine, estimator = system.target.screen(), system.target.zone_screen, estimator_of(system)
    if fine != screen and estimator == "beams" and spot_rms(system, backend) > max(screen.pitch):
        fine = screen
    if fine != screen:
        estimate = estimate_of(estimator, system)
        if estimator == "rays":  # as many in an aperture as in a pixel
            count = int(ray_count(fine) * (max(fine.pitch) / system.target.aperture) ** 2)
            estimate = partial(estimate, count=max(count, ray_count(screen)))
        light = light_of_plate(system, path, fine, backend, estimate).estimate
        light = reduce(add, (each.finer(fine) for each in added), light)
    return zone_metrics(system, fine, per_area(light, fine))


def _by_other_ways(
    system: System, screen: Screen, target: Floats, direct: LightEstimate, other: OtherLight
) -> dict[str, Any]:
    """Return what light by other ways than front and rear brings, by name."""
    key, lit = system.units.key, _lit(direct.irradiance, target, screen)
    return {
        "by_other_ways": other.share,
        key("lit"): lit + _lit(other.light.irradiance, target, screen),
        key("lit_direct"): lit,
        key("target"): other.fates.onto,
        key("fates"): other.fates.by_name,
    }


def fresh_light(system: System, backend: Backend) -> Floats:
    """Return the light of a lens along its path alone, as that of a Measurement, (rows, columns)."""
    screen, path = system.target.screen(), system.shaded_path
    light = spectral_light(system, path, screen, backend, estimate_of(estimator_of(system), system))
    return light.estimate.irradiance / screen.projection()


def _lit(irradiance: Floats, target: Floats, screen: Screen) -> float:
    """Return the flux on pixels that are to be lit, W."""
    return float(irradiance[target > 0].sum() * screen.pixel_area)


def compare(irradiance: Floats, target: Floats) -> dict[str, Any]:
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


def rel_l2(irradiance: Floats, target: Floats) -> float:
    """Return ||E - T|| / ||T|| of two images, both scaled to unit mean; 1 of a dark one."""
    if irradiance.sum() <= 0:
        return 1.0
    e, t = unit_mean(irradiance), unit_mean(target)
    return float(np.linalg.norm(e - t) / np.linalg.norm(t))


def contrast_error(metrics: dict[str, Any], target: Floats) -> dict[str, float | None]:
    """Return ||E - T|| / ||T - mean T|| of unit means, without noise, and its standard deviation.

    Uniform light scores 1 on every picture.  None of a target without contrast.

    metrics : with rel_l2_debiased and rel_l2_error.
    """
    t = unit_mean(target)
    contrast = float(np.linalg.norm(t - 1) / np.linalg.norm(t))
    if contrast <= FLAT:
        return {"contrast_error": None, "contrast_error_std": None}
    return {
        "contrast_error": metrics["rel_l2_debiased"] / contrast,
        "contrast_error_std": metrics["rel_l2_error"] / contrast,
    }


def delivered(system: System, light: LightEstimate, blur: float) -> dict[str, Any]:
    """Return the metrics that the verdict needs.

    light : flux per du dv on the target's pixels and boxes.  blur : see `optics.light.blur.spot_rms`.
    """
    screen, flux = system.target.screen(), system.problem.flux
    seen = per_area(light, screen, box_screen(system))
    target = system.target.irradiance(screen, 1.0) / screen.projection()
    found: dict[str, Any] = dict(seen.error_of_rel_l2(target))
    found |= {"efficiency": light.on_target / flux, "stray": light.off_target / flux}
    found["lit_efficiency"] = _lit(light.irradiance, target, screen) / flux
    found |= zone_metrics(system, screen, seen)
    if system.target.as_picture:
        found |= contrast_error(found, target)
    if system.target.far_field:
        found["beam"] = beam_metrics(system, screen, seen)
    if system.target.uniform_region is not None:
        found["uniformity"] = uniformity_metrics(system, seen, blur)
    return found


def unit_mean(image: Floats) -> Floats:
    """Return an image scaled to a mean of one; a dark one as it is."""
    return image / (float(image.mean()) or 1.0)


def dark_fraction(target: Floats) -> float:
    """Return the fraction of pixels with at most DARK of the greatest irradiance."""
    return float((target <= DARK * target.max()).mean())
