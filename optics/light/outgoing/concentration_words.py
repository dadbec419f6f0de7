"""What to say of the greatest concentration of light: where it is, and whether it may start a fire."""

from __future__ import annotations

from optics.light.outgoing.concentration import SUNLIGHT, Concentration
from optics.light.outgoing.straight_light import faces_into_air
from optics.scene.system import System

PLACES = 2  # of lengths in mm that are said
KW_PER_M2 = 1000.0  # in W/mm^2
IGNITING = 10.0  # kW/m^2, below what wood takes to burn within minutes (docs/sources.md)


def concentration_sentence(system: System, found: Concentration) -> str:
    """Return where light is concentrated most, and how much, in one sentence."""
    light = system.units.in_plane.text(found.irradiance)
    sun = "" if found.sunlight is None else f", {found.sunlight:.3g} kW/m^2 in the sun"
    first = "of the beam" if system.source.beam else f"on {_the(system.problem.face_names[0])}"
    start, *more = faces_into_air(system.problem)
    end = _length(found.searched)
    if more:
        end = f"{_away(system, more[-1], found.searched)}, from {_the(system.problem.face_names[start])} on"
    return (
        f"greatest concentration of light: {found.times:.3g} times that {first}, "
        f"{light}{sun}, {_away(system, found.face, found.behind)} vertex (mean over {found.disk:.2g} mm, "
        f"without losses; searched up to {end})"
    )


def _length(mm: float) -> str:
    return f"{round(mm, PLACES) + 0.0:g} mm"  # no -0


def _away(system: System, face: int, mm: float) -> str:
    """Return how far a place lies before or behind the vertex of a face.

    face : the number of that which light left.  mm : along its way from there; it may be reflected before the
        plane of the vertex, by a turned or deep mirror.
    """
    left = system.problem.faces_met[face]
    before = (left.reflects or left.backwards) != (round(mm, PLACES) < 0)
    return f"{_length(abs(mm))} {'before' if before else 'behind'} {_the(system.problem.face_names[face])}"


def _the(face: str) -> str:
    """Return what a sentence calls a face: one of several elements has a name of its own."""
    return face if "." in face else f"the {face}"


def fire_warning(system: System, found: Concentration) -> str:
    """Return a warning where light may set fire to things, "" elsewhere."""
    own = 0.0 if system.units.luminous else found.irradiance * KW_PER_M2
    each = {"the source": own, f"sunlight of {SUNLIGHT:g} kW/m^2": found.sunlight or 0.0}
    hot = [f"{heat:.3g} kW/m^2 with {light}" for light, heat in each.items() if heat >= IGNITING]
    if not hot:
        return ""
    return (
        f"light that may start a fire: {' and '.join(hot)}, {_away(system, found.face, found.behind)} "
        f"(wood may burn from about {IGNITING:g} kW/m^2 on); "
        "keep everything out of there, and cover the lens while nobody watches it"
    )
