"""What light meets on its way from a source: surfaces, the media between them, and a receiver."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import degrees, inf
from typing import Any, Literal, Protocol, TypeAlias

import numpy as np

from optics.scene.paths.bodies import Body
from optics.scene.paths.stops import Stop
from optics.scene.receivers import Receiver
from optics.scene.sources import BEFORE
from thbcad.checks import Floats
from thbcad.lens import FreeformSurface, Lens
from thbcad.outlines import Outline
from thbcad.poses import IDENTITY, Pose
from thbcad.surfaces import THBSurface

SlopeErrors: TypeAlias = "Sequence[Floats | None]"  # one of each surface, as of `Surface.slope_error`


@dataclass(frozen=True)
class Medium:
    """What light travels through.

    index : of refraction.  absorption : a, 1/mm: exp(-a t) of the light is left after the path t.
    """

    index: float
    absorption: float = 0.0


AIR = Medium(1.0)
Coats: TypeAlias = "tuple[float | None, float | None]"  # shares that go through front and rear
BARE: Coats = (None, None)
LEAST_COSINE = 0.05  # of light on a receiver that it hardly grazes: about 87 degrees


class HeightError(Protocol):
    """What is added to the height z of a surface, mm, in the frame of the surface's own x and y."""

    def jet(self, x: Floats, y: Floats, /) -> Floats:
        """Return dh and its derivatives by x and by y, (3, n): mm, 1, 1."""
        ...


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface that light meets, going to +z of the surface's own frame.

    pose : from its own frame to that of the path.
    kind : it refracts light into the next medium, or reflects it.
    share : of the light that goes on, at any angle and in any polarisation: a coating, or a metal.  None is
        smooth bare glass, by Fresnel's equations.
    beyond : what lies behind a surface that reflects as bare glass.
    slope_error : added to (dz/dx, dz/dy), by which light goes on; the surface stays where it is.  (2, 1) for
        all rays alike, or (2, n).
    height_error : by which its points move too; traces carry no derivatives then.
    clear : what a holder leaves free of it, which blocks light beside; None is all.
    name : of its element and face in a scene, such as "M1.face".
    """

    shape: FreeformSurface
    pose: Pose = IDENTITY
    kind: Literal["refract", "reflect"] = "refract"
    share: float | None = None
    beyond: Medium = AIR
    slope_error: Floats | None = None
    height_error: HeightError | None = None
    clear: Outline | None = None
    name: str = ""

    @property
    def open(self) -> Outline:
        """What light goes through: its outline, or what a holder leaves free of it."""
        return self.clear or self.shape.outline

    @property
    def is_flat(self) -> bool:
        """Whether it is a plane across its z without errors."""
        return self.shape.is_plane and self.slope_error is None and self.height_error is None


@dataclass(frozen=True, eq=False)
class LightPath:
    """Surfaces in the order in which light meets them, and where it is received.

    A path is a value: what perturbs it, or leaves something out, is a map from a path to another one.  A map
    that changes nothing returns the path itself.

    surfaces : of any number.  media : before, between and behind them, one more.
    receiver : its pose, as those of the surfaces, is in the frame in which rays are given.
    share : of the source's flux that takes this path.
    soft_rim : fraction of the half-width.  Within it the flux of rays in any direction fades towards the rim
        of a surface that carries a sag, or lies behind one, so that light over the rim is lost smoothly.
    stops : plates that block light on its way through air.
    absorbing_wall : light that meets the edges of the lens ends there; else they are polished.
    bodies : what light meets where it means to go elsewhere; traces leave them out that carry derivatives.
    emitted : z from which parallel light along z comes, mm: no body before it takes any.

    Raises ValueError : another number of media, a last one that absorbs, a share that is none, a surface that
        reflects into another medium.
    """

    surfaces: tuple[Surface, ...]
    media: tuple[Medium, ...]
    receiver: Receiver
    share: float = 1.0
    soft_rim: float = 0.0
    stops: tuple[Stop, ...] = ()
    absorbing_wall: bool = False
    bodies: tuple[Body, ...] = ()
    emitted: float = -inf

    def __post_init__(self) -> None:
        if len(self.media) != len(self.surfaces) + 1:
            raise ValueError(
                f"{len(self.surfaces)} surfaces lie between {len(self.surfaces) + 1} media,"
                f" got {len(self.media)}"
            )
        if self.media[-1].absorption:
            raise ValueError("the medium before the receiver must be clear: what it absorbs is not traced")
        shares = self.share, *(s.share for s in self.surfaces if s.share is not None)
        if not all(0 <= share <= 1 for share in shares):
            raise ValueError(f"a share of light lies from 0 to 1, got {shares}")
        for k, surface in enumerate(self.surfaces):
            before, behind = self.media[k : k + 2]
            if surface.kind == "reflect" and before != behind:
                raise ValueError(f"surface {k} reflects light, but from {before} into {behind}")

    @classmethod
    def through(cls, lens: Lens, receiver: Receiver, absorption: float) -> LightPath:
        """Return the path through front and rear of a lens in air, in the frame of its front vertex.

        absorption : of its glass, 1/mm.
        """
        rear = Surface(lens.rear, Pose.at((0.0, 0.0, lens.thickness)))
        return cls((Surface(lens.front), rear), (AIR, Medium(lens.index, absorption), AIR), receiver)

    @property
    def sags(self) -> list[THBSurface]:
        """Those that the surfaces carry."""
        return [s.shape.sag for s in self.surfaces if s.shape.sag is not None]

    @property
    def before(self) -> float:
        """z from which parallel light along z starts: well before the first surface, mm."""
        if not self.surfaces:
            return 0.0
        first, second = self.surfaces[0], self.surfaces[:2][-1]
        apart = float(np.linalg.norm(second.pose.shift - first.pose.shift))
        return float(first.pose.shift[2]) - BEFORE * (max(first.shape.half_width) + apart)

    @property
    def shaped(self) -> int:
        """The number of the last surface that carries a sag; of the last one where none does."""
        sags = [k for k, surface in enumerate(self.surfaces) if surface.shape.sag is not None]
        return sags[-1] if sags else len(self.surfaces) - 1

    @property
    def throw(self) -> float:
        """From the shaped surface on to the middle of the receiver, mm; inf to the far field."""
        return self.throw_of(self.shaped)

    def throw_of(self, surface: int) -> float:
        """Return how far it is from the vertex of a surface on to the middle of the receiver, mm."""
        if self.receiver.far_field:
            return inf
        vertices = [s.pose.shift for s in self.surfaces[surface:]]
        ways = [b - a for a, b in pairwise(vertices)]
        ways.append(np.array(self.receiver.toward(vertices[-1], 0.0, 0.0)))
        return float(sum(np.linalg.norm(way) for way in ways))

    @property
    def lever(self) -> float:
        """How far light that is turned by a radian moves on the middle of the receiver, mm or degrees.

        It is the throw over the cosine of the angle of incidence.
        """
        if self.receiver.far_field:
            return degrees(1.0)
        cosine = np.dot(self.leaving.rotation[:, 2], self.receiver.normal(0.0, 0.0))
        return self.throw / max(abs(float(cosine)), LEAST_COSINE)

    @property
    def leaving(self) -> Pose:
        """The frame at the vertex of the last surface from which +z goes to the middle of the receiver."""
        vertex = self.surfaces[-1].pose.shift
        return Pose.facing(vertex, self.receiver.toward(vertex, 0.0, 0.0))

    def onto(self, receiver: Receiver) -> LightPath:
        """Return the path to another receiver."""
        return self if receiver is self.receiver else replace(self, receiver=receiver)

    def in_media(self, media: Iterable[Medium]) -> LightPath:
        """Return the path through other media, as those of each wavelength; itself, if they are its own."""
        new = tuple(media)
        return self if new == self.media else replace(self, media=new)

    def without_absorption(self) -> LightPath:
        """Return the path through clear media."""
        return self.in_media(replace(medium, absorption=0.0) for medium in self.media)

    def without_reflection(self) -> LightPath:
        """Return the path over ideally coated surfaces: all light goes on that is not reflected totally."""
        return self._with(replace(s, share=1.0) if s.share != 1 else s for s in self.surfaces)

    def without_coats(self) -> LightPath:
        """Return the path through bare glass, and by mirrors that reflect all."""
        pairs = ((s, 1.0 if s.kind == "reflect" else None) for s in self.surfaces)
        return self._with(s if s.share == share else replace(s, share=share) for s, share in pairs)

    def without_stops(self) -> LightPath:
        """Return the path that nothing blocks: neither stops, nor bodies, nor a holder of the lens."""
        path = self._with(replace(s, clear=None) if s.clear else s for s in self.surfaces)
        return replace(path, stops=(), bodies=()) if path.stops or path.bodies else path

    def past(self, surfaces: Collection[int]) -> LightPath:
        """Return the path of light that misses some surfaces; their bodies stay in its way.

        surfaces : the numbers of all surfaces of one or several elements.
        """
        kept = [k for k in range(len(self.surfaces)) if k not in surfaces]
        if len(kept) == len(self.surfaces):
            return self
        number = {k: new for new, k in enumerate([*kept, len(self.surfaces)])}
        bodies = tuple(
            replace(
                body,
                faces={number[k]: face for k, face in body.faces.items() if k in number},
                beside={number[k]: pose for k, pose in body.beside.items() if k in number},
            )
            for body in self.bodies
        )
        media = self.media[0], *(self.media[k + 1] for k in kept)
        return replace(self, surfaces=tuple(self.surfaces[k] for k in kept), media=media, bodies=bodies)

    def held(self, clear: Mapping[int, Outline]) -> LightPath:
        """Return the path through surfaces of which a holder leaves at most these outlines free."""
        pairs = enumerate(self.surfaces)
        return self._with(s if s.clear or k not in clear else replace(s, clear=clear[k]) for k, s in pairs)

    def named(self, names: Iterable[str]) -> LightPath:
        """Return the path over surfaces with these names."""
        return self._with(
            s if s.name == name else replace(s, name=name) for s, name in zip(self.surfaces, names)
        )

    def with_stops_moved(self, motion: Pose) -> LightPath:
        """Return the path with its stops elsewhere.  motion : in the frame of the path."""
        return replace(self, stops=tuple(s.moved(motion) for s in self.stops)) if self.stops else self

    def with_slope_errors(self, errors: SlopeErrors) -> LightPath:
        """Return the path over surfaces whose slopes err.  errors : one of each surface."""
        return self._with_errors("slope_error", errors)

    def with_height_errors(self, errors: Sequence[HeightError | None]) -> LightPath:
        """Return the path over surfaces whose heights err, mm.  errors : one of each surface."""
        return self._with_errors("height_error", errors)

    def moved(self, motions: Sequence[Pose]) -> LightPath:
        """Return the path whose surfaces, and at last its receiver, are moved, with their bodies.

        motions : one of each, in the frame of the path.
        """
        pairs = zip(self.surfaces, motions)
        path = self._with(s if m.is_identity else replace(s, pose=m @ s.pose) for s, m in pairs)
        path = path.onto(self.receiver.moved(motions[-1]))
        bodies = tuple(body.with_faces_moved(motions) for body in self.bodies)
        same = all(a is b for a, b in zip(bodies, self.bodies))
        return path if same else replace(path, bodies=bodies)

    def with_shape(self, surface: int, shape: FreeformSurface) -> LightPath:
        """Return the path over surfaces of which one has another shape."""
        return self._with(replace(s, shape=shape) if k == surface else s for k, s in enumerate(self.surfaces))

    def seen_from(self, pose: Pose) -> LightPath:
        """Return the path in the frame of a body with this pose."""
        if pose.is_identity:
            return self
        back = pose.inverse()
        surfaces = (replace(s, pose=back @ s.pose) for s in self.surfaces)
        path = replace(self, surfaces=tuple(surfaces), receiver=self.receiver.seen_from(pose))
        return replace(path.with_stops_moved(back), bodies=tuple(body.moved(back) for body in self.bodies))

    def with_soft_rims(self, share: float) -> LightPath:
        """Return the path over rims within which light fades."""
        return self if share == self.soft_rim else replace(self, soft_rim=share)

    def _with_errors(self, name: str, errors: Sequence[Any]) -> LightPath:
        if len(errors) != len(self.surfaces):
            raise ValueError(
                f"there is one {name} for each surface, got {len(errors)} for {len(self.surfaces)}"
            )
        pairs = zip(self.surfaces, errors)
        return self._with(s if e is getattr(s, name) else replace(s, **{name: e}) for s, e in pairs)

    def _with(self, surfaces: Iterable[Surface]) -> LightPath:
        """Return the path over other surfaces; itself, if they are its own."""
        new = tuple(surfaces)
        return self if all(a is b for a, b in zip(new, self.surfaces)) else replace(self, surfaces=new)
