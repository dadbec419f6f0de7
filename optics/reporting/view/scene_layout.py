"""Where source, element, target and rays stand in a picture, and how far apart they are drawn."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optics.reporting.view.drawn_rays import FAR
from optics.reporting.view.open_views import best_view
from optics.reporting.view.solid_renderer import SAMPLES, Face, oblique, outermost, solid_faces
from optics.scene.problem import Problem
from optics.scene.receivers import Plane
from optics.scene.system import System, designed_part, other_parts, source_frames
from thbcad.checks import Floats
from thbcad.poses import Pose

RISE, LEAST_TURN, MOST_TURN = 18.0, 52.0, 60.0  # degrees: from where a lens on the axis is seen
# half-widths of lens and target together between their middles in the picture: more than 1 leaves both free
CLEAR = 1.7
# in the same half-widths: shorter and longer throws are drawn longer and shorter
SHORT = CLEAR / np.tan(np.radians(MOST_TURN))
LONG = 3.0
FACTORS = np.outer(10.0 ** np.arange(7), [1, 2, 5]).ravel()
BESIDE = 1.3  # half-widths of the front, to where a wider beam is drawn
BENDS = 25  # points of a curved target in each direction


@dataclass(frozen=True, eq=False)
class DrawnElement:
    """An element as it is drawn.  faces : front and rear first, in its own frame.  pose : to the scene's."""

    name: str
    faces: Sequence[Face]
    pose: Pose

    @cached_property
    def box(self) -> Floats:
        """The corners of its own box, (3, 8)."""
        return np.asarray(self.pose.points(corners(box_of(outermost(self.faces)))))

    @cached_property
    def placed(self) -> list[Face]:
        """Its faces in the frame of the scene."""
        return [face.posed(self.pose) for face in self.faces]


def drawn_elements(system: System, samples: int = SAMPLES, fixed: int = SAMPLES) -> tuple[DrawnElement, ...]:
    """Return the elements in the order of the light.

    samples, fixed : across the faces of that which is designed, and of the others.
    """
    own = designed_part(system)
    parts = {part.name: part for part in (own, *other_parts(system))}
    met = dict.fromkeys(face.optic.called for face in system.problem.faces_met)
    return tuple(
        DrawnElement(
            name, solid_faces(parts[name].made, samples if name == own.name else fixed)[0], parts[name].pose
        )
        for name in met
    )


@dataclass(frozen=True, eq=False)
class DrawnSource:
    """A source in a picture.

    half_width : mm, 0 of a point.  round : an ellipse, not a rectangle.  pose : its middle in the scene.
    """

    half_width: tuple[float, float]
    round: bool
    pose: Pose

    @property
    def outline(self) -> Floats:
        """Points around it, (3, n); of a point all are one."""
        around = np.linspace(0, 2 * np.pi, 65) if self.round else np.pi / 4 * np.arange(1, 10, 2)
        size = 1.0 if self.round else np.sqrt(2)
        x, y = (h * size * f(around) for h, f in zip(self.half_width, (np.cos, np.sin)))
        return np.asarray(self.pose.points(np.stack([x, y, np.zeros(around.size)])))


@dataclass(frozen=True, eq=False)
class Scene:
    """Points of source, elements and target, mm, and their projection.

    turn : (3, 3), rows right, up and towards the viewer
    bodies : (3, 8) each, corners of the own boxes of the elements, in the order of the light
    body : that of the one which is designed
    sources : of which light comes
    target : (3, n, m), points of it along its v and u, or (3, 0, 0) for the far field
    outlook : (3, n), how far the picture goes: the rim of the target, or what rays to the far field need
    along : (3,), direction from the element to the target
    gap : from where to where along it nothing stands between them
    squeeze : how many times that gap is drawn shorter than it is (below 1: longer)
    """

    turn: Floats
    bodies: tuple[Floats, ...]
    body: Floats
    sources: tuple[DrawnSource, ...]
    target: Floats
    outlook: Floats
    along: Floats
    gap: tuple[float, float] = (0.0, 0.0)
    squeeze: float = 1.0

    def __call__(self, points: Floats) -> Floats:
        """Return points (3, ...) in the picture, (2, ...)."""
        flat = points.reshape(3, -1)
        start, end = self.gap
        left_out = (1 - 1 / self.squeeze) * np.clip(self.along @ flat - start, 0.0, end - start)
        return (self.turn[:2] @ (flat - np.outer(self.along, left_out))).reshape(2, *points.shape[1:])

    @property
    def source(self) -> Floats:
        """Points around all sources, (3, n)."""
        return np.concatenate([source.outline for source in self.sources], axis=1)

    @property
    def lens(self) -> Floats:
        """Least and greatest corner of the box around the element, (3, 2)."""
        return box_of(self.body)

    def nearer(self, points: Floats) -> bool:
        """Return whether points (3, n) stand nearer to the viewer than the elements."""
        middle = np.concatenate(self.bodies, axis=1).mean(axis=1)
        return bool(self.turn[2] @ (points.mean(axis=1) - middle) > 0)

    def visible(self, path: Floats) -> Floats:
        """Return the points (k, 3) of a path as (3, k), from the source's picture on.

        Parallel light comes from before it.
        """
        points, (first, *others) = path.T.copy(), self.sources
        if not others and not first.pose.rotates and points[2, 0] < first.pose.shift[2]:
            points[:, 0] = *points[:2, 0], first.pose.shift[2]
        return points

    def box(self, *parts: Floats) -> Floats:
        """Return the (2, 2) least and greatest corner of what is drawn of points."""
        seen = self(np.concatenate(parts, axis=1))
        return np.stack([seen.min(axis=1), seen.max(axis=1)])


