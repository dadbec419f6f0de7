"""Where a measured part lies: the rigid motion that brings its points nearest to the designed surface.

Measured points are P = R p + t with points p of the surface's frame.  The best fit minimises

    sum over points of d^2,   d = (z - s(x, y)) / sqrt(1 + |grad s|^2),   (x, y, z) = R^T (P - t),

the distance along the normal (to first order in it, exact where a point lies on the surface), by Gauss and
Newton on the exact surface s.  Motions that leave the surface on itself, as a sphere's rotations about its
centre, cannot be seen by any fit.  They are left out, by the singular values of the derivative, and named.

Points that a motion carries a little beside the rim still belong to it: there s is its Taylor polynomial of
second order about the rim.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from optics.base.runtime import UserError
from thbcad.checks import Floats
from thbcad.lens import FreeformSurface
from thbcad.poses import Pose

MOST_STEPS = 50  # five are usual; more where the form error is large beside the motion
KEPT = 0.9  # of the points stay over the surface while they are fitted
MOST_ROUNDS = 5  # of fits, each to the points that lie over the surface then; two are usual
LEAST_DAMPING, DAMPED = 1e-4, 10.0  # of the greatest singular value; times as much after each step that fails
SETTLED = 1e-13  # of the half-width
BLIND = 1e-6  # of the greatest singular value: what moves points by less is not determined
RIM = 1e-3  # of the half-width: so far beside the rim the surface goes on, with an error of third order
OUTLYING, LEAST_OUTLYING = 50.0, 1e-4  # of the median distance; of the half-width: beyond any form error
MOST_OUTLIERS = 0.02  # of the points: more are a part of the surface
NEIGHBOURS = 8  # nearest points of an outlier that may belong to the same group
MOST_TOGETHER = 24  # outliers in a group of dust, as in robust fits: more are an error of form
NAMED = 0.05  # of a direction of length 1: a motion that has a part in it
ANOTHER = "were they measured on this surface of this lens, and on most of it? --align datums needs no fit"
MOTIONS = ("shift in x", "shift in y", "shift in z", "tilt about x", "tilt about y", "rotation about z")


@dataclass(frozen=True, eq=False)
class Alignment:
    """Points in the frame of the surface, and how they came there.

    motion : of the measured part.  points : (3, n) mm, those that lie over the surface; those a little beside
        its rim are on it.
    heights : z - s(x, y) of these, mm.  normal : the distance along the normal, mm.
    undetermined : motions that the surface does not show.
    """

    motion: Pose
    points: Floats
    heights: Floats
    normal: Floats
    undetermined: tuple[str, ...] = ()

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
    return _aligned(surface, points, Pose.at(), 0.0)


def is_outlier(surface: FreeformSurface, here: Alignment) -> NDArray[np.bool_]:
    """Return which points lie far from where the others do, farther than any form error, (n,)."""
    apart = np.abs(here.normal - np.median(here.normal))
    return apart > max(OUTLYING * float(np.median(apart)), LEAST_OUTLYING * max(surface.half_width))


def outliers(surface: FreeformSurface, here: Alignment) -> str | None:
    """Return that some points lie far from where the others do, a sentence; None where there are none."""
    far = is_outlier(surface, here)
    if not far.any():
        return None
    return f"{_count(here, far)}: leave them out of the file if they are dust or a slip of the probe"


def _count(here: Alignment, far: NDArray[np.bool_]) -> str:
    """Return how many points lie far from the others, how far, and about where."""
    apart = np.abs(here.normal - np.median(here.normal))[far].max()
    x, y = here.points[:2, far].mean(axis=1)
    return (
        f"{far.sum():,} of {far.size:,} points lie up to {1e3 * apart:.3g} um from where the others "
        f"do, round x = {x:.3g}, y = {y:.3g} mm"
    )


def _isolated(here: Alignment, far: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which outliers form no larger group than dust does, (n,).

    Two outliers belong to one group where one is among the nearest points of the other.
    """
    positions, at = here.points[:2].T, np.flatnonzero(far)
    _, nearest = cKDTree(positions).query(positions[at], min(1 + NEIGHBOURS, far.size))
    nearest = np.reshape(nearest, (at.size, -1))
    one, other = np.repeat(at, nearest.shape[1]), nearest.ravel()
    both = far[other]
    links = coo_array((np.ones(both.sum()), (one[both], other[both])), shape=(far.size, far.size))
    _, group = connected_components(links, directed=False)
    alone: NDArray[np.bool_] = far & (np.bincount(group)[group] <= MOST_TOGETHER)
    return alone


def without_outliers(surface: FreeformSurface, points: Floats) -> tuple[Floats, str]:
    """Return points, (3, n) mm, without those few that lie far from the others, and a sentence on these.

    They are looked for by datums, then by a best fit.  More than 24 outliers next to each other are an error
    of form and stay.  Where more than 2 % of the points would go, these are no slips: all points stay.  The
    sentence is "" where none goes.
    """
    for align, beside in ((by_datums, 0.0), (best_fit, RIM)):
        try:
            here = align(surface, points)
        except UserError:  # there is no best fit
            continue
        far = is_outlier(surface, here)
        if far.any() and (far := _isolated(here, far)).any() and far.sum() <= MOST_OUTLIERS * far.size:
            kept = ~_near(surface, points, here.motion, beside)
            kept[~kept] = ~far
            left_out = "they were left out as dust or slips of the probe; the light is that of the others"
            return points[:, kept], f"{_count(here, far)}: {left_out}"
    return points, ""


