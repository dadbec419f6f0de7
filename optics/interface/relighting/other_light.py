"""A finished lens in other light, named in words: sun, LED, luminaire, the source of another problem."""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from optics.base.runtime import Backend, UserError
from optics.light.analysis import Measurement, measure
from optics.scene.problem import (
    SUN,
    MirrorElement,
    Optic,
    Placed,
    Problem,
    Source,
    base_of,
    freedom_of,
    load_problem,
)
from optics.scene.system import System, absorption_at, index_at, pose_of, solvable_system, source_of
from thbcad.poses import Pose
from thbcad.sags import Conic


def relit(system: System, source: Source, backend: Backend) -> Measurement:
    """Return what the lens of a system delivers in the light of another source.

    In light of another wavelength the lens has its index and absorption there, if its material or its tables
    give them.

    backend : of double precision.

    Raises UserError : a source that does not go with the lens, such as one that lies in it.
    """
    other, own = replace(system.problem, source=source), system.problem.source.wavelength
    shapes = dict(system.shapes)
    for optic in system.problem.optics:
        if isinstance(optic, MirrorElement):
            continue
        try:
            index = index_at(optic, source.wavelength, own)
        except UserError:
            index = optic.known_index
        absorption = optic.absorption
        if optic.absorptions:
            with suppress(UserError):  # of a table that does not reach this wavelength
                absorption = absorption_at(optic, source.wavelength)
        if (optic.index, optic.absorption) != (index, absorption):
            other = other.with_optic(optic, index=index, absorption=absorption)
        if optic.called in shapes:
            shapes[optic.called] = replace(shapes[optic.called], index=index)
    return measure(solvable_system(other).with_shapes(shapes), backend)


EDGE_ON = 1e-9  # of a cosine: light goes along a face
ACROSS = 9  # points of a face each way, its corners among them
LED = re.compile(r"led:(?P<size>[0-9.eE+-]+)mm(@(?P<distance>[0-9.eE+-]+)mm)?", re.IGNORECASE)
LUMINAIRE = re.compile(r"(?P<file>.+\.(ies|ldt))(@(?P<distance>[0-9.eE+-]+)mm)?", re.IGNORECASE)
FORMS = '"sun", "led:SIZEmm", "FILE.ies" or "FILE.ldt" (each may end in "@DISTANCEmm") or a problem file'


def other_source(words: str, problem: Problem) -> Source:
    """Return the source that words describe, with the flux of a problem's own, in its unit.

    "sun": a beam as wide as the problem's own, or else as the first face, with the sun's divergence.
    "led:1mm": a Lambertian square with sides of 1 mm where the problem's source is; "led:1mm@30mm": 30 mm
    before the first face, on the axis of the own light.  "lamp.ies", "lamp.ldt@30mm": the luminaire of that
    file.  Another path: the source of that problem file, as it is.

    Raises UserError : other words, or an LED or luminaire in the place of parallel light without a distance,
        or at a distance from an element that the axis of the own light goes by.
    """
    own = problem.source
    same: dict[str, Any] = {"flux": problem.flux, "unit": own.unit, "wavelength": own.wavelength}
    if words.lower() == "sun":
        beam = own if source_of(problem).beam else _beam(problem, same)
        return replace(beam, divergence=SUN, divergence_profile="sun")
    if found := LED.fullmatch(words):
        size = _number(found, "size")
        angle = 90.0 if source_of(problem).beam else own.half_angle
        half_width = size / 2, size / 2
        return Source(
            kind="lambertian", half_width=half_width, half_angle=angle, **_place(found, problem), **same
        )
    if found := LUMINAIRE.fullmatch(words):
        lamp, place = Path(found["file"]).absolute(), _place(found, problem)
        if LUMINAIRE.fullmatch(own.file) and not found["distance"]:
            place = {key: getattr(own, key) for key in ("distance", "position", "shift", "tilt", "turn")}
        return Source(kind="luminaire", file=str(lamp), **place, **same)
    if not words.lower().endswith(".toml"):
        raise UserError(f"--source must be {FORMS}, got {words!r}")
    return load_problem(Path(words)).source


def _beam(problem: Problem, same: Mapping[str, Any]) -> Source:
    """Return a parallel beam along z that covers the first face that light meets, from before all of it.

    same : keys of the problem's own source that it keeps.
    """
    first = problem.faces_met[0]
    spec = getattr(first.optic, first.face)
    x, y = np.meshgrid(*(np.linspace(-h, h, ACROSS) for h in spec.half_width))
    own_points = np.array([x, y, Conic(*base_of(spec))(x, y)]).reshape(3, -1)
    covered = pose_of(first.optic).points(own_points)
    wide, tall = np.abs(covered[:2]).max(axis=1).tolist()
    return Source(
        kind="collimated",
        half_width=(wide, tall),
        distance=Source.distance + max(0.0, -float(covered[2].min())) + freedom_of(spec),
        **same,
    )


def _place(found: re.Match[str], problem: Problem) -> dict[str, Any]:
    """Return where a lamp stands, by keys: so far before the first face, or in the place of the source."""
    own, first = problem.source, problem.faces_met[0].optic
    if found["distance"]:
        distance = _number(found, "distance")
        return _before(first, distance, problem) if isinstance(first, Placed) else {"distance": distance}
    if source_of(problem).beam or own.others or own.array:
        which = "several lights" if own.others or own.array else "parallel light, which has no place"
        raise UserError(f"the lens is made for {which}: say where the light is, {found[0]}@30mm")
    position = own.position
    if any(own.shift):  # of a file
        x, y, z = position or (0.0, 0.0, -own.distance)
        position = x + own.shift[0], y + own.shift[1], z
    return {"distance": own.distance, "position": position, "tilt": own.own_tilt}


def _before(first: Optic, distance: float, problem: Problem) -> dict[str, Any]:
    """Return where a lamp looks along the axis of the own light, so far before this meets the plane of an
    element's vertex, by keys."""
    tilt, pose = problem.source.own_tilt, pose_of(first)
    along, normal = Pose.tilted(np.zeros(3), tilt).rotation[:, 2], pose.rotation[:, 2]
    if along @ normal <= EDGE_ON:
        raise UserError(
            f"the axis of the own light does not meet {first.table} from before, so that it does not "
            f"tell where {distance:g} mm are; give a problem file with the source"
        )
    aside = np.array(source_of(problem).middle) - pose.shift
    met = pose.shift + (aside - along * (aside @ normal) / (along @ normal))
    return {"position": tuple((met - distance * along).tolist()), "tilt": tilt}


def _number(found: re.Match[str], name: str) -> float:
    try:
        return float(found[name])
    except ValueError:
        raise UserError(f"--source must be {FORMS}, got {found[0]!r}") from None