def placed(system: System, elements: Sequence[DrawnElement]) -> Scene:
    """Return the scene of a system, seen so that its parts leave each other free.

    A long throw is drawn shorter; before a lens on the axis and a plane across it a short one also longer.

    elements : as `drawn_elements`.
    """
    pose, target, (hx, hy) = system.pose, system.target, system.target.settings.half_width
    bodies, first = tuple(element.box for element in elements), elements[0]
    body = bodies[[element.name for element in elements].index(system.problem.optic.called)]
    lit = first.pose.points(first.faces[0].points.reshape(3, -1))
    sources = _sources(system, bodies[0], np.abs(lit).max(axis=1))
    source = np.concatenate([one.outline for one in sources], axis=1)
    leaving, screen = system.path.leaving, np.zeros((3, 0, 0))
    outlook, along = _around_far_rays(leaving, bodies[-1]), leaving.rotation[:, 2]
    start = end = float((along @ np.concatenate([*bodies, source], axis=1)).max())
    if not target.far_field:
        bends = 2 if isinstance(target.receiver, Plane) else BENDS
        grid = np.meshgrid(*(h * np.linspace(-1, 1, bends) for h in (hx, hy)))
        screen = np.stack(np.broadcast_arrays(*target.receiver.points(*grid)))
        outlook = rim(screen)
        end = max(start, float((along @ outlook).min()))
    if not system.axial:
        width, throw = max(hx, hy) + np.ptp(box_of(bodies[-1]), axis=1).max() / 2, end - start
        squeeze, face = _shorter(throw, width), -pose.rotation[:, 2] if system.reflects else None
        drawn = outlook - (1 - 1 / squeeze) * throw * along[:, None]
        turn = best_view((source, *bodies, drawn), face, target.receiver, (hx, hy))
    elif target.far_field:
        turn, squeeze = oblique(-LEAST_TURN, RISE), 1.0
    else:
        width, throw = hx + box_of(body)[0, 1], end - start
        squeeze = _shorter(throw, width) / FACTORS[FACTORS * throw >= SHORT * width].min(initial=FACTORS[-1])
        angle = np.degrees(np.arctan2(CLEAR * width, throw / squeeze))
        turn = oblique(-np.clip(angle, LEAST_TURN, MOST_TURN), RISE)
    return Scene(turn, bodies, body, sources, screen, outlook, along, (start, end), squeeze)


def _shorter(throw: float, width: float) -> float:
    """Return how many times shorter a throw is drawn.  width : half-widths of target and element together."""
    return float(FACTORS[FACTORS * LONG * width <= throw].max(initial=1.0))


def box_of(points: Floats) -> Floats:
    """Return the least and the greatest corner of points (3, n), (3, 2)."""
    return np.stack([points.min(axis=1), points.max(axis=1)], axis=1)


def _sources(system: System, body: Floats, widest: Floats) -> tuple[DrawnSource, ...]:
    """Return the sources; of one wide beam along the axis what lies beside the element.

    widest : greatest |x| and |y| of the front
    """
    lone, far, (*across, depth) = system.problem.source.lone, system.source.from_afar, box_of(body)
    found = []
    for source, pose in source_frames(system.problem):
        (hx, hy), before = source.half_width, -source.distance
        if lone and far:
            before = depth[0] - 0.6 * np.ptp(across, axis=1).max()
            hx, hy = np.minimum(source.half_width, BESIDE * widest[:2]).tolist()
        middle = pose @ Pose.at((0.0, 0.0, float(before)))
        found.append(DrawnSource((hx, hy), source.profile in ("round", "round_gaussian"), middle))
    return tuple(found)


def _around_far_rays(leaving: Pose, body: Floats) -> Floats:
    """Return points around the element and what is shown of rays to the far field behind it, (3, 8)."""
    *across, (low, high) = box_of(leaving.inverse().points(body))
    long = [low, high + FAR / 2 * np.ptp(across, axis=1).max()]
    return np.asarray(leaving.points(corners(np.stack([*(1.5 * a for a in across), long]))))


def rim(screen: Floats) -> Floats:
    """Return the points around a grid (3, n, m), (3, k)."""
    sides = screen[:, 0], screen[:, :, -1], screen[:, -1, ::-1], screen[:, ::-1, 0]
    return np.concatenate([side[:, :-1] for side in sides], axis=1)


def corners(box: Floats) -> Floats:
    """Return the eight corners of a box (3, 2), (3, 8)."""
    return np.array(np.meshgrid(*box)).reshape(3, 8)


def block_means(data: Floats, side: int) -> Floats:
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
