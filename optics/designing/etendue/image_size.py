"""The least size of the images of the source that a lens throws: see `etendue.throughput_bound`."""

from __future__ import annotations

from math import isinf

import numpy as np
from scipy.optimize import minimize_scalar

from optics.designing.etendue.throughput_bound import Array, brightest, rear_area, spread
from optics.scene.system import OpticalSystem
from thbcad.lens import Lens

# the multiplier of `least_mean` is searched for between these, times 1 / standard deviation
STRENGTHS = (1e-7, 1e7)
MOST_STEPS = 100  # of Newton's method in `least_mean`
UNIT_MEAN = 1e-14  # how far above 1 the mean of its result may be


def image_half_width(
    system: OpticalSystem, lens: Lens, efficiency: float, rel_l2: float
) -> tuple[float, float]:
    """Return half the width and height of an image of `image_area` in the proportions of the source.

    In mm, in the far field in degrees.
    """
    profile, (hx, hy) = system.source.image
    of_unit = profile.area * hx * hy
    if system.source.diverging:  # the etendue of a beam counts its brightest direction
        of_unit /= brightest(profile)
    scale = np.sqrt(image_area(system, lens, efficiency, rel_l2) / of_unit)
    return float(scale * hx), float(scale * hy)


def image_area(system: OpticalSystem, lens: Lens, efficiency: float, rel_l2: float) -> float:
    """Return the least area of the images of a lens that throws the same image through all of its rear, mm^2.

    It is a of `etendue.throughput_bound`, in the far field in square degrees: for the least mean of
    D^2 / cos^3 over all irradiances of that rel_l2, in the far field over any light on the target.

    lens : its rear's area counts.  The rear lies within the z_freedom of the problem.
    efficiency : fraction of the source's flux that the lens brings to the target, at least
    rel_l2 : of the lens, at most
    """
    target = system.target
    used = efficiency * system.source.etendue / brightest(system.source.profile)
    values = spread(system)
    if not target.far_field:
        picture = target.irradiance(target.screen(), 1.0)
        mean = least_mean(values, picture / picture.mean(), rel_l2)
    else:
        mean = float(values.min())
    return mean * used / rear_area(lens)


def least_mean(values: Array, picture: Array, rel_l2: float) -> float:
    """Return a lower bound of the mean of `values` h, weighted by any irradiance E >= 0 near a picture G.

    mean E = mean G = 1 and mean (E - G)^2 <= delta^2 = rel_l2^2 mean G^2.  By weak duality every c and t > 0
    give the bound

        c + mean (E_t (h - c)) + (mean (E_t - G)^2 - delta^2) / (2 t),     E_t = max(0, G - t (h - c)).

    For every t the c with mean E_t = 1 is the best; the best t is searched for.  The least of the values h is
    a bound too.

    Source: S. Boyd and L. Vandenberghe, Convex Optimization, 5.1.
    """
    least, scale = float(values.min()), float(values.std())
    if not scale or isinf(rel_l2):
        return least
    allowed = rel_l2**2 * float((picture**2).mean())

    def negative(logarithm: float) -> float:
        t = np.exp(logarithm) / scale
        c, light = _unit_mean_irradiance(values, picture, t)
        return -float(
            c + (light * (values - c)).mean() + (((light - picture) ** 2).mean() - allowed) / (2 * t)
        )

    best = minimize_scalar(negative, bounds=np.log(STRENGTHS), method="bounded", options={"xatol": 1e-6})
    return max(least, -float(best.fun))


def _unit_mean_irradiance(values: Array, picture: Array, t: float) -> tuple[float, Array]:
    """Return c and E = max(0, G - t (h - c)) with mean E = 1.

    By Newton's method from above: mean E is a convex function of c.
    """
    c = float(values.mean())
    for _ in range(MOST_STEPS):
        light = np.maximum(picture - t * (values - c), 0)
        over = float(light.mean()) - 1
        if over <= UNIT_MEAN:
            break
        c -= over / (t * float((light > 0).mean()))
    return c, light
