"""The nearest geometry that works: how far one key of the scene must change until light can be sent there.

A target is turned until it faces the lens or the mirror, moved farther away along its line to it, swung to
where light goes that nothing bends, or made smaller; an element is turned towards the target.  Each is tried
in STEPS steps: every STRIDE of them, then by bisection.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import floor, log10
from typing import Any

import numpy as np

from optics.base.runtime import UserError
from optics.scene.problem import Placed, Problem
from optics.scene.system.system import System
from thbcad.checks import Floats
from thbcad.poses import Pose

STEPS, STRIDE = 64, 8
FARTHEST = 8.0  # times the distance that it has
DIGITS = 3  # of lengths
ANGLES = 1  # digits behind the point, of degrees
NOTHING = 1e-9  # mm, of a length; of the sine of an angle


@dataclass(frozen=True)
class Step:
    """A key with another value, and the problem that has it."""

    key: str
    value: list[float]
    problem: Problem

    @property
    def option(self) -> str:
        """As it is written on a command line."""
        numbers = ", ".join(f"{v:g}" for v in self.value)
        value = f"[{numbers}]" if len(self.value) > 1 else numbers
        return f"--set {shlex.quote(f'{self.key}={value}')}"


def nearest_geometry(system: System, works: Callable[[System], bool]) -> list[str]:
    """Return options `--set KEY=VALUE`, each of which makes a system work, with the least change of its key.

    Every value that is returned was tried as it is written.  A smaller target is named where nothing else
    serves.

    works : told of a system with another target, or with its element turned.
    """

    def nearest(way: Callable[[System, float], Step | None]) -> list[str]:
        def tried(k: int) -> Step | None:
            try:
                step = way(system, k / STEPS)
                return step if step and works(system.elsewhere(step.problem)) else None
            except UserError:
                return None

        high, found = next(
            ((k, step) for k in range(STRIDE, STEPS + 1, STRIDE) if (step := tried(k))), (0, None)
        )
        low = high - STRIDE
        while found and high - low > 1:
            step = tried(middle := (low + high) // 2)
            low, high, found = (low, middle, step) if step else (middle, high, found)
        return [found.option] if found else []

    every = [option for way in (_turned, _leant, _farther, _swung) for option in nearest(way)]
    return every or nearest(_smaller)


def _turned(system: System, t: float) -> Step | None:
    """Return the tilt of the target, turned about its middle; at t = 1 it faces the lens."""
    pose = system.target.receiver.pose
    turn = _turn(pose.rotation[:, 2], _straight(system) if system.target.far_field else _line(system))
    return _of_target(system, "tilt", _tilt(t * turn, pose)) if turn.any() else None


def _leant(system: System, t: float) -> Step | None:
    """Return the tilt of an element; at t = 1 it points to the target, or reflects light to its middle."""
    optic = system.problem.optic
    if not isinstance(optic, Placed):
        return None
    far, normal = system.target.far_field, system.target.receiver.pose.rotation[:, 2]
    goal = normal if far else _along(_line(system))
    if system.reflects:
        goal = _along(_coming(system)) - goal  # nothing where light would have to go straight on
    tilt = _tilt(t * _turn(system.pose.rotation[:, 2], goal), system.pose)
    return Step(optic.key("tilt"), tilt, system.problem.with_optic(tilt=tuple(tilt)))


def _farther(system: System, t: float) -> Step | None:
    """Return the place of the target, FARTHEST times as far away at t = 1."""
    times = FARTHEST**t
    if system.target.far_field:
        return None
    if system.target.settings.position is None:
        return _of_target(system, "distance", _rounded(np.array([times * system.problem.throw])))
    return _of_target(system, "position", _rounded(_vertex(system) + times * _line(system)))


def _swung(system: System, t: float) -> Step | None:
    """Return the place of the target, as far away as it is; at t = 1 no light to its middle is bent."""
    if system.target.far_field or system.target.settings.position is None:
        return None
    swing = Pose.at(rotation_vector=t * _turn(_line(system), _straight(system)))
    return _of_target(system, "position", _rounded(_vertex(system) + swing.directions(_line(system))))


def _smaller(system: System, t: float) -> Step:
    """Return the half-widths of the target, of which hardly anything is left at t = 1."""
    half = np.array(system.target.settings.half_width)
    return _of_target(system, "half_width", _rounded((1 - t * (1 - 1 / STEPS)) * half))


def _of_target(system: System, key: str, value: list[float]) -> Step:
    """Return another value of a key of the target."""
    problem = system.problem
    changes: dict[str, Any] = {key: tuple(value) if len(value) > 1 else value[0]}
    return Step(f"target.{key}", value, replace(problem, target=replace(problem.target, **changes)))


def _tilt(turn: Floats, pose: Pose) -> list[float]:
    """Return the tilt of a pose that is turned by a rotation vector."""
    return [round(a, ANGLES) + 0.0 for a in (Pose.at(rotation_vector=turn) @ pose).tilt]


def _vertex(system: System) -> Floats:
    """Return where light leaves: the vertex of the rear, or of a mirror, mm."""
    z = 0.0 if system.reflects else system.base.thickness
    return np.array(system.pose.points(np.array([0.0, 0.0, z])))


def _line(system: System) -> Floats:
    """Return the way from there to the middle of the target, mm."""
    return np.array(system.target.receiver.pose.shift - _vertex(system))


def _coming(system: System) -> Floats:
    """Return a vector along the light that comes to the vertex."""
    afar = system.source.from_afar
    return np.array((0.0, 0.0, 1.0)) if afar else _vertex(system) - system.source.middle


def _straight(system: System) -> Floats:
    """Return a vector along the light that leaves a plate, or a plane mirror."""
    along, axis = _coming(system), system.pose.rotation[:, 2]
    return along - 2 * (along @ axis) * axis if system.reflects else along


def _along(vector: Floats) -> Floats:
    """Return the direction of a vector; zeros where it has none."""
    length = np.linalg.norm(vector)
    return vector / length if length > NOTHING else np.zeros(3)


def _turn(start: Floats, end: Floats) -> Floats:
    """Return the rotation vector that takes a direction to another one, rad; of opposite ones one of many.
    It is zero where there is no direction."""
    a, b = _along(start), _along(end)
    axis, cosine = np.cross(a, b), float(a @ b)
    sine = float(np.linalg.norm(axis))
    if sine < NOTHING:
        aside = np.cross(a, np.eye(3)[np.argmin(np.abs(a))])
        return np.pi * aside / np.linalg.norm(aside) if cosine < 0 else np.zeros(3)
    return np.arctan2(sine, cosine) * axis / sine


def _rounded(lengths: Floats) -> list[float]:
    """Return lengths with DIGITS digits of the greatest of them."""
    digits = DIGITS - 1 - floor(log10(max(np.abs(lengths).max(), NOTHING)))
    return (np.round(lengths, digits) + 0.0).tolist()
