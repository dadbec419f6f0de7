"""What to say of the greatest concentration of light: where it is, and whether it may start a fire."""

from __future__ import annotations

from optics.light.outgoing.concentration import SUNLIGHT, Concentration
from optics.scene.system import OpticalSystem

KW_PER_M2 = 1000.0  # in W/mm^2
IGNITING = 10.0  # kW/m^2, below what wood takes to burn within minutes (docs/sources.md)


def concentration_sentence(system: OpticalSystem, found: Concentration) -> str:
    """Return where light is concentrated most, and how much, in one sentence."""
    light = system.units.in_plane.text(found.irradiance)
    sun = "" if found.sunlight is None else f", {found.sunlight:.3g} kW/m^2 in the sun"
    first = "of the beam" if system.source.beam else f"on {_the(system.problem.face_names[0])}"
    return (
        f"greatest concentration of light: {found.times:.3g} times that {first}, "
        f"{light}{sun}, {_length(found.behind)} {_place(system)} vertex (mean over {found.disk:.2g} mm, "
        f"without losses; searched up to {_length(found.searched)})"
    )


def _length(mm: float) -> str:
    return f"{round(mm, 2) + 0.0:g} mm"  # no -0


def _place(system: OpticalSystem) -> str:
    """Return from where the way of light is counted."""
    last = system.problem.faces_met[-1]
    side = "before" if last.reflects or last.backwards else "behind"
    return f"{side} {_the(system.problem.face_names[-1])}"


def _the(face: str) -> str:
    """Return what a sentence calls a face: one of several elements has a name of its own."""
    return face if "." in face else f"the {face}"


def fire_warning(system: OpticalSystem, found: Concentration) -> str:
    """Return a warning where light may set fire to things, "" elsewhere."""
    own = 0.0 if system.units.luminous else found.irradiance * KW_PER_M2
    each = {"the source": own, f"sunlight of {SUNLIGHT:g} kW/m^2": found.sunlight or 0.0}
    hot = [f"{heat:.3g} kW/m^2 with {light}" for light, heat in each.items() if heat >= IGNITING]
    if not hot:
        return ""
    return (
        f"light that may start a fire: {' and '.join(hot)}, {_length(found.behind)} {_place(system)} "
        f"(wood may burn from about {IGNITING:g} kW/m^2 on); "
        "keep everything out of there, and cover the lens while nobody watches it"
    )
