"""Thin and bright pictures on black, drawn without fonts: rings, letters, stars, checkers, lines, dots."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Shape = Callable[[Floats, Floats], Floats]  # light at (x, y), both in [-1, 1], y upwards

FINER = 4  # samples of a pixel in each direction
LETTERS: tuple[Sequence[tuple[float, float]], ...] = (  # strokes of L, A and N
    ((-0.85, 0.5), (-0.85, -0.5), (-0.45, -0.5)),
    ((-0.2, -0.5), (0.0, 0.5), (0.2, -0.5)),
    ((-0.12, -0.1), (0.12, -0.1)),
    ((0.45, -0.5), (0.45, 0.5), (0.85, -0.5), (0.85, 0.5)),
)


def picture(name: str, size: int) -> Floats:
    """Return a picture of PICTURES, (size, size), linear light from 0 to 1."""
    steps = (2 * np.arange(size * FINER) + 1) / (size * FINER) - 1
    light = np.broadcast_to(PICTURES[name](steps[None, :], -steps[:, None]), (len(steps),) * 2)
    return np.asarray(light.reshape(size, FINER, size, FINER).mean(axis=(1, 3)))


def _ring(radius: float, half: float) -> Shape:
    return lambda x, y: 1.0 * (abs(np.hypot(x, y) - radius) < half)


def _sum(*shapes: Shape) -> Shape:
    return lambda x, y: np.minimum(sum(shape(x, y) for shape in shapes), 1.0)


def _strokes(lines: Sequence[Sequence[tuple[float, float]]], half: float) -> Shape:
    """Return lines with round ends.  half : of their width."""

    def light(x: Floats, y: Floats) -> Floats:
        out = np.zeros(np.broadcast(x, y).shape)
        for line in lines:
            for (a, b), (c, d) in pairwise(line):
                u, v = c - a, d - b
                along = np.clip(((x - a) * u + (y - b) * v) / (u * u + v * v), 0, 1)
                out[np.hypot(x - a - along * u, y - b - along * v) < half] = 1.0
        return out

    return light


def _star(points: int, inner: float, outer: float) -> Shape:
    def light(x: Floats, y: Floats) -> Floats:
        turn = abs(np.arctan2(x, y) * points / np.pi % 2 - 1)
        return 1.0 * (np.hypot(x, y) < inner + (outer - inner) * turn)

    return light


def _checkers(squares: int) -> Shape:
    return lambda x, y: (np.floor((x + 1) * squares / 2) + np.floor((y + 1) * squares / 2)) % 2


def _dots(*dots: tuple[float, float, float, float]) -> Shape:
    """Return disks.  dots : x, y, radius and light."""
    return lambda x, y: sum(level * (np.hypot(x - a, y - b) < radius) for a, b, radius, level in dots)


def _sky(count: int) -> Shape:
    draw = np.random.default_rng(1).uniform
    return _dots(*((*draw(-0.95, 0.95, 2), 0.02, draw(0.1, 1.0)) for _ in range(count)))


def _triangle(x: Floats, y: Floats) -> Floats:
    return 0.6 * ((y > -0.17) & (abs(x) < 0.25 * (0.53 - y)))


def _spiral(x: Floats, y: Floats) -> Floats:
    radius = np.hypot(x, y)
    turn = (5 * radius - np.arctan2(y, x) / (2 * np.pi)) % 1
    return 1.0 * ((abs(turn - 0.5) < 0.12) & (radius > 0.1) & (radius < 0.9))


def _lattice(x: Floats, y: Floats) -> Floats:
    return 1.0 * ((8 * (x + 1) % 1 < 0.1) | (8 * (y + 1) % 1 < 0.1))


PICTURES: dict[str, Shape] = {
    "wide ring": _ring(0.8, 0.08),
    "ring": _ring(0.8, 0.04),
    "thin ring": _ring(0.8, 0.02),
    "thinnest ring": _ring(0.8, 0.01),
    "ring and triangle": _sum(_ring(0.813, 0.031), _triangle),
    "two rings": _sum(_ring(0.85, 0.02), _ring(0.45, 0.02)),
    "letters": _strokes(LETTERS, 0.05),
    "thin letters": _strokes(LETTERS, 0.02),
    "star": _star(5, 0.3, 0.9),
    "thin star": _star(8, 0.08, 0.9),
    "checkers": _checkers(8),
    "fine checkers": _checkers(32),
    "thin lines": _strokes((((-0.3, -1), (-0.3, 1)), ((-1, 0.4), (1, 0.4)), ((-0.5, -1), (0.5, 1))), 0.01),
    "frame": lambda x, y: 1.0 * (abs(np.maximum(abs(x), abs(y)) - 0.885) < 0.015),
    "two far dots": _dots((0.8, 0.8, 0.05, 1.0), (-0.8, -0.8, 0.05, 0.1)),
    "one pixel of 10 000": lambda x, y: (
        1.0 * ((np.floor(50 * (x + 1)) == 25) & (np.floor(50 * (y + 1)) == 66))
    ),
    "thirty dots": _sky(30),
    "lattice": _lattice,
    "spiral": _spiral,
    "crescent": lambda x, y: 1.0 * ((np.hypot(x, y) < 0.85) & (np.hypot(x - 0.12, y) > 0.8)),
}
