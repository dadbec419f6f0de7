"""The etendue of a problem's source, front and target, and what it takes for one image of the source.

Etendue is dU = dx dy dp dq with the direction cosines p, q (thesis 2.30), and lossless optics conserves it. A
source of radiance at most L is seen with that radiance at most, whatever the lens.  At a point x of the
target

    E = L integral of (N d) cos(theta) / r^2 dS = L integral of (N d) cos^3(theta) / D^2 dS
      <= L S(x) cos^3(theta) / D^2

over the part of the rear surface, of area S(x), through which x sees the source.  N is the normal, d the ray,
D the distance along z.

Through every point of the rear the source lights a part of the target, its image.  The integral of S(x) over
the target is that of the images' areas over the rear.  So the mean area over a rear of area S is

    a >= 1 / (L S) integral of E D^2 / cos^3(theta) dx dy,

near the axis D^2 U / S with the etendue U = integral of E / L.  Losses and light beside the target make it
larger.  In the far field du dv / dOmega stands for D^2 / cos^3(theta).  A shift-invariant system (thesis 7.1)
throws the same image through every point.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isinf, pi

import numpy as np
from scipy.optimize import minimize_scalar

from optics.designing.etendue.envelope import rim_around
from optics.scene.problem import freedom_of
from optics.scene.receivers import Plane
from optics.scene.sources import Profile, Rays
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.lens import Lens
from thbcad.outlines import Outline, area_rule

RAYS = (512, 256)  # for the fraction of the light that meets the front
NODES = 8  # of Gauss's rule over a piece of the rear aperture, in each direction
AREA_CELLS = 512  # of the rear, in each direction

# the multiplier of `least_mean` is searched for between these, times 1 / standard deviation
STRENGTHS = (1e-7, 1e7)
MOST_STEPS = 100  # of Newton's method in `least_mean`
UNIT_MEAN = 1e-14  # how far above 1 the mean of its result may be


@dataclass(frozen=True)
class Throughput:
    """What can pass from the source to the target.

    source : etendue of the source, mm^2 sr
    front : etendue of its light that meets the front, mm^2 sr
    target : etendue of the rays between a flat aperture in the rear's outline and the target, mm^2 sr;
        None of a target that does not lie across the axis
    radiance : the greatest of the source, W / (mm^2 sr); inf without extent
    meets_front : flux on the front of the base lens, W
    """

    source: float
    front: float
    target: float | None
    radiance: float
    meets_front: float


def throughput(system: System) -> Throughput:
    """Return the Throughput of a problem.  Of the lens only the front and the width of the rear matter."""
    problem = system.problem
    etendue, fraction = system.source.etendue, front_fraction(system)
    return Throughput(
        source=etendue,
        front=fraction * etendue,
        target=aperture_etendue(system) if system.axial else None,
        radiance=radiance(system),
        meets_front=fraction * problem.flux,
    )


def bounds_hold(system: System) -> bool:
    """Return whether etendue bounds the light of a system: its source has extent, its target is no curve, and
    it is one lens."""
    receiver, alone = system.target.receiver, system.problem.optic.array is None
    return bool(system.source.etendue) and alone and (receiver.far_field or isinstance(receiver, Plane))


def radiance(system: System) -> float:
    """Return the greatest radiance of the source, W / (mm^2 sr); inf without extent."""
    etendue = system.source.etendue
    return system.problem.flux * brightest(system.source.profile) / etendue if etendue else inf


def brightest(profile: Profile) -> float:
    """Return the greatest density of an area over its mean.

    Of a picture it is that of the brightest pixel.
    """
    if profile.kind in ("uniform", "round"):
        return 1.0
    if profile.light is not None:
        return float(profile.light.max() / profile.light.mean())
    return profile.area / 4 * float(profile(np.zeros(1), np.zeros(1))[0])


def front_fraction(system: System) -> float:
    """Return the fraction of the source's flux that meets the first face, by a fixed set of rays.

    A ray meets the graph z(x, y) over the outline if it is below the graph where it enters the prism of the
    outline, and above it where it leaves the prism.
    """
    rays, first = system.source.rays(RAYS), system.unshaped.path.surfaces[0]
    if not isinstance(rays, Rays):
        return rays.total / (rays.total + rays.missed)
    front, rays = first.shape, rays.posed(first.pose.inverse())
    origin, direction = rays.origin, rays.direction
    enter, leave = front.outline.chord(origin[:2], direction[:2])
    enter = np.maximum(0.0, enter)
    inside = enter < leave
    above = []
    for travel in (enter, leave):
        x, y, z = origin + np.where(inside & np.isfinite(travel), travel, 0.0) * direction
        surface = front(*(np.clip(a, -h, h) for a, h in zip((x, y), front.half_width)))
        above.append((z >= surface) | np.isinf(travel))
    return float(rays.flux[inside & ~above[0] & above[1]].sum() / rays.total)


def aperture_etendue(system: System) -> float:
    """Return the etendue of all rays from the rear aperture to the target, mm^2 sr.

    The aperture is taken as flat, within the rear's outline.  The projected solid angle of a rectangle seen
    from a point has a closed form; Gauss's rules integrate it over the aperture.
    """
    half_width, far, throw = system.problem.target.half_width, system.target.far_field, system.problem.throw
    half = np.tan(np.radians(half_width)) if far else np.divide(half_width, throw)
    outline = system.base.rear.outline
    across, up = (np.array([-h, h]) for h in outline.half_width)
    x, y, area = area_rule(outline, across, up, NODES)
    # of the target's corners as seen from each point; an aperture is a point in the far field
    across, up = (np.zeros_like(a) if far else a / throw for a in (x, y))
    seen = sum(i * j * _corner(i * half[0] - across, j * half[1] - up) for i in (1, -1) for j in (1, -1))
    return float((area * seen).sum())


def rear_area(lens: Lens) -> float:
    """Return the area of the rear surface, mm^2: the integral of sqrt(1 + z_x^2 + z_y^2), by the midpoint
    rule.
    """
    hx, hy = lens.rear.half_width
    at = (2 * np.arange(AREA_CELLS) + 1) / AREA_CELLS - 1
    zx, zy = (lens.rear.grid(hx * at, hy * at, d) for d in ((1, 0), (0, 1)))
    stretch, outline = np.sqrt(1 + zx * zx + zy * zy), lens.rear.outline
    if outline.is_rectangle:
        return float(4 * hx * hy * stretch.mean())
    return float(
        outline.area * stretch[outline.contains(*np.meshgrid(hx * at, hy * at, indexing="ij"))].mean()
    )


def spread(system: System) -> Floats:
    """Return the least D^2 / cos^3(theta) of every pixel as seen from the rear, (rows, columns) mm^2.

    It is (D^2 + r^2)^(3/2) / D, with the lateral distance r of the pixel's nearest point from the aperture.
    The rear lies between D_1 and D_2 before the target, and the least is at D = r / sqrt(2).  In the far
    field it is du dv / dOmega, square degrees.
    """
    target, rear = system.problem.target, system.problem.optic.rear
    if system.target.far_field:
        return (180 / pi) ** 2 / system.target.screen().projection()
    surface = system.base.rear
    rim = max((float(z) for z in surface.conic(*rim_around(surface).T)), key=abs)
    nearest, farthest = (
        system.problem.throw - f(0.0, rim) - i * freedom_of(rear) for f, i in ((max, 1), (min, -1))
    )
    x, y = (
        np.maximum(h * (np.abs((2 * np.arange(n) + 1) / n - 1) - 1 / n), 0.0)
        for h, n in zip(target.half_width, target.pixels)
    )
    lateral = _square_distance(surface.outline, x[None, :], y[:, None])
    distance = np.clip(np.sqrt(lateral / 2), nearest, farthest)
    return (distance**2 + lateral) ** 1.5 / distance


def _square_distance(outline: Outline, x: Floats, y: Floats) -> Floats:
    """Return the square of the distance of points from an outline, or a little less, mm^2.

    It is at least that of the rectangle, and that of the line that touches the outline across the way to p,
    |p| - h(p / |p|) with the support function h; of a circle it is just this.

    x, y : mm, not negative; they broadcast
    """
    across, up = (np.maximum(a - h, 0.0) for a, h in zip((x, y), outline.half_width))
    square: Floats = up**2 + across**2
    if outline.is_rectangle:
        return square
    length = np.hypot(x, y)
    direction = np.stack(np.broadcast_arrays(x, y)) / np.where(length > 0, length, 1.0)
    return np.maximum(square, np.maximum(length - outline.support(direction), 0.0) ** 2)


def _corner(x: Floats, y: Floats) -> Floats:
    """Return the projected solid angle of the rectangle [0, x] x [0, y] at distance 1.

    It is odd in x and in y.  Source: Howell, factor B-3.
    """
    wide, tall = np.sqrt(1 + x * x), np.sqrt(1 + y * y)
    return (x / wide * np.arctan(y / wide) + y / tall * np.arctan(x / tall)) / 2


def image_half_width(system: System, efficiency: float, rel_l2: float) -> tuple[float, float]:
    """Return half the width and height of an image of `image_area` in the proportions of the source.

    In mm, in the far field in degrees.
    """
    profile, (hx, hy) = system.source.image
    of_unit = profile.area * hx * hy
    if system.source.diverging:  # the etendue of a beam counts its brightest direction
        of_unit /= brightest(profile)
    scale = np.sqrt(image_area(system, efficiency, rel_l2) / of_unit)
    return float(scale * hx), float(scale * hy)


def image_area(system: System, efficiency: float, rel_l2: float) -> float:
    """Return the least area of the images of a lens that throws the same image through all of its rear, mm^2.

    It is the a of this module, in the far field in square degrees: for the least mean of D^2 / cos^3 over all
    irradiances of that rel_l2, in the far field over any light on the target.

    The area of the designed rear counts, which lies within the z_freedom of the problem.
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
    return mean * used / rear_area(system.designed)


def least_mean(values: Floats, picture: Floats, rel_l2: float) -> float:
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


def _unit_mean_irradiance(values: Floats, picture: Floats, t: float) -> tuple[float, Floats]:
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
