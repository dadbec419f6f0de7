"""The source that a problem describes, as its class, and what a script brings in its place."""

from __future__ import annotations

from dataclasses import dataclass, fields

from optics.scene.problem import Placed, Problem
from optics.scene.receivers import Receiver
from optics.scene.sources import (
    CollimatedBeam,
    Divergence,
    LambertianArea,
    LightSource,
    LuminaireSource,
    PointSource,
    RayFileSource,
)

SOURCES: dict[str, type[LightSource]] = {  # by source.kind, which nothing else asks for
    "collimated": CollimatedBeam,
    "lambertian": LambertianArea,
    "point": PointSource,
    "rays": RayFileSource,
    "luminaire": LuminaireSource,
}


@dataclass(frozen=True, eq=False)
class Own:
    """Classes of a script, that no problem file names, in place of what the problem describes.

    source : a `LightSource`, of the flux that the problem says.  receiver : in the frame of the scene.
    """

    source: LightSource | None = None
    receiver: Receiver | None = None

    def __bool__(self) -> bool:
        return self.source is not None or self.receiver is not None


def aperture_of(problem: Problem) -> tuple[float, float]:
    """Return the half-widths of a rectangle around the axis beside which no parallel light is of use, mm.

    It is that of the face that light meets first, where that stands upright on the axis, else of the beam.
    """
    first = problem.faces_met[0].optic
    aside = isinstance(first, Placed) and (any(first.position[:2]) or any(first.tilt))
    return problem.source.half_width if aside else first.front.half_width


def source_of(problem: Problem) -> LightSource:
    """Return the source of a problem: its class takes those keys of [source] that it has fields for.

    Its file or picture is read when it is first needed.
    """
    keys, made = problem.source, SOURCES[problem.source.kind]
    others = {
        "shape": keys.profile,
        "picture": keys.image,
        "divergence": Divergence(keys.divergence_profile, keys.half_divergence),
        "aperture": aperture_of(problem),
    }
    values = vars(keys) | others
    return made(**{field.name: values[field.name] for field in fields(made)})
