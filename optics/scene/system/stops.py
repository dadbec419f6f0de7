"""The stops of a problem, and whether they leave room for source, lens and target."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import numpy as np

from optics.base.runtime import UserError
from optics.scene.paths import Stop
from optics.scene.problem import Optic, Placed, Problem, freedom_of
from optics.scene.system.elements import pose_of
from thbcad.checks import Floats
from thbcad.lens import Lens
from thbcad.outlines import Outline
from thbcad.poses import Pose

DIRECTIONS = 128  # of the planes around an outline: it is taken as 3e-4 of its size too large
PARTS = 64  # of the sides of a section, between whose ends its distance is taken
CORNERS = np.array([[-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0], np.zeros(4)])


def stops_of(problem: Problem) -> tuple[Stop, ...]:
    """Return the stops of a problem, in the frame of the front vertex."""
    return tuple(
        Stop(
            Outline(spec.half_width, (0.0, 0.0) if spec.shape == "rectangle" else spec.half_width),
            Pose.tilted(spec.position, spec.tilt),
            Outline(spec.inner, spec.inner) if spec.shape == "ring" else None,
            spec.hole,
            f"stop.{spec.name or k}",
        )
        for k, spec in enumerate(problem.stop)
    )


def require_places(
    problem: Problem, bodies: Sequence[tuple[Optic, Lens]], stops: tuple[Stop, ...], start: float
) -> None:
    """Refuse stops that reach into an element, before the source plane, or behind a target across the axis.

    A lens is taken as all that its outline and its freedom in z enclose.  Among elements, and of a source
    elsewhere, no plane tells what lies before the light.
    bodies : the designed element with its lens, and then the others.
    start : z of parallel light, whose rays start nearer to the lens; -inf of other light.

    Raises UserError : names the stop.
    """
    end = _across_axis(problem, bodies[0][1])
    source = -inf if problem.source.placed or problem.source.others else -problem.source.distance
    first = -inf if problem.element else max(source, start)
    for stop in stops:
        z = stop.pose.points(np.array([*stop.outline.half_width, 1.0])[:, None] * CORNERS)[2]
        if z.min() <= first:
            where = "source" if first == source else "start of the parallel light that is traced"
            raise UserError(
                f"{stop.name} reaches to z = {z.min():.4g} mm, but the {where} is at z = {first:.4g} mm; "
                "move it towards the lens"
            )
        if end is not None and z.max() >= end:
            raise UserError(
                f"{stop.name} reaches to z = {z.max():.4g} mm, but the target is at z = {end:.4g} mm; move "
                "it towards the lens"
            )
        for optic, body in bodies:
            _require_beside(stop, optic, body)


def _across_axis(problem: Problem, lens: Lens) -> float | None:
    """Return the z of a plane target across the axis, before which all stops of a lens on it lie."""
    target, place = problem.target, problem.target.position
    if target.surface != "plane" or any(target.tilt[:2]) or problem.element:
        return None
    if target.distance is not None:
        return lens.thickness + target.distance
    return None if place is None else place[2]


def _require_beside(stop: Stop, optic: Optic, lens: Lens) -> None:
    """Refuse a stop that reaches into a lens or a mirror.  lens : of it, its blank."""
    seen, (low, high) = stop.moved(pose_of(optic).inverse()), lens_heights(optic, lens)
    section = _section(low, high, lens, seen)
    if len(section) and _cuts(seen, section, isinstance(optic, Placed)):
        named, frame = (optic.table, " of its own frame") if isinstance(optic, Placed) else ("the lens", "")
        raise UserError(
            f"{stop.name} reaches into {named}, which may fill z = {low:.4g} to {high:.4g} mm{frame}; "
            "move it out of there, or make its hole larger"
        )


def lens_heights(optic: Optic, lens: Lens) -> tuple[float, float]:
    """Return between which z a lens lies in its own frame, whatever its sags become, mm."""
    ends = []
    for sign, surface, spec, vertex in (
        (-1.0, lens.front, optic.front, 0.0),
        (1.0, lens.rear, optic.rear, lens.thickness),
    ):
        u, v = np.concatenate([_around(), np.array([surface.half_width]).T], axis=1)
        gauge = surface.outline.gauge(u, v)
        rim = (sign * surface.conic(u / gauge, v / gauge)).max()
        ends.append(vertex + sign * (max(0.0, float(rim)) + freedom_of(spec)))
    return ends[0], ends[1]


def _section(low: float, high: float, lens: Lens, stop: Stop) -> Floats:
    """Return the corners of the section of the stop's plane with what the lens may fill, (n, 2), own mm.

    It is a square around the lens, clipped by the planes a . p <= b that the lens lies within.
    """
    far = np.max([s.outline.support(_around()) for s in (lens.front, lens.rear)], axis=0)
    normals = np.zeros((3, DIRECTIONS + 2))
    normals[:2, :-2], normals[2, -2:] = _around(), (-1, 1)
    far = np.concatenate([far, [-low, high]])
    back = stop.pose.inverse()
    own, rest = back.directions(normals), far - normals.T @ stop.pose.shift
    middle = back.points(np.array([0.0, 0.0, (low + high) / 2]))
    size = 2 * (far.max() + high - low)
    section = middle[:2] + size * CORNERS[:2].T
    for a, b in zip(own[:2].T, rest):
        section = _clipped(section, section @ a - b)
    return section


def _around() -> Floats:
    """Return directions in the plane z = 0, (2, n)."""
    angles = 2 * np.pi / DIRECTIONS * np.arange(DIRECTIONS)
    return np.stack([np.cos(angles), np.sin(angles)])


def _clipped(polygon: Floats, over: Floats) -> Floats:
    """Return the part of a convex polygon, (n, 2), where a linear function, (n,) at its corners, is <= 0."""
    out = []
    for p, q, f, g in zip(polygon, np.roll(polygon, -1, axis=0), over, np.roll(over, -1)):
        if f <= 0:
            out.append(p)
        if (f <= 0) != (g <= 0):
            out.append(p + f / (f - g) * (q - p))
    return np.array(out).reshape(-1, 2)


def _cuts(stop: Stop, section: Floats, ends: bool) -> bool:
    """Return whether there is a plate within a convex section of its plane.

    ends : a plate with a hole ends before what lies all beside the hole.
    """

    def gauges(outline: Outline) -> tuple[float, float]:
        """Return the least and the greatest gauge over the section."""
        at = np.arange(PARTS)[:, None, None] / PARTS
        rim = (section + at * (np.roll(section, -1, axis=0) - section)).reshape(-1, 2)
        x, y = section.T
        sides = x * np.roll(y, -1) - y * np.roll(x, -1)
        gauge = outline.gauge(*rim.T)
        return (0.0 if (sides >= 0).all() or (sides <= 0).all() else float(gauge.min())), float(gauge.max())

    least, most = gauges(stop.outline)
    inner = gauges(stop.inner) if stop.inner else (np.inf, np.inf)
    if stop.hole:
        return (most > 1 and not (ends and least >= 1)) or inner[0] < 1
    return least <= 1 and inner[1] > 1
