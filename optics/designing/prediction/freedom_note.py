"""What helps where a design cannot take the sag of its transport map whole, or its rear the light: more
z_freedom, a thicker lens, light that is bent less, a wider rear.  Whatever is proposed beside z_freedom alone
was tried."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from math import ceil
from typing import Any

from optics.base.runtime import Backend, UserError
from optics.designing.optimisation import first_fit, transmitted_flux
from optics.designing.starts import STEEP, TransportFit, TransportStart
from optics.light.outgoing import least_half_widths
from optics.scene.keys import assignment
from optics.scene.problem import Problem
from optics.scene.system import System, can_be_lit, nearest_geometry, solvable_system

SURELY = 0.9  # of STEEP: the map to another place, and its height, are a little different
TRIES = 4  # of maps, whose light spreads elsewhere in a lens that is thicker
CLEAR = 1.1  # times the overlap of the surfaces: a thicker lens asks for a little more sag
APART = 0.05  # of the thickness, that is left between them
MISSED = 0.005  # of the light, beside the rear
WIDER, RIM = 1.5, 1.02  # times a half-width of the rear, that is tried; times that which light needs there
PASSING = 0.98  # of the light, at least, that passed before: a thicker lens may let some pass beside its rear


def freedom_note(
    system: System, backend: Backend, start: TransportStart, fits: Sequence[TransportFit]
) -> str:
    """Return a sentence on what helps where a design does not take the fits of a start whole, or "".

    A sentence that no z_freedom answers alone names options with which one was seen to do.
    """
    if not (note := start.note(*fits)):
        return ""
    if start.steep():
        ways = [
            dict([assignment(shlex.split(option)[1], Problem)])
            for option in gentler_geometries(system, start)
        ]
    elif start.overlap(*fits) >= 0:
        ways = [{system.problem.optic.key("thickness"): _thicker(system, start, fits)}]
    else:
        return note
    return start.note(*fits, remedies=[o for way in ways if (o := _tried(system, backend, way))])


def narrow_rear_note(system: System, backend: Backend, missed: float) -> str:
    """Return a sentence on the rear of a lens alone that takes the light which a free front sends, or "".

    system : with the lens of the map.  missed : share of the light that misses surfaces behind the first.
    """
    key = system.problem.optic.key("rear") + ".half_width"
    alone = not system.problem.element and system.shaped == "front"
    if not alone or system.reflects or missed < MISSED:
        return ""
    said = f"{missed:.1%} of the light would miss the rear on its way to where the transport map sends it"
    half = [WIDER * h for h in system.base.rear.half_width]
    try:
        other = solvable_system(system.problem.with_(**{key: half}), system.own)
        least = least_half_widths(other.with_lens(other.base.with_sags(system.designed.sags)), backend)
    except (UserError, ValueError):
        return f"{said}: make {key} larger"
    needed = least[system.problem.face_names[-1]]
    if any(n > h for n, h in zip(needed, half)):
        return f"{said}: make {key} larger"
    sides = [max(h, ceil(10 * RIM * n) / 10) for n, h in zip(needed, system.base.rear.half_width)]
    return f"{said}; --set {shlex.quote(f'{key}={_text(sides)}')} takes it"


def gentler_geometries(system: System, start: TransportStart) -> list[str]:
    """Return the options of the nearest geometries in which the surface loses little light."""
    return nearest_geometry(system, lambda other: can_be_lit(other) and is_gentle(other, start))


def is_gentle(system: System, start: TransportStart) -> bool:
    """Return whether the surface of the map loses surely less than STEEP of the light in a system.

    start : of this system, or of one that has its target elsewhere.
    """
    return start.lost(system) <= SURELY * STEEP


def _thicker(system: System, start: TransportStart, fits: Sequence[TransportFit]) -> float:
    """Return the thickness, mm, in which the fits keep clear of the front."""
    thickness = system.problem.optic.thickness
    return float(f"{thickness + CLEAR * start.overlap(*fits) + APART * thickness:.3g}")


def _tried(system: System, backend: Backend, changes: dict[str, Any]) -> str:
    """Return changes, with the z_freedom and thickness that they take, as options; "" where none serves."""
    optic = system.problem.optic
    for _ in range(TRIES):
        try:
            other = solvable_system(system.problem.with_(**changes), system.own)
            start = TransportStart(other, backend)
        except UserError:
            return ""
        fits = [first_fit(other, start), start.finest_fit()]
        if start.steep() or transmitted_flux(other, backend) < PASSING * transmitted_flux(system, backend):
            return ""
        if not start.note(*fits):
            return " ".join(f"--set {shlex.quote(f'{key}={_text(value)}')}" for key, value in changes.items())
        changes = changes | {f"{optic.key(system.shaped)}.freeform.z_freedom": start.freedom(*fits)}
        if start.overlap(*fits) >= 0:
            changes[optic.key("thickness")] = _thicker(other, start, fits)
    return ""


def _text(value: Any) -> str:
    return f"[{', '.join(f'{v:g}' for v in value)}]" if isinstance(value, (list, tuple)) else f"{value:g}"
