"""Where a measured part lies: the rigid motion that brings its points nearest to the designed surface.

Measured points are P = R p + t with points p of the surface's frame.  The best fit minimises

    sum over points of d^2,   d = (z - s(x, y)) / sqrt(1 + |grad s|^2),   (x, y, z) = R^T (P - t),

the distance along the normal (to first order in it, exact where a point lies on the surface), by Gauss and
Newton on the exact surface s.  Motions that leave the surface on itself, as a sphere's rotations about its
centre, cannot be seen by any fit.  They are left out, by the singular values of the derivative, and named.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from optics.runtime import UserError
from thbcad.lens import FreeformSurface

Floats = NDArray[np.float64]

MOST_STEPS = 50  # five are usual; more where the form error is large beside the motion
SETTLED = 1e-13  # of the half-width
BLIND = 1e-6  # of the greatest singular value: what moves points by less is not determined
NAMED = 0.05  # of a direction of length 1: a motion that has a part in it
ANOTHER = "were they measured on this surface of this lens?"
MOTIONS = ("shift in x", "shift in y", "shift in z", "tilt about x", "tilt about y", "rotation about z")


@dataclass(frozen=True, eq=False)
class Motion:
    """P = R p + t about the vertex of a surface.

    shift : t, (3,) mm.  tilt : rotation vector of R, (3,) rad.
    """

    shift: Floats
    tilt: Floats

    def undone(self, points: Floats) -> Floats:
        """Return R^T (P - t) of points (3, n)."""
        result: Floats = Rotation.from_rotvec(self.tilt).inv().apply(points.T - self.shift).T
        return result

    def done(self, points: Floats) -> Floats:
        """Return R p + t of points (3, n)."""
        result: Floats = (Rotation.from_rotvec(self.tilt).apply(points.T) + self.shift).T
        return result

    def then(self, step: Motion) -> Motion:
        """Return the motion R_self (R_step p + t_step) + t_self."""
        turn = Rotation.from_rotvec(self.tilt)
        return Motion(
            self.shift + turn.apply(step.shift), (turn * Rotation.from_rotvec(step.tilt)).as_rotvec()
        )


@dataclass(frozen=True, eq=False)
class Alignment:
    """Points in the frame of the surface, and how they came there.

    motion : of the measured part.  points : (3, n) mm, those that lie over the surface.
    heights : z - s(x, y) of these, mm.  normal : the distance along the normal, mm.
    undetermined : motions that the surface does not show.  beside : points that are left out.
    """

    motion: Motion
    points: Floats
    heights: Floats
    normal: Floats
    undetermined: tuple[str, ...] = ()
    beside: int = 0

    @property
    def peak_to_valley(self) -> float:
        """Greatest less least height error, mm."""
        return float(np.ptp(self.heights))

    @property
    def rms(self) -> float:
        """Root mean square of the height error, mm."""
        return float(np.sqrt(np.mean(self.heights**2)))


def by_datums(surface: FreeformSurface, points: Floats) -> Alignment:
    """Return the points as they are: the frame of the file is that of the surface."""
    return _aligned(surface, points, Motion(np.zeros(3), np.zeros(3)))


def best_fit(surface: FreeformSurface, points: Floats) -> Alignment:
    """Return the points brought nearest to the surface by a shift and a rotation.

    points : (3, n) mm.

    Raises
    ------
    UserError : the points leave the surface on the way.
    """
    size = max(surface.half_width)
    motion = Motion(np.zeros(3), np.zeros(3))
    undetermined: tuple[str, ...] = ()
    for _ in range(MOST_STEPS):
        here = _aligned(surface, points, motion)
        step, undetermined = _step(surface, here, size)
        motion = motion.then(step)
        if np.linalg.norm(step.shift) + size * np.linalg.norm(step.tilt) < SETTLED * size:
            break
    last = _aligned(surface, points, motion)
    if last.points.shape[1] * 2 < points.shape[1]:
        raise UserError(f"the best fit moves half of the points beside the surface; {ANOTHER}")
    return Alignment(motion, last.points, last.heights, last.normal, undetermined, last.beside)


def _aligned(surface: FreeformSurface, points: Floats, motion: Motion) -> Alignment:
    x, y, z = motion.undone(points)
    hx, hy = surface.half_width
    on = (np.abs(x) <= hx) & (np.abs(y) <= hy)
    x, y, z = x[on], y[on], z[on]
    if not len(x):
        raise UserError(f"the best fit moves all points beside the surface; {ANOTHER}")
    heights = z - surface(x, y)
    normal = heights / _stretch(surface, x, y)
    return Alignment(motion, np.stack([x, y, z]), heights, normal, beside=int((~on).sum()))


def _stretch(surface: FreeformSurface, x: Floats, y: Floats) -> Floats:
    """Return sqrt(1 + |grad s|^2)."""
    result: Floats = np.sqrt(1 + surface(x, y, (1, 0)) ** 2 + surface(x, y, (0, 1)) ** 2)
    return result


def _step(surface: FreeformSurface, here: Alignment, size: float) -> tuple[Motion, tuple[str, ...]]:
    """Return the step of Gauss and Newton, and the names of the motions that it leaves out.

    A further motion (t, w) moves a point by -(t + w x p) in the frame of the surface, and its distance by
    -n . t - (p x n) . w.
    """
    x, y, _ = here.points
    n = np.stack([-surface(x, y, (1, 0)), -surface(x, y, (0, 1)), np.ones_like(x)])
    n /= np.linalg.norm(n, axis=0)
    derivative = np.concatenate([n, np.cross(here.points.T, n.T).T / size]).T  # tilts in units of 1 / size
    u, s, vt = np.linalg.svd(derivative, full_matrices=False)
    seen = s > BLIND * s[0]
    p = vt[seen].T @ ((u[:, seen].T @ here.normal) / s[seen])
    blind = np.abs(vt[~seen]).max(axis=0, initial=0) > NAMED
    return Motion(p[:3], p[3:] / size), tuple(m for m, b in zip(MOTIONS, blind) if b)
