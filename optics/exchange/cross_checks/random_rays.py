"""Independent random rays of a source, drawn by inverse distribution functions.

They share no code with the ray sets that the optimiser and the measure use.  All rays carry the same flux,
so that the light on a pixel is a count: its variance is what it has of squared flux.
"""

from collections.abc import Iterator
from math import cos, radians, sin

import numpy as np

from optics.scene.sources import (
    CollimatedBeam,
    FileSource,
    LambertianArea,
    LightSource,
    LuminaireSource,
    PlacedSource,
    PointSource,
    Profile,
    Rays,
    SourceGroup,
)
from thbcad.checks import Floats

SPARE = 64  # draws beside four for each ray, of which more than a third are kept: few rays have enough too


def random_rays(source: LightSource, start: float, count: int, seed: int, most: int) -> Iterator[Rays]:
    """Yield `count` independent rays of a source in parts of at most `most`.

    start : z from where collimated light comes, mm.
    """
    fresh = np.random.default_rng(seed)
    each = source.flux / count
    for first in range(0, count, most):
        size = min(most, count - first)
        yield _drawn(source, start, np.full(size, each), fresh)


def _drawn(source: LightSource, start: float, flux: Floats, fresh: np.random.Generator) -> Rays:
    if isinstance(source, PlacedSource):
        inner = source.source
        return _drawn(inner, inner.middle[2], flux, fresh).posed(source.pose)
    if isinstance(source, SourceGroup):
        shares = [member.flux / source.flux for member in source.members]
        counts = fresh.multinomial(len(flux), shares)
        members = zip(source.members, counts)
        return Rays.joined([_drawn(member, start, flux[:count], fresh) for member, count in members if count])
    if isinstance(source, LuminaireSource):
        # directions of the full sphere, kept with the probability of their light
        light = source.directions.light
        s, t = _positions(source.profile, len(flux), fresh)
        opening = np.stack([s * source.half_width[0], t * source.half_width[1], np.zeros(len(flux))])
        kept = np.zeros((3, 0))
        while kept.shape[1] < len(flux):
            drawn = fresh.normal(size=(3, len(flux)))
            drawn /= np.linalg.norm(drawn, axis=0)
            lit = fresh.random(len(flux)) * light.candela.max() < light.intensity(drawn)
            kept = np.concatenate([kept, drawn[:, lit]], axis=1)
        return Rays(opening, kept[:, : len(flux)], flux).posed(source.pose)
    if isinstance(source, FileSource):
        given = source.sample()
        chosen = fresh.choice(len(given.flux), len(flux), p=given.flux / given.flux.sum())
        return Rays(given.origin[:, chosen], given.direction[:, chosen], flux)
    origin, direction = np.zeros((3, len(flux))), np.zeros((3, len(flux)))
    origin[2] = start if source.collimated else -source.distance
    if isinstance(source, CollimatedBeam | LambertianArea):
        s, t = _positions(source.profile, len(flux), fresh)
        origin[0], origin[1] = source.half_width[0] * s, source.half_width[1] * t
    if source.collimated:
        direction[2] = 1.0
    else:
        cosine = _cosines(source, len(flux), fresh)
        sine, turn = np.sqrt(1 - cosine**2), fresh.uniform(0, 2 * np.pi, len(flux))
        direction[:] = sine * np.cos(turn), sine * np.sin(turn), cosine
    return Rays(origin, direction, flux)


def _cosines(source: LightSource, n: int, fresh: np.random.Generator) -> Floats:
    """Return the cosines of independent angles to the axis, (n,).

    Lambert's law: sin^2 is uniform up to that of the half-angle.  A point of intensity cos^m: so is
    cos^(m + 1), from that of the half-angle up to 1.
    """
    widest = radians(source.cone)
    match source:
        case CollimatedBeam():
            return _diverging(source.divergence.kind, widest, n, fresh)
        case LambertianArea():
            return np.sqrt(1 - fresh.random(n) * sin(widest) ** 2)
        case PointSource():
            power = source.exponent + 1
            least = cos(widest) ** power
            return (least + fresh.random(n) * (1 - least)) ** (1 / power)
    raise TypeError(f"no random rays are known of a {type(source).__name__}")


def _diverging(kind: str, widest: float, n: int, fresh: np.random.Generator) -> Floats:
    """Return the cosines of independent angles of a diverging beam to its axis, (n,).  widest : radians.

    The sun's disk is drawn evenly; a point of it is kept with the probability of its radiance over the
    greatest.
    """
    if kind == "uniform":
        return fresh.uniform(cos(widest), 1, n)
    if kind == "theta_uniform":
        return np.cos(fresh.uniform(0, widest, n))
    drawn = 4 * n + SPARE
    if kind == "gaussian":
        found = np.hypot(*fresh.normal(0, widest, (2, drawn)))
        return np.cos(found[found < min(6 * widest, radians(89))][:n])
    square = fresh.random(drawn)
    mu = np.sqrt(1 - square)
    kept = square[fresh.random(drawn) < 0.30 + 0.93 * mu - 0.23 * mu**2][:n]
    return np.sqrt(1 - kept * sin(widest) ** 2)


def _positions(profile: Profile, n: int, fresh: np.random.Generator) -> tuple[Floats, Floats]:
    """Return independent positions on a source relative to its half_width, (n,) each."""
    from scipy.special import ndtr, ndtri

    s, t = fresh.random((2, n))
    if profile.kind == "round":
        return np.sqrt(s) * np.cos(2 * np.pi * t), np.sqrt(s) * np.sin(2 * np.pi * t)
    if profile.kind == "round_gaussian":
        # a Gaussian that the unit disk cuts off: uniform positions, kept with its probability
        found = np.zeros((2, 0))
        while found.shape[1] < n:
            s, t = fresh.uniform(-1, 1, (2, 4 * n + SPARE))
            kept = (s**2 + t**2 < 1) & (
                fresh.random(s.size)
                < np.exp(-0.5 * ((s / profile.sigma[0]) ** 2 + (t / profile.sigma[1]) ** 2))
            )
            found = np.concatenate([found, [s[kept], t[kept]]], axis=1)
        return found[0, :n], found[1, :n]
    if profile.kind == "gaussian":
        low = [ndtr(-1 / sigma) for sigma in profile.sigma]
        s, t = (w * ndtri(a + r * (1 - 2 * a)) for w, a, r in zip(profile.sigma, low, (s, t)))
        return s, t
    if profile.kind == "image" and profile.light is not None:
        rows, columns = profile.light.shape
        below = np.cumsum(profile.light.ravel())
        row, column = np.divmod(np.searchsorted(below, fresh.random(n) * below[-1], side="right"), columns)
        return 2 * (column + s) / columns - 1, 1 - 2 * (row + t) / rows
    return 2 * s - 1, 2 * t - 1
