"""Whether light can reach the target: from before it, clear of the lens, no farther aside than it bends."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from optics.base.runtime import UserError
from optics.scene.system.optical_system import OpticalSystem
from optics.scene.system.stops import lens_heights
from thbcad.checks import Floats

LINES = 17  # through the box around the lens in each direction, along which a target is looked for
FAR = 1e9  # mm, of points of the far field
POINTS = 33  # of a target in each direction, that are looked for in the box


def require_clear_of_lens(system: OpticalSystem) -> None:
    """Refuse a target that cuts the lens: its rectangle meets lines through the box around the lens.

    Raises
    ------
    UserError : names the box.
    """
    lens, receiver = system.lens, system.target.receiver
    low, high = lens_heights(system.problem, lens)
    x, y = np.max([lens.front.half_width, lens.rear.half_width], axis=0).tolist()
    box = np.array([[-x, x], [-y, y], [low, high]])
    half_width, cuts = np.array(system.target.settings.half_width), False
    for start, direction, length in _lines(box):
        landed = receiver.land(start, direction)
        within = (np.abs([landed.u, landed.v]) <= half_width[:, None]).all(axis=0)
        cuts |= bool((landed.met & within & (landed.length >= 0) & (landed.length <= length)).any())
    grid = np.meshgrid(*(h * np.linspace(-1, 1, POINTS) for h in half_width))
    points = np.stack(np.broadcast_arrays(*receiver.points(*grid))).reshape(3, -1)
    if cuts or ((points >= box[:, :1]) & (points <= box[:, 1:])).all(axis=0).any():
        raise UserError(
            f"the target cuts the lens, which may fill |x| <= {x:.4g}, |y| <= {y:.4g}, z = {low:.4g} to "
            f"{high:.4g} mm; move target.position away, or turn it by target.tilt"
        )


def _lines(box: Floats) -> Iterator[tuple[Floats, Floats, float]]:
    """Yield origins and directions (3, n) of lines through a box (3, 2), both ways along its sides, and their
    length."""
    rows = np.linspace(box[:, 0], box[:, 1], LINES, axis=1)
    for axis, length in enumerate(np.ptp(box, axis=1).tolist()):
        starts = np.meshgrid(*(row[:1] if k == axis else row for k, row in enumerate(rows)))
        start = np.stack([s.ravel() for s in starts])
        along = np.zeros_like(start)
        along[axis] = 1.0
        yield start, along, length
        yield start + length * along, -along, length


def require_reachable(system: OpticalSystem) -> None:
    """Refuse a target of which no light of the lens reaches what is to be lit.

    Light leaves the rear towards +z and goes through the target along its normal.  A surface of index n bends
    rays by less than arccos(1 / n) before it reflects them totally: behind a plane front no rear sends
    parallel light farther aside from the beam than that, seen from the plane of the rear vertex.

    Raises
    ------
    UserError : names the share of the light, or the angle needed and the one that the index allows.
    """
    target, screen = system.target, system.target.screen()
    light = target.irradiance(screen, 1.0)
    rows, columns = np.nonzero(light)
    u, v = screen.centres[0][columns], screen.centres[1][rows]
    normals = np.stack(np.broadcast_arrays(*target.receiver.normal(u, v)))
    points = FAR * normals
    if not target.far_field:
        points = np.stack(np.broadcast_arrays(*target.receiver.points(u, v)))
    _require_lit_side(system, points, normals, light[rows, columns] / light.sum())
    if system.parallel:
        _require_gentle(system, points)


def _require_lit_side(system: OpticalSystem, points: Floats, normals: Floats, share: Floats) -> None:
    """Refuse points (3, n) that no light of the rear meets from before.  share : of the light, (n,)."""
    lens, (low, high) = system.lens, lens_heights(system.problem, system.lens)
    rear = (*((-h, h) for h in lens.rear.half_width), (low, high))
    nearest = np.min([np.array(corner) @ normals for corner in product(*rear)], axis=0)
    before, behind = points[2] <= low, (points * normals).sum(axis=0) <= nearest
    if before.any():
        raise UserError(
            f"{share[before].sum():.0%} of the light is asked for beside or before the lens, at z below "
            f"{low:.4g} mm, and light leaves it towards +z; "
            "move target.position or turn target.tilt there"
        )
    if behind.any():
        raise UserError(
            f"{share[behind].sum():.0%} of the light is asked for where the target shows the lens its back; "
            "light goes through a target along its own +z: turn it by target.tilt, or make it smaller"
        )


def _require_gentle(system: OpticalSystem, points: Floats) -> None:
    """Refuse points (3, n) farther aside from a parallel beam than a plane front and a rear can send it."""
    lens, (x, y, z) = system.problem.lens, points
    beam = [min(s, f) for s, f in zip(system.problem.source.half_width, lens.front.half_width)]
    aside = np.max([np.maximum(np.abs(a) - b, 0) for a, b in zip((x, y), beam)], axis=0)
    needed = np.degrees(np.arctan2(aside, z - lens.thickness).max())
    most = np.degrees(np.arccos(1 / lens.known_index))
    if needed >= most:
        raise UserError(
            f"the target asks for light {needed:.1f} degrees aside from the beam, but a surface of index "
            f"{lens.known_index:g} bends rays by less than {most:.1f} degrees; "
            f"{system.problem.target.gentler}"
        )
