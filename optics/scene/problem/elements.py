"""Elements: lenses and mirrors that lie anywhere in a scene, as tables [[element]] of a problem file."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, ClassVar

from optics.scene.keys import FARTHEST, LONGEST, SHORTEST, Rows, option
from optics.scene.problem.lens_schema import (
    ArraySpec,
    BodySpec,
    Freeform,
    Front,
    LensSpec,
    Optic,
    Rear,
    conic_option,
    outline_option,
    radius_option,
    slope_rms_option,
)

METALS = {"aluminium": 0.88}  # reflectance of clean metal in visible light, at any angle


@dataclass(frozen=True, kw_only=True)
class Placed:
    """What every table [[element]] says: its kind, its name, and where it lies.

    kinds : the record of each kind of table.

    >>> Placed(kind="mirror", name="M1", position=(0, 0, 5)).key("tilt")
    'element.M1.tilt'
    """

    kind: str = option(choices=("lens", "mirror"), note="of the element")
    name: str = option(note="each has its own; --set element.NAME.position=[0, 0, 5] changes a key of it")
    position: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0), size=(0, FARTHEST), note="mm, of the vertex of a lens's front, or of a mirror's face"
    )
    tilt: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0), size=(0, 360), note="right-handed degrees about own x, then own y, then own z"
    )

    kinds: ClassVar[dict[str, type[Placed]]] = {}

    @property
    def table(self) -> str:
        """Its name in dotted keys."""
        return f"element.{self.name}"

    @property
    def called(self) -> str:
        return self.name

    def with_keys(self, **changes: Any) -> Placed:
        """Return it with other values of some keys."""
        return replace(self, **changes)


@dataclass(frozen=True, kw_only=True)
class LensElement(Placed, LensSpec):
    """A lens anywhere, with the keys of the table [lens].

    >>> LensElement(kind="lens", name="L1", thickness=5.0, index=1.5, front=front, rear=rear).key("index")
    'element.L1.index'
    """


@dataclass(frozen=True, kw_only=True)
class Face:
    """The surface of a mirror that reflects, as the table [element.face]; free where nothing else is said.

    >>> Face(half_width=(50, 70)).freeform.degree
    3
    """

    half_width: tuple[float, float] = option(
        low=SHORTEST, high=LONGEST, note="mm in own x and y, from the vertex to the rim"
    )
    freeform: Freeform | None = option(Freeform(), note="false in place of this table is the conic alone")
    radius: float | str = radius_option("auto takes it from the light")
    conic: float | str = conic_option(-1.0)
    slope_rms: float = slope_rms_option()


@dataclass(frozen=True, kw_only=True)
class MirrorElement(Placed, Optic):
    """A mirror: light comes from its own -z, its blank lies at +z, with a plane back.

    It is asked as a lens is, whose front reflects.

    >>> MirrorElement(kind="mirror", name="M1", thickness=8.0, face=Face(half_width=(50, 70))).rear.radius
    inf
    """

    thickness: float = option(low=SHORTEST, high=LONGEST, note="mm, of the blank, from the face's vertex")
    reflectance: float | str = option(
        0.9, choices=(*METALS,), low=0, high=1, note="the same at every angle; aluminium has 0.88"
    )
    material: str = option("", note="name of what the blank is made of")
    density: float = option(0.0, low=0, high=100, note="g/cm^3, for the mass; 0 is unknown")
    outline: str = outline_option()
    corner_radius: float = option(
        0.0, low=0, high=LONGEST, note='mm, of outline = "rounded"', only={"outline": ("rounded",)}
    )
    clear_aperture: tuple[float, float] = option(
        (0.0, 0.0),
        low=0,
        high=LONGEST,
        note="mm, half-widths of what an opaque holder leaves free, shaped like the outline; 0 is no holder",
    )
    face: Face = option()

    noun: ClassVar[str] = "mirror"
    # what a lens may have and a mirror has not
    index: ClassVar[float] = 1.0
    indices: ClassVar[Rows] = ()
    absorption: ClassVar[float] = 0.0
    absorptions: ClassVar[Rows] = ()
    wall: ClassVar[str] = "absorbing"
    body: ClassVar[BodySpec | None] = None
    array: ClassVar[ArraySpec | None] = None

    @cached_property
    def front(self) -> Front:
        """The face, as the front of the blank."""
        return Front(**vars(self.face))

    @cached_property
    def rear(self) -> Rear:
        """The back of the blank, a plane."""
        return Rear(half_width=self.face.half_width, freeform=None)

    @property
    def share(self) -> float:
        """Of the light that it reflects."""
        return METALS[self.reflectance] if isinstance(self.reflectance, str) else self.reflectance

    def face_name(self, name: str) -> str:
        return "face" if name == "front" else "back"

    def key(self, name: str) -> str:
        """Return the dotted key of one of its own; "front" stands for its face."""
        return super().key("face" + name.removeprefix("front") if name.startswith("front") else name)

    def with_keys(self, **changes: Any) -> MirrorElement:
        """See `Placed`; the front is the face, and the back stays a plane."""
        if "front" in changes:
            front = changes.pop("front")
            changes["face"] = Face(**{f.name: getattr(front, f.name) for f in fields(Face)})
        changes.pop("rear", None)
        return replace(self, **changes)


Placed.kinds |= {"lens": LensElement, "mirror": MirrorElement}
