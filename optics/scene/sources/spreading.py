"""Rays of points, and of areas whose points all spread their light alike, as Lambertian ones do.

A Lambertian source spreads its flux uniformly over its area and over the direction cosines,
d Phi ~ dA cos(theta) dOmega = dA dp dq with p = sin(theta) cos(phi), q = sin(theta) sin(phi).
Four-dimensional Sobol points sample (x, y, p, q), or what `Divergence` makes of p and q.  Each is taken with
its mirror images in x and in y, so that a symmetric problem stays symmetric.  A point source needs directions
only, a grid of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import cos, radians

import numpy as np

from optics.scene.sources.divergence import Divergence
from optics.scene.sources.profile import Profile
from optics.scene.sources.rays import Rays
from thbcad.checks import Floats

MIRRORS = tuple((i, j) for i in (1.0, -1.0) for j in (1.0, -1.0))


def area_parts(
    half_width: Sequence[float],
    distance: float,
    flux: float,
    spread: Divergence,
    profile: Profile,
    count: int,
    seed: int,
    most: int,
) -> Iterator[Rays]:
    """Yield the rays of an area whose points all spread their light alike, in parts of at most `most`.

    half_width : mm, of the rectangle in the plane z = -distance (or of the ellipse in it, for round
        profiles).
    count : of rays, a multiple of four.  seed : of the scrambling.
    """
    from scipy.special import erf, erfinv
    from scipy.stats import qmc

    engine = qmc.Sobol(4, scramble=True, seed=seed)
    left = count // 4
    while left:
        size = min(left, max(1, most // 4))
        left -= size
        s, t, a, b = 2 * engine.random(size).T - 1
        if profile.round:
            s, t = concentric(s, t)
        p, q = concentric(a, b)
        stretch = spread.stretch(p * p + q * q)
        p, q = p * stretch, q * stretch
        if profile.kind == "gaussian":
            wide = [np.sqrt(2) * sigma for sigma in profile.sigma]
            s, t = (w * erfinv(r * erf(1 / w)) for r, w in zip((s, t), wide))
        origin = np.stack([s * half_width[0], t * half_width[1], np.full(size, -distance)])
        direction = np.stack([p, q, np.sqrt(np.maximum(1 - p * p - q * q, 0.0))])
        origin, direction = (mirror_images(v) for v in (origin, direction))
        each = np.broadcast_to(flux / count, 4 * size)
        if profile.kind in ("image", "round_gaussian"):
            even = profile.area / 4  # density of the samples over the rectangle's mean
            each = even * each * np.concatenate([profile(i * s, j * t) for i, j in MIRRORS])
        yield Rays(origin, direction, each)


def point_rays(
    distance: float,
    flux: float,
    half_angle: float,
    exponent: float,
    counts: Sequence[int],
    shift: Sequence[float],
) -> Rays:
    """Return the rays of a point at z = -distance with intensity ~ cos(theta)^exponent within a cone.

    half_angle : degrees, of the cone.
    counts : (n, m) directions, a grid on which every cell has the same solid angle.
    shift : moves the grid by a fraction of its step, |shift| <= 1/2.
    """
    a, b = ((2 * np.arange(n) + 1 - n + 2 * s) / n for n, s in zip(counts, shift))  # exact mirror images
    p, q = concentric(*(r.ravel() for r in np.meshgrid(a, b, indexing="ij")))
    deepest = 1 - cos(radians(half_angle))
    depth = deepest * (p * p + q * q)  # 1 - cos(theta), in proportion to the solid angle
    stretch = np.sqrt((2 - depth) * deepest)  # sin(theta) / r
    direction = np.stack([p * stretch, q * stretch, 1 - depth])
    intensity = (1 - depth) ** exponent
    origin = np.zeros_like(direction)
    origin[2] = -distance
    return Rays(origin, direction, flux * intensity / intensity.sum())


def mirror_half(rays: Rays, axes: Sequence[int]) -> Rays:
    """Return those of the rays of a Lambertian source whose mirror images are the others.

    axes : the mirrored directions, 0 for x and 1 for y; without any all rays stay, mirrored or not.
    """
    if not axes:
        return rays
    each = len(rays.flux) // len(MIRRORS)
    kept = [k for k, signs in enumerate(MIRRORS) if all(signs[axis] > 0 for axis in axes)]

    def half(values: Floats) -> Floats:
        return np.concatenate([values[..., k * each : (k + 1) * each] for k in kept], axis=-1)

    return Rays(half(rays.origin), half(rays.direction), half(rays.flux))


def mirror_images(vectors: Floats) -> Floats:
    """Return vectors (3, n) and their mirror images in x and in y, (3, 4 n)."""
    images = np.empty((3, len(MIRRORS), vectors.shape[1]))
    for k, (i, j) in enumerate(MIRRORS):
        for image, row, sign in zip(images[:, k], vectors, (i, j, 1.0)):
            np.multiply(row, sign, out=image)
    return images.reshape(3, -1)


def concentric(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Map the square [-1, 1]^2 to the unit disk.

    Equal areas stay equal, mirror images stay mirror images.

    Source: P. Shirley, K. Chiu, A low distortion map between disk and square, J. Graphics Tools 2 (1997).
    """
    wide = np.abs(a) > np.abs(b)
    radius, other = np.where(wide, a, b), np.where(wide, b, a)
    angle = np.pi / 4 * other / np.where(radius == 0, 1.0, radius)
    near, far = radius * np.cos(angle), radius * np.sin(angle)
    return np.where(wide, near, far), np.where(wide, far, near)
