"""Where source, lens, target and rays stand in a picture, and from where it is seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import Backend
from optics.light.tracing import RayPath, TargetArea, trace_paths
from optics.reporting.view.solid_renderer import Face, oblique, outermost
from optics.scene.problem import Problem
from optics.scene.receivers import receiver_at
from optics.scene.sources import Rays, single_rays
from optics.scene.system import OpticalSystem
from thbcad.lens import Lens

Array = NDArray[np.float64]

RISE, LEAST_TURN, MOST_TURN = 18.0, 52.0, 60.0  # degrees: from where the scene is seen
# half-widths of lens and target together between their middles in the picture: more than 1 leaves both free
CLEAR = 1.7
# in the same half-widths: shorter and longer throws are drawn longer and shorter
SHORT = CLEAR / np.tan(np.radians(MOST_TURN))
LONG = 3.0
FACTORS = np.outer(10.0 ** np.arange(7), [1, 2, 5]).ravel()
BESIDE = 1.3  # half-widths of the front, to where a wider beam is drawn
BUNDLE = (8, 8)  # rays
BENDS = 25  # points of a curved target in each direction
FAR = 4.0  # half-widths of the rear behind its vertex, to where rays to the far field are drawn


@dataclass(frozen=True, eq=False)
class Scene:
    """The positions of source, lens and target, mm, and their projection.

    turn : (3, 3), rows right, up and towards the viewer
    lens : (3, 2), least and greatest corner of the box around it
    source : (3, n), outline
    target : (3, n, m), points of it, along its v and u, or (3, 0, 0) for the far field
    squeeze : how many times the distance behind the lens is drawn shorter than it is (below 1: longer)
    """

    turn: Array
    lens: Array
    source: Array
    target: Array
    squeeze: float

    def __call__(self, points: Array) -> Array:
        """Return points (3, n) in the picture, (2, n)."""
        x, y, z = points
        top = self.lens[2, 1]
        return self.turn[:2] @ np.stack([x, y, np.minimum(z, top) + np.maximum(z - top, 0.0) / self.squeeze])

    @property
    def rim(self) -> Array:
        """The rim of the target, closed by its first point, (3, k)."""
        sides = self.target[:, 0], self.target[:, :, -1], self.target[:, -1, ::-1], self.target[:, ::-1, 0]
        return np.concatenate([side[:, :-1] for side in sides], axis=1)

    def visible(self, path: Array) -> Array:
        """Return the points (k, 3) of a path as (3, k), from the source's picture on.

        Parallel light comes from before it.
        """
        points = path.T.copy()
        if points[2, 0] < self.source[2, 0]:
            points[:, 0] = *points[:2, 0], self.source[2, 0]
        return points

    def box(self, *parts: Array) -> Array:
        """Return the (2, 2) least and greatest corner of what is drawn of points."""
        seen = self(np.concatenate([part.reshape(3, -1) for part in parts], axis=1))
        return np.stack([seen.min(axis=1), seen.max(axis=1)])


def placed(system: OpticalSystem, faces: Sequence[Face]) -> Scene:
    """Return the scene of a system, turned so that the target leaves the lens free."""
    problem, receiver = system.problem, system.target.receiver
    points = outermost(faces)
    box = np.stack([points.min(axis=1), points.max(axis=1)], axis=1)
    source, far = problem.source, system.source.from_afar
    before = box[2, 0] - 0.6 * np.ptp(box[:2], axis=1).max() if far else -source.distance
    circle = source.profile in ("round", "round_gaussian")
    around = np.linspace(0, 2 * np.pi, 65) if circle else np.pi / 4 * np.arange(1, 10, 2)
    size = 1.0 if circle else np.sqrt(2)
    extent = (
        np.minimum(source.half_width, BESIDE * faces[0].points[:2].max(axis=(1, 2)))
        if far
        else source.half_width
    )
    outline = np.stack(
        [*(h * size * f(around) for h, f in zip(extent, (np.cos, np.sin))), np.full(around.size, before)]
    )
    if receiver.far_field:
        return Scene(oblique(-LEAST_TURN, RISE), box, outline, np.zeros((3, 0, 0)), 1.0)
    bends = BENDS if problem.target.curved else 2
    grid = np.meshgrid(*(h * np.linspace(-1, 1, bends) for h in problem.target.half_width))
    target = np.stack(np.broadcast_arrays(*receiver.points(*grid)))
    throw, width = float(target[2].min()) - box[2, 1], problem.target.half_width[0] + box[0, 1]
    # what lies aslant is drawn as it is, unless it is far
    longer = FACTORS[FACTORS * throw >= SHORT * width] if receiver.across_axis else FACTORS
    squeeze = FACTORS[FACTORS * LONG * width <= throw].max(initial=1.0) / longer.min(initial=FACTORS[-1])
    turn = np.clip(np.degrees(np.arctan2(CLEAR * width, throw / squeeze)), LEAST_TURN, MOST_TURN)
    normal = np.array(receiver.normal(0.0, 0.0))  # of a target that is not to be seen from its edge
    view = max((oblique(side * turn, RISE) for side in (-1, 1)), key=lambda seen: abs(seen[2] @ normal))
    return Scene(view, box, outline, target, squeeze)


def corners(box: Array) -> Array:
    """Return the eight corners of a box (3, 2), (3, 8)."""
    return np.array(np.meshgrid(*box)).reshape(3, 8)


def block_means(data: Array, side: int) -> Array:
    """Return the means of blocks of side x side pixels; those at the last row and column may be cut."""
    if side == 1:
        return data
    sums, counts = data, np.ones_like(data)
    for axis in (0, 1):
        starts = np.arange(0, data.shape[axis], side)
        sums, counts = (np.add.reduceat(a, starts, axis=axis) for a in (sums, counts))
    return sums / counts


def caption(problem: Problem, scene: Scene) -> str:
    """Return what stands under the picture of a scene."""
    if not scene.target.size:
        return "rays to the far field"
    hx, hy = problem.target.half_width
    text = f"target {2 * hx:g} x {2 * hy:g} mm, {problem.target.place}"
    if scene.squeeze == 1:
        return text
    drawn = f"{scene.squeeze:g} times shorter" if scene.squeeze > 1 else f"{1 / scene.squeeze:g} times longer"
    return f"{text}; this distance is drawn {drawn} than it is"


def scene_paths(system: OpticalSystem, lens: Lens, backend: Backend) -> list[RayPath]:
    """Return the paths of the rays with light, of some 64 of the source, to the target or its direction.

    At every face a path follows the stronger part.

    backend : of double precision
    """
    rays, target = single_rays(system.source.rays(BUNDLE), lens), system.target
    lit = rays.flux > 0
    if lit.any():
        rays = Rays(rays.origin[:, lit], rays.direction[:, lit], rays.flux[lit])
    path, half_width = system.path(lens), target.settings.half_width
    if target.far_field:
        path = path.onto(receiver_at(lens.thickness + FAR * max(lens.rear.half_width)))
        half_width = np.inf, np.inf
    return trace_paths(backend, system.solid(lens), rays, TargetArea.of(path, half_width))


def with_far_rays(lens: Array) -> Array:
    """Return the box of a lens made wider and as long as rays to the far field are drawn, (3, 2)."""
    across = 1.5 * lens[:2]
    return np.stack([*across, lens[2] + [0.0, FAR / 2 * np.ptp(lens[:2], axis=1).max()]])
