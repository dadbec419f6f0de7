"""The source that a problem describes, as its class, and what a script brings in its place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

from optics.base.runtime import UserError
from optics.scene.problem import OneSource, Placed, Problem
from optics.scene.receivers import Receiver
from optics.scene.sources import (
    CollimatedBeam,
    Divergence,
    LambertianArea,
    LightSource,
    LuminaireSource,
    PlacedSource,
    PointSource,
    RayFileSource,
    SourceGroup,
)
from thbcad.poses import IDENTITY, Pose

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

    Raises UserError : objects of other classes.
    """

    source: LightSource | None = None
    receiver: Receiver | None = None

    def __post_init__(self) -> None:
        for name, own, wanted in (
            ("source", self.source, LightSource),
            ("receiver", self.receiver, Receiver),
        ):
            if not (own is None or isinstance(own, wanted)):
                raise UserError(
                    f"{name} must be an object of a class of {wanted.__module__.rpartition('.')[0]}."
                    f"{wanted.__name__}, got {own!r}; derive one, or leave it out"
                )

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

    Several, an array, or one beside the axis stand in their places.  A file or picture is read when it is
    first needed.
    """
    source = problem.source
    made = [(spec, _made(spec, problem)) for spec in source.each]
    if source.lone:
        return made[0][1]
    members = [
        PlacedSource(flux=own.flux, distance=own.distance, source=own, pose=pose)
        for spec, own in made
        for pose in _poses(spec)
    ]
    if len(members) == 1:
        return members[0]
    flux = sum(member.flux for member in members)
    return SourceGroup(flux=flux, distance=source.distance, members=tuple(members))


def source_frames(problem: Problem) -> list[tuple[OneSource, Pose]]:
    """Return every source, those of an array too, with the pose of its own frame in that of the scene."""
    source = problem.source
    if source.lone:
        return [(source.each[0], IDENTITY)]
    return [(spec, pose) for spec in source.each for pose in _poses(spec)]


def _poses(spec: OneSource) -> Iterator[Pose]:
    """Yield the poses of a source, or of those of an array, from its own frame to that of the scene.

    An array is tilted as a whole, also one of files, whose light turns by itself.
    """
    pose = Pose.tilted(spec.position or (0.0, 0.0, -spec.distance), spec.tilt)
    for x, y in spec.array.places if spec.array else [(0.0, 0.0)]:
        yield Pose.tilted(pose.points((x, y, 0.0)), spec.own_tilt) @ Pose.at((0.0, 0.0, spec.distance))


def _made(keys: OneSource, problem: Problem) -> LightSource:
    made = SOURCES[keys.kind]
    others = {
        "shape": keys.profile,
        "picture": keys.image,
        "divergence": Divergence(keys.divergence_profile, keys.half_divergence),
        "aperture": aperture_of(problem) if problem.source.lone else keys.half_width,
    }
    values = vars(keys) | others | {"flux": keys.weight * keys.flux}
    return made(**{field.name: values[field.name] for field in fields(made)})
