"""The nearest geometry that works: how far one key of the target must change until light can be sent there.

A target is turned until it faces the lens or the mirror, moved farther away along its line to it, swung to
where light goes that nothing bends, or made smaller.  Each is tried in STEPS steps, by bisection.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable
from math import floor, log10

import numpy as np

from optics.base.runtime import UserError
from optics.scene.system.optical_system import OpticalSystem
from thbcad.checks import Floats
from thbcad.poses import Pose

STEPS = 64
FARTHEST = 8.0  # times the distance that it has
DIGITS = 3  # of lengths
ANGLES = 1  # digits behind the point, of degrees
PARALLEL = 1e-9  # of the sine of an angle

Works = Callable[[OpticalSystem], bool]


def nearest_geometry(system: OpticalSystem, works: Works) -> list[str]:
    """Return options `--set KEY=VALUE`, each of which makes a system work, with the least change of its key.

    Every value that is returned was tried as it is written.  A smaller target is named where nothing else
    serves.

    works : told of a system with another target.
    """
    found = [*filter(None, (_nearest(system, works, way) for way in (_turned, _farther, _swung)))]
    return found or [*filter(None, [_nearest(system, works, _smaller)])]


def _nearest(
    system: OpticalSystem, works: Works, way: Callable[[OpticalSystem, float], dict[str, list[float]]]
) -> str:
    """Return the option for the first step of a way that works; "" where there is none."""
    if not way(system, 1.0) or not _tried(system, works, way(system, 1.0)):
        return ""
    low, high = 0, STEPS
    while high - low > 1:
        middle = (low + high) // 2
        serves = _tried(system, works, way(system, middle / STEPS))
        low, high = (low, middle) if serves else (middle, high)
    ((key, value),) = way(system, high / STEPS).items()
    numbers = ", ".join(f"{v:g}" for v in value)
    return (
        f"--set {shlex.quote(f'target.{key}=[{numbers}]' if len(value) > 1 else f'target.{key}={numbers}')}"
    )


def _tried(system: OpticalSystem, works: Works, change: dict[str, list[float]]) -> bool:
    try:
        return works(system.with_target(**{k: v[0] if len(v) == 1 else tuple(v) for k, v in change.items()}))
    except UserError:
        return False


def _turned(system: OpticalSystem, t: float) -> dict[str, list[float]]:
    """Return the tilt of the target, turned about its middle; at t = 1 it faces the lens."""
    pose = system.target.receiver.pose
    turn = _turn(pose.rotation[:, 2], _straight(system) if system.target.far_field else _line(system))
    if not turn.any():
        return {}
    return {"tilt": [round(a, ANGLES) + 0.0 for a in (Pose.at(rotation_vector=t * turn) @ pose).tilt]}


def _farther(system: OpticalSystem, t: float) -> dict[str, list[float]]:
    """Return the place of the target, FARTHEST times as far away at t = 1."""
    times, settings = FARTHEST**t, system.target.settings
    if system.target.far_field:
        return {}
    if settings.position is None:
        return {"distance": _rounded(np.array([times * system.problem.throw]))}
    return {"position": _rounded(_vertex(system) + times * _line(system))}


def _swung(system: OpticalSystem, t: float) -> dict[str, list[float]]:
    """Return the place of the target, as far away as it is; at t = 1 no light to its middle is bent."""
    if system.target.far_field or system.target.settings.position is None:
        return {}
    turn = _turn(_line(system), _straight(system))
    return {
        "position": _rounded(_vertex(system) + Pose.at(rotation_vector=t * turn).directions(_line(system)))
    }


def _smaller(system: OpticalSystem, t: float) -> dict[str, list[float]]:
    """Return the half-widths of the target, of which hardly anything is left at t = 1."""
    return {"half_width": _rounded((1 - t * (1 - 1 / STEPS)) * np.array(system.target.settings.half_width))}


def _vertex(system: OpticalSystem) -> Floats:
    """Return where light leaves: the vertex of the rear, or of a mirror, mm."""
    z = 0.0 if system.reflects else system.lens.thickness
    return np.array(system.pose.points(np.array([0.0, 0.0, z])))


def _line(system: OpticalSystem) -> Floats:
    """Return the way from there to the middle of the target, mm."""
    return np.array(system.target.receiver.pose.shift - _vertex(system))


def _straight(system: OpticalSystem) -> Floats:
    """Return the direction along which light leaves that a plate, or a plane mirror, sends on."""
    along = np.array([0.0, 0.0, 1.0])
    axis = np.array(system.pose.directions(along))
    if not system.source.from_afar:
        along = _vertex(system) - system.source.middle
    return along - 2 * (along @ axis) * axis if system.reflects else along


def _turn(start: Floats, end: Floats) -> Floats:
    """Return the rotation vector that takes a direction to another one, rad; of opposite ones one of many."""
    a, b = (v / np.linalg.norm(v) for v in (start, end))
    axis, cosine = np.cross(a, b), float(a @ b)
    sine = float(np.linalg.norm(axis))
    if sine < PARALLEL:
        aside = np.cross(a, np.eye(3)[np.argmin(np.abs(a))])
        return np.pi * aside / np.linalg.norm(aside) if cosine < 0 else np.zeros(3)
    return np.arctan2(sine, cosine) * axis / sine


def _rounded(lengths: Floats) -> list[float]:
    """Return lengths with DIGITS digits of the greatest of them."""
    digits = DIGITS - 1 - floor(log10(np.abs(lengths).max()))
    return (np.round(lengths, digits) + 0.0).tolist()
