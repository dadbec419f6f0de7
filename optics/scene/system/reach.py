"""Whether light can reach an element and its target: from before them, clear of the element, no farther aside
than it bends.  All is seen in the frame of the element."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import UserError
from optics.scene.keys import AUTO
from optics.scene.problem import FaceMet, Optic, Placed, Problem
from optics.scene.system.elements import pose_of
from optics.scene.system.geometry_search import nearest_geometry
from optics.scene.system.stops import lens_heights
from optics.scene.system.system import System
from thbcad.checks import Floats
from thbcad.lens import Lens

LINES = 17  # through the box around the lens in each direction, along which a target is looked for
FAR = 1e9  # mm, of points of the far field
GRAZING = 0.26  # cosine, some 75 degrees: no geometry is proposed where light comes in more aside
EDGE_ON = 1e-9  # of a cosine: light that meets an element so, along its face, never meets it
LITTLE = 0.01  # of the light
MOST_PIXELS = 1024  # of a target in each direction, that are looked at: more are merged
POINTS = 33  # of a target in each direction, that are looked for in the box


def require_clear_of_lens(system: System) -> None:
    """Refuse a target that cuts an element: the box that the designed one may fill, or the solid of another.

    Raises UserError : names the box.
    """
    for optic, lens in system.unshaped.elements:
        low, high = lens_heights(optic, lens)
        x, y = np.max([lens.front.half_width, lens.rear.half_width], axis=0).tolist()
        points = _target_within(system, optic, np.array([[-x, x], [-y, y], [low, high]]))
        if points.size if optic is system.problem.optic else _holds(lens, points).any():
            raise UserError(
                f"the target cuts {_named(optic)}, which may fill |x| <= {x:.4g}, |y| <= {y:.4g}, "
                f"z = {low:.4g} to {high:.4g} mm{_own_frame(system)}; move target.position away, or turn it "
                "by target.tilt"
            )


def _target_within(system: System, optic: Optic, box: Floats) -> Floats:
    """Return points of the target within the box (3, 2) around an element, in its frame, (3, n): those of a
    grid, and those on lines through the box."""
    receiver = system.target.receiver.seen_from(pose_of(optic))
    half_width = np.array(system.target.settings.half_width)
    grid = np.meshgrid(*(h * np.linspace(-1, 1, POINTS) for h in half_width))
    points = np.stack(np.broadcast_arrays(*receiver.points(*grid))).reshape(3, -1)
    found = [points[:, ((points >= box[:, :1]) & (points <= box[:, 1:])).all(axis=0)]]
    for start, direction, length in _lines(box):
        landed = receiver.land(start, direction)
        within = (np.abs([landed.u, landed.v]) <= half_width[:, None]).all(axis=0)
        cuts = landed.met & within & (landed.length >= 0) & (landed.length <= length)
        found.append((start + np.where(cuts, landed.length, 0.0) * direction)[:, cuts])
    return np.concatenate(found, axis=1)


def require_met(system: System, least: float = EDGE_ON) -> None:
    """Refuse an element that light would meet from behind: each comes from its own -z, from the one before.

    least : cosine of a beam's angle to the axis of the first.

    Raises UserError : names the element.
    """
    met = system.problem.faces_met
    entered = [face.optic for k, face in enumerate(met) if not k or face.optic is not met[k - 1].optic]
    if system.source.from_afar:
        first = pose_of(entered[0]).inverse()
        if first.directions(np.array([0.0, 0.0, 1.0]))[2] <= least:
            raise UserError(
                f"light along +z meets {_named(entered[0])} from behind, or never; turn it by "
                f"{entered[0].key('tilt')} so that light comes from its own -z"
            )
    places = [(_named(optic), pose_of(optic).shift) for optic in entered]
    if not system.source.from_afar:
        places.insert(0, ("the source", np.array(system.source.middle)))
    for (name, place), optic in zip(places, entered[system.source.from_afar :]):
        z = float(pose_of(optic).inverse().points(place)[2])
        if z >= 0:
            raise UserError(
                f"{name} lies behind {_named(optic)}, at its own z = {z:.4g} mm; turn it by "
                f"{optic.key('tilt')}, or move it, so that light comes from its own -z"
            )


def require_apart(system: System) -> None:
    """Refuse elements of which one holds points of the faces of another, before optimisation.

    Raises UserError : names both.
    """
    bodies = system.unshaped.elements
    for (one, lens), (other, solid) in permutations(bodies, 2):
        for surface, vertex in ((lens.front, 0.0), (lens.rear, lens.thickness)):
            x, y = np.meshgrid(*(h * np.linspace(-1, 1, POINTS) for h in surface.half_width))
            inside = surface.outline.contains(x, y)
            x, y = x[inside], y[inside]
            points = np.stack([x, y, vertex + surface(x, y)])
            if _holds(solid, pose_of(other).inverse().points(pose_of(one).points(points))).any():
                raise UserError(
                    f"{_named(one)} and {_named(other)} overlap; move {one.key('position')} or "
                    f"{other.key('position')} away"
                )


def _holds(lens: Lens, points: Floats) -> NDArray[np.bool_]:
    """Return which points, (3, n) in its frame, a lens holds; between outlines it is as wide as the wider."""
    x, y, z = points
    within = lens.front.outline.contains(x, y) | lens.rear.outline.contains(x, y)
    low, high = (
        surface(*(np.clip(a, -h, h) for a, h in zip((x, y), surface.half_width)))
        for surface in (lens.front, lens.rear)
    )
    held: NDArray[np.bool_] = within & (z > low) & (z < lens.thickness + high)
    return held


def require_lens_on_axis(system: System, what: str, instead: str) -> None:
    """Refuse an element elsewhere where only the lens of [lens] is known.

    what : is not known of it.  instead : what the user may do.

    Raises UserError : names the element.
    """
    if system.problem.element:
        raise UserError(
            f"{what} are computed of [lens] on the axis only, and this is {system.problem.optic.table}; "
            f"{instead}"
        )


def require_light_of_one_lens(system: System, what: str) -> None:
    """Refuse a plate before a plane, whose light is a sum, where only that of one lens is followed.

    what : is not known of it.

    Raises UserError : names the key.
    """
    if system.displaced:
        raise UserError(
            f"{what} follow the light of one lens, and on a plane that of a plate is a sum; leave out "
            "lens.array, or take the far field"
        )


def _named(optic: Optic) -> str:
    """Return what a sentence calls a lens or a mirror."""
    return optic.table if isinstance(optic, Placed) else "the lens"


def _own_frame(system: System) -> str:
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


def require_reachable(system: System) -> None:
    """Refuse a target of which no light of the lens reaches what is to be lit.

    Light leaves the rear towards +z, or a mirror towards -z, and goes through the target along its normal.
    A surface of index n bends rays by less than arccos(1 / n) before it reflects them totally: behind a plane
    front no rear sends parallel light farther aside from the beam than that, seen from the plane of the rear
    vertex.  A screen on which any light will do is not judged.

    Raises UserError : names the share of the light, the angle needed and the one that the index allows, and
        the nearest geometry that works.
    """
    if _is_requested(system.problem) and (fault := _fault(system)):
        found = " or ".join(nearest_geometry(system, can_be_lit))
        raise UserError(f"{fault}, such as by {found}" if found else fault)


def _is_requested(problem: Problem) -> bool:
    """Return whether the light must have a certain distribution or must arrive on the lit region."""
    limits = problem.verify
    lower = limits.min_over_mean, limits.min_over_max, limits.lit_efficiency
    upper = limits.rsd, limits.rel_l2
    any_will_do = not any(lower) and all(limit in (np.inf, AUTO) for limit in upper)
    return problem.target.kind != "tophat" or not any_will_do


def can_be_lit(system: System) -> bool:
    """Return whether light reaches all that is to be lit, and grazes neither the target nor the lens.

    Raises UserError : the target cuts the lens, or light meets an element from behind, or elements overlap.
    """
    if system.problem.element:
        require_met(system, GRAZING)
        require_apart(system)
    if not system.target.far_field:
        require_clear_of_lens(system)
    if not _shaped_last(system):
        return not _fault(system)
    points, normals, _ = _asked(system, system.problem.optic)
    way = points - np.array([[0.0], [0.0], [0.0 if system.reflects else system.base.thickness]])
    least = GRAZING * np.linalg.norm(way, axis=0)
    clear = ((way * normals).sum(axis=0) > least) & (np.abs(way[2]) > least)
    return bool(clear.all()) and not _fault(system)


def _shaped_last(system: System) -> bool:
    """Return whether nothing turns the light behind the face that is shaped."""
    return system.shaped_face is system.problem.faces_met[-1]


def _fault(system: System) -> str:
    """Return what light does not reach, and a remedy in words; "" where it reaches all."""
    last = system.problem.faces_met[-1]
    lens = next(lens for optic, lens in system.unshaped.elements if optic is last.optic)
    points, normals, share = _asked(system, last.optic)
    fault = _unlit(system, last, lens, points, normals, share)
    parallel = system.parallel and _shaped_last(system)
    return fault or (_too_far(system, points, share) if parallel else "")


def _asked(system: System, optic: Optic) -> tuple[Floats, Floats, Floats]:
    """Return points of the target that are to be lit, (3, n), its normals there, both in the frame of an
    element, and shares of the light."""
    target = system.target
    screen = target.screen(coarsening=-(-max(target.settings.pixels) // MOST_PIXELS))
    light = target.irradiance(screen, 1.0)
    rows, columns = np.nonzero(light)
    u, v = screen.centres[0][columns], screen.centres[1][rows]
    receiver = target.receiver.seen_from(pose_of(optic))
    normals = np.stack(np.broadcast_arrays(*receiver.normal(u, v)))
    points = FAR * normals if target.far_field else np.stack(np.broadcast_arrays(*receiver.points(u, v)))
    return points, normals, light[rows, columns] / light.sum()


def _unlit(system: System, last: FaceMet, lens: Lens, points: Floats, normals: Floats, share: Floats) -> str:
    """Return what is wrong with points (3, n) that no light of the last face meets from before.

    last : the face, whose element has this lens.  share : of the light, (n,).
    """
    low, high = lens_heights(last.optic, lens)
    rear = (*((-h, h) for h in lens.rear.half_width), (low, high))
    nearest = sum(np.minimum(a * n, b * n) for (a, b), n in zip(rear, normals))  # of the corners
    back = last.reflects != last.backwards
    sign, end = (-1, high) if back else (1, low)
    before, behind = sign * (points[2] - end) <= 0, (points * normals).sum(axis=0) <= nearest
    named = _named(last.optic)
    if before.any():
        towards = "-z" if back else "+z"
        return (
            f"{_percent(share[before])} of the light is asked for beside {named} or behind where "
            f"light leaves it, beyond z = {end:.4g} mm{_own_frame(system)}: it goes towards {towards}; "
            "move target.position or turn target.tilt there"
        )
    if behind.any():
        return (
            f"{_percent(share[behind])} of the light is asked for where the target shows {named} its back; "
            "light goes through a target along its own +z: turn it by target.tilt, or make it smaller"
        )
    return ""


def _too_far(system: System, points: Floats, share: Floats) -> str:
    """Return what is wrong with points (3, n) farther aside from a parallel beam than a plane front and a
    rear can send it.  share : of the light, (n,)."""
    lens, (x, y, z) = system.problem.optic, points
    beam = [min(s, f) for s, f in zip(system.problem.source.half_width, lens.front.half_width)]
    aside = np.hypot(*(np.maximum(np.abs(a) - b, 0) for a, b in zip((x, y), beam)))
    needed = np.degrees(np.arctan2(aside, z - lens.thickness))
    most = np.degrees(np.arccos(1 / lens.known_index))
    if needed.max() < most:
        return ""
    return (
        f"{_percent(share[needed >= most])} of the light is asked for up to {needed.max():.1f} degrees aside "
        f"from the beam, but a surface of index {lens.known_index:g} bends rays by less than {most:.1f} "
        f"degrees before it reflects them totally; {system.problem.target.gentler}"
    )


def _percent(shares: Floats) -> str:
    """Return a sum of shares in words."""
    return f"{share:.0%}" if (share := shares.sum()) > LITTLE else f"less than {LITTLE:.0%}"