def best_fit(surface: FreeformSurface, points: Floats) -> Alignment:
    """Return the points brought nearest to the surface by a shift and a rotation.

    points : (3, n) mm.

    Raises UserError : the points leave the surface on the way; outliers are named.
    """
    motion, before = Pose.at(), None
    least = KEPT * float(_near(surface, points, motion, RIM).sum())
    undetermined: tuple[str, ...] = ()
    for _ in range(MOST_ROUNDS):
        near = _near(surface, points, motion, RIM)
        if before is not None and (near == before).all():
            break
        motion, undetermined = _nearest(surface, points[:, near], motion, least)
        before = near
    last = _aligned(surface, points, motion, RIM)
    if last.points.shape[1] * 2 < points.shape[1]:
        cause = outliers(surface, by_datums(surface, points)) or ANOTHER
        raise UserError(f"the best fit moves half of the points beside the surface; {cause}")
    return Alignment(motion, last.points, last.heights, last.normal, undetermined)


def _nearest(
    surface: FreeformSurface, points: Floats, motion: Pose, least: float
) -> tuple[Pose, tuple[str, ...]]:
    """Return the motion of least squares near another one, and the names of those that cannot be seen.

    least : points that it keeps over the surface.

    Steps of Gauss and Newton; where one does not bring the points nearer, or leads many of them beside the
    surface, it is damped (Levenberg): a surface of another power leads full steps far along motions that
    hardly change anything.
    """
    size, damping = max(surface.half_width), 0.0
    here = _aligned(surface, points, motion, np.inf)
    linear = _Linear.at(surface, here, size)
    for _ in range(MOST_STEPS):
        step = linear.step(damping)
        if np.linalg.norm(step.shift) + size * np.linalg.norm(step.rotation_vector) < SETTLED * size:
            break
        there = _aligned(surface, points, here.motion @ step, np.inf)
        kept = _near(surface, points, there.motion, RIM).sum() >= least
        if kept and np.square(there.normal).sum() <= np.square(here.normal).sum():
            here, damping = there, damping / DAMPED if damping > LEAST_DAMPING else 0.0
            linear = _Linear.at(surface, here, size)
        else:
            damping = max(DAMPED * damping, LEAST_DAMPING)
    return here.motion, linear.unseen


def _near(surface: FreeformSurface, points: Floats, motion: Pose, beside: float) -> NDArray[np.bool_]:
    """Return which points lie over a surface, or beside it by a part of its half-width at most."""
    x, y, _ = motion.inverse().points(points)
    return surface.outline.contains(x, y, beside)


def _aligned(surface: FreeformSurface, points: Floats, motion: Pose, beside: float) -> Alignment:
    """Return the points over a surface, and those beside it by a part of its half-width."""
    half_width = np.reshape(surface.half_width, (2, 1))
    x, y, z = motion.inverse().points(points[:, _near(surface, points, motion, beside)])
    if not len(x):
        raise UserError(f"all points lie beside the surface; {ANOTHER}")
    u, v = np.clip([x, y], -half_width, half_width)
    heights = z - _height(surface, x, y, u, v)
    stretch: Floats = np.sqrt(1 + surface(u, v, (1, 0)) ** 2 + surface(u, v, (0, 1)) ** 2)
    return Alignment(motion, np.stack([u, v, z]), heights, heights / stretch)


def _height(surface: FreeformSurface, x: Floats, y: Floats, u: Floats, v: Floats) -> Floats:
    """Return s(x, y), beside the rim its Taylor polynomial of second order about that, where u, v lie."""
    heights: Floats = surface(u, v)
    off = (u != x) | (v != y)
    u, v = u[off], v[off]
    dx, dy = x[off] - u, y[off] - v
    slope = [surface(u, v, order) for order in ((1, 0), (0, 1))]
    bend = [surface(u, v, order) for order in ((2, 0), (1, 1), (0, 2))]
    heights[off] += slope[0] * dx + slope[1] * dy
    heights[off] += bend[0] * dx**2 / 2 + bend[1] * dx * dy + bend[2] * dy**2 / 2
    return heights


@dataclass(frozen=True, eq=False)
class _Linear:
    """How the distances of points follow a further motion, and the distances, in singular vectors.

    A further motion (t, w) moves a point by -(t + w x p) in the frame of the surface, and its distance by
    -n . t - (p x n) . w.

    values : (6,), of tilts in units of 1 / size.  vectors : rows of motions, (6, 6).  wanted : (6,).
    """

    values: Floats
    vectors: Floats
    wanted: Floats
    size: float

    @classmethod
    def at(cls, surface: FreeformSurface, here: Alignment, size: float) -> _Linear:
        x, y, _ = here.points
        n = np.stack([-surface(x, y, (1, 0)), -surface(x, y, (0, 1)), np.ones_like(x)])
        n /= np.linalg.norm(n, axis=0)
        derivative = np.concatenate([n, np.cross(here.points.T, n.T).T / size]).T
        u, values, vectors = np.linalg.svd(derivative, full_matrices=False)
        return cls(values, vectors, u.T @ here.normal, size)

    @property
    def _seen(self) -> NDArray[np.bool_]:
        return self.values > BLIND * self.values[0]

    def step(self, damping: float) -> Pose:
        """Return the step of least squares.  damping : in the greatest singular value."""
        values = self.values[self._seen]
        weights = values / (values**2 + (damping * self.values[0]) ** 2)
        p = self.vectors[self._seen].T @ (weights * self.wanted[self._seen])
        return Pose.at(p[:3], p[3:] / self.size)

    @property
    def unseen(self) -> tuple[str, ...]:
        """The names of the motions that no step takes."""
        blind = np.abs(self.vectors[~self._seen]).max(axis=0, initial=0) > NAMED
        return tuple(m for m, b in zip(MOTIONS, blind) if b)
