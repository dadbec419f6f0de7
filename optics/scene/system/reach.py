"""Whether light can reach an element and its target: from before them, clear of the element, no farther aside
than it bends.  All is seen in the frame of the element."""

from __future__ import annotations

from collections.abc import Iterator

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
    lens, receiver = system.lens, system.target.receiver.seen_from(system.pose)
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
            f"the target cuts {_named(system)}, which may fill |x| <= {x:.4g}, |y| <= {y:.4g}, z = {low:.4g} "
            f"to {high:.4g} mm{_own_frame(system)}; move target.position away, or turn it by target.tilt"
        )


def require_met(system: OpticalSystem) -> None:
    """Refuse a lens or a mirror that light meets from behind.

    Raises
    ------
    UserError : names the element.
    """
    back = system.pose.inverse()
    if system.source.from_afar:
        if back.directions(np.array([0.0, 0.0, 1.0]))[2] <= 0:
            raise UserError(
                f"light along +z meets {_named(system)} from behind, or never; turn it by "
                f"{system.problem.optic.key('tilt')} so that light comes from its own -z"
            )
        return
    z = float(back.points(np.array(system.source.middle))[2])
    if z >= 0:
        raise UserError(
            f"the source lies behind {_named(system)}, at its own z = {z:.4g} mm; turn it by "
            f"{system.problem.optic.key('tilt')}, or move it, so that light comes from its own -z"
        )


def require_lens_on_axis(system: OpticalSystem, what: str) -> None:
    """Refuse an element elsewhere where only the lens of [lens] is known.  what : is not known of it.

    Raises
    ------
    UserError : names the element.
    """
    if system.problem.element:
        raise UserError(
            f"{what} are computed of [lens] on the axis only, and this is {system.problem.optic.table}; "
            "change its numbers by --set and trace the light of each"
        )


def _named(system: OpticalSystem) -> str:
    """Return what a sentence calls the lens or the mirror."""
    return "the lens" if system.problem.lens else system.problem.optic.table


def _own_frame(system: OpticalSystem) -> str:
    """Return the words that name the frame of an element."""
    return "" if system.problem.lens else " of its own frame"


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

    Light leaves the rear towards +z, or a mirror towards -z, and goes through the target along its normal.
    A surface of index n bends
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
    receiver = target.receiver.seen_from(system.pose)
    normals = np.stack(np.broadcast_arrays(*receiver.normal(u, v)))
    points = FAR * normals if target.far_field else np.stack(np.broadcast_arrays(*receiver.points(u, v)))
    _require_lit_side(system, points, normals, light[rows, columns] / light.sum())
    if system.parallel:
        _require_gentle(system, points)


def _require_lit_side(system: OpticalSystem, points: Floats, normals: Floats, share: Floats) -> None:
    """Refuse points (3, n) that no light of the rear meets from before.  share : of the light, (n,)."""
    lens, (low, high) = system.lens, lens_heights(system.problem, system.lens)
    rear = (*((-h, h) for h in lens.rear.half_width), (low, high))
    nearest = sum(np.minimum(a * n, b * n) for (a, b), n in zip(rear, normals))  # of the corners
    sign, end = (-1, high) if system.reflects else (1, low)
    before, behind = sign * (points[2] - end) <= 0, (points * normals).sum(axis=0) <= nearest
    if before.any():
        towards = "-z" if system.reflects else "+z"
        raise UserError(
            f"{share[before].sum():.0%} of the light is asked for beside {_named(system)} or behind where "
            f"light leaves it, beyond z = {end:.4g} mm{_own_frame(system)}: it goes towards {towards}; "
            "move target.position or turn target.tilt there"
        )
    if behind.any():
        raise UserError(
            f"{share[behind].sum():.0%} of the light is asked for where the target shows {_named(system)} "
            "its back; light goes through a target along its own +z: turn it by target.tilt, or make it "
            "smaller"
        )


def _require_gentle(system: OpticalSystem, points: Floats) -> None:
    """Refuse points (3, n) farther aside from a parallel beam than a plane front and a rear can send it."""
    lens, (x, y, z) = system.problem.optic, points
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
