"""What a problem says of an optical system, before anything is built."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import InitVar, dataclass, field, replace
from itertools import pairwise
from math import hypot, inf
from typing import Any, Generic, TypeVar, overload

from optics.base.runtime import UserError
from optics.scene.materials import Material
from optics.scene.paths import Medium
from optics.scene.photometry import Units, units_of
from optics.scene.problem import FaceMet, Freeform, MirrorElement, Problem, Verify
from optics.scene.system.elements import freeforms, lens_product, pose_of
from optics.scene.system.lens_material import indexing_material, media_at
from optics.scene.system.made_bodies import body_options
from thbcad.checks import EPS
from thbcad.lens import Product
from thbcad.moulds import BodyOptions
from thbcad.poses import Pose

ROUNDINGS = 256  # of the way to the target: two traces of a lens 1 km away are 70 apart
STRAIGHT = [("front", False), ("rear", False)]  # the faces of a lens alone, and whether they reflect


T = TypeVar("T")


class shared(Generic[T]):
    """A property of the prescription, computed at first use.

    Systems that differ only in the shapes of their elements share its value.
    """

    def __init__(self, compute: Callable[[Any], T]) -> None:
        self._compute, self._name, self.__doc__ = compute, compute.__name__, compute.__doc__

    @overload
    def __get__(self, system: None, owner: type) -> shared[T]: ...

    @overload
    def __get__(self, system: Prescribed, owner: type) -> T: ...

    def __get__(self, system: Prescribed | None, owner: type) -> T | shared[T]:
        if system is None:
            return self
        known = system.computed
        if self._name not in known:
            known[self._name] = self._compute(system)
        found: T = known[self._name]
        return found


@dataclass(frozen=True, eq=False)
class Prescribed:
    """The light and the designed element as a problem prescribes them.

    known : values of `shared` properties that are computed already, by name; `replace` keeps none.
    """

    problem: Problem
    known: InitVar[dict[str, Any] | None] = field(default=None, kw_only=True)
    computed: dict[str, Any] = field(init=False, repr=False)

    def __post_init__(self, known: dict[str, Any] | None) -> None:
        object.__setattr__(self, "computed", {} if known is None else known)

    @shared
    def product(self) -> Product:
        """What the CAD files say about the lens."""
        return lens_product(self.problem)

    @property
    def traced_within(self) -> Verify:
        """The limits of `verify`; on the target traces may always be apart by roundings of the way there."""
        limits, (x, y) = self.problem.verify, self.problem.target.half_width
        if self.problem.throw == inf:
            return limits
        return replace(limits, landing=max(limits.landing, ROUNDINGS * EPS * hypot(self.problem.throw, x, y)))

    @shared
    def own_faces(self) -> dict[int, FaceMet]:
        """The faces of the element that is designed, by their numbers along the path."""
        optic = self.problem.optic
        return {k: face for k, face in enumerate(self.problem.faces_met) if face.optic is optic}

    @property
    def shaped_face(self) -> FaceMet:
        """The face that a transport map shapes."""
        return next(face for face in self.own_faces.values() if face.face == self.shaped)

    def number_of(self, side: str) -> int:
        """Return the number along the path of "front" or "rear" of the element that is designed.

        Raises UserError : light does not meet it, as the back of a mirror.
        """
        for number, face in self.own_faces.items():
            if face.face == side:
                return number
        optic = self.problem.optic
        raise UserError(f"light does not meet the {optic.face_name(side)} of {optic.table}; take its front")

    @property
    def reflects(self) -> bool:
        """Whether it is a mirror that is shaped, and no lens."""
        return isinstance(self.problem.optic, MirrorElement)

    @property
    def pose(self) -> Pose:
        """From the frame of the lens, with its front vertex at 0, to that of the scene."""
        return pose_of(self.problem.optic)

    @property
    def freeforms(self) -> tuple[Freeform, ...]:
        """The settings of the free surfaces, as `sags`."""
        return freeforms(self.problem)

    @property
    def units(self) -> Units:
        """The units of flux, and of the light on a target."""
        return units_of(self.problem.source.unit)

    @property
    def shaped(self) -> str:
        """The surface that a transport map shapes, "rear" or "front": the last one that is free, or met."""
        return [*(self.problem.optic.free or [face.face for face in self.own_faces.values()])][-1]

    @property
    def slope_rms(self) -> tuple[float, ...]:
        """Of the faces that light meets, radians."""
        return tuple(getattr(face.optic, face.face).slope_rms for face in self.problem.faces_met)

    @property
    def material(self) -> Material | None:
        """The known material whose index the lens has; None where its index is another."""
        return indexing_material(self.problem, self.problem.optic)

    def media_at(self, nm: float) -> tuple[Medium, ...]:
        """Return the media of the path with indices at a wavelength, nm; they absorb as at the source's.

        Raises UserError : an index is not known there.
        """
        return media_at(self.problem, nm, self.problem.source.wavelength)

    @property
    def passing(self) -> float:
        """The flux of the source that faces, coatings and mirrors send on at normal incidence."""
        flux, media = self.problem.flux, self.media_at(self.problem.source.wavelength)
        for face, (before, behind) in zip(self.problem.faces_met, pairwise(media)):
            index = behind.index / before.index
            bare = 1.0 if face.reflects else 1 - ((index - 1) / (index + 1)) ** 2
            flux *= bare if face.share is None else face.share
        return flux

    @property
    def spectral(self) -> bool:
        """Whether light is measured at other wavelengths than that of the design."""
        return bool(self.problem.source.spectrum)

    @property
    def body(self) -> BodyOptions | None:
        """What makes the lens a body that leaves a mould; None is the lens."""
        return body_options(self.problem.optic)

    @property
    def lens_on_axis(self) -> bool:
        """Whether light goes through a lens on the axis, with its front vertex at 0."""
        return self.pose.is_identity and self.lone_lens

    @property
    def lone_lens(self) -> bool:
        """Whether there is one lens, through which light goes by its front and its rear."""
        return [(face.face, face.reflects) for face in self.problem.faces_met] == STRAIGHT
