"""The source that a problem describes, as its class."""

from __future__ import annotations

from dataclasses import fields

from optics.scene.problem import Problem
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


def source_of(problem: Problem) -> LightSource:
    """Return the source of a problem: its class takes those keys of [source] that it has fields for.

    Its file or picture is read when it is first needed.
    """
    keys, made = problem.source, SOURCES[problem.source.kind]
    others = {
        "shape": keys.profile,
        "picture": keys.image,
        "divergence": Divergence(keys.divergence_profile, keys.half_divergence),
        "aperture": problem.optic.front.half_width,
    }
    values = vars(keys) | others
    return made(**{field.name: values[field.name] for field in fields(made)})
