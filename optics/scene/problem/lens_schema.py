"""The records of a lens in a problem file: surfaces and splines; and what a mirror has of them."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING, Any, ClassVar

from optics.scene.keys import AUTO, LONGEST, SHORTEST, Rows, option
from optics.scene.problem.body_schema import ArraySpec, BodySpec

WALLS = ("polished", "absorbing")
OUTLINES = ("rectangle", "round", "ellipse", "rounded")
RADII = (1e-3, 1e12)  # mm, in size
GREATEST_CONIC = 1e6  # in size
FINEST_AUTO = 6  # level that max_level = "auto" goes to at most


@dataclass(frozen=True, kw_only=True)
class Freeform:
    """A surface's spline, as the tables [lens.front.freeform] and [lens.rear.freeform].

    >>> Freeform(z_freedom=2.0, max_level="auto").finest  # the finest that may be chosen
    6
    """

    degree: int = option(3, low=2, high=10, note="of the splines")
    spans: tuple[int, int] = option((7, 7), low=1, high=1000, note="knot spans of level 0 in x and y")
    max_level: int | str = option(
        5, low=0, high=12, note="finest level of refinement; auto takes it from the light's detail", auto=True
    )
    z_freedom: float | str = option(
        5.0,
        low=SHORTEST,
        high=LONGEST,
        note="mm, bound of the sag coefficients; auto takes it from the light",
        auto=True,
    )

    @property
    def freedom(self) -> float:
        """z_freedom in mm; 0 where it is not known yet."""
        return 0.0 if isinstance(self.z_freedom, str) else self.z_freedom

    @property
    def finest(self) -> int:
        """The finest level; the finest that may be chosen where that is not known yet."""
        return FINEST_AUTO if isinstance(self.max_level, str) else self.max_level


def radius_option(automatic: str) -> Any:
    """Return the option of a surface's radius.  automatic : what "auto" stands for."""
    note = f"mm, of the vertex; positive opens to +z, inf is a plane; {automatic}"
    return option(inf, infinite=True, size=RADII, note=note, auto=True, example=40.0)


def conic_option(usual: float | None = None) -> Any:
    """Return the option of a conic constant.  usual : where nothing is said; None as the note says."""
    note = "conic constant K, -1 is a paraboloid, as auto is"
    left_out = "" if usual else '; left out it is 0, and auto beside radius = "auto"'
    return option(usual, size=(0, GREATEST_CONIC), note=note + left_out, auto=True, example=-1.0)


def slope_rms_option() -> Any:
    """Return the option of a surface's roughness."""
    note = (
        "radians, of errors of the slope in x and in y that blur the light: roughness, the steps of a print"
    )
    return option(0.0, low=0, high=0.3, note=note)


def reflectance_option() -> Any:
    """Return the option of a coating."""
    note = "share of the light that a coating reflects, at any angle; left out is bare glass by Fresnel's law"
    return option(None, low=0, high=1, note=note)


class Based:
    """A surface on a conic, whose constant follows from the radius where nothing is said of it."""

    radius: float | str
    conic: float | str | None

    def __post_init__(self) -> None:
        if self.conic is None:
            object.__setattr__(self, "conic", AUTO if self.radius == AUTO else 0.0)


@dataclass(frozen=True, kw_only=True)
class Front(Based):
    """The surface that light meets first, as the table [lens.front].

    >>> problem.optic.front.freeform is None, problem.optic.front.radius  # a plane, unless asked for
    (True, inf)
    """

    half_width: tuple[float, float] = option(
        low=SHORTEST, high=LONGEST, note="mm in x and y, from the axis to the rim"
    )
    radius: float | str = radius_option("auto is a plane too")
    conic: float | str = conic_option()
    slope_rms: float = slope_rms_option()
    reflectance: float | None = reflectance_option()
    freeform: Freeform | None = option(None, note="with the keys of lens.rear.freeform: a front that is free")


@dataclass(frozen=True, kw_only=True)
class Rear(Based):
    """The surface that light leaves by, as the table [lens.rear]; it is free where nothing else is said.

    >>> problem.optic.rear.freeform.degree
    3
    """

    half_width: tuple[float, float] = option(
        low=SHORTEST, high=LONGEST, note="mm in x and y, from the axis to the rim"
    )
    freeform: Freeform | None = option(
        Freeform(), note="false in place of this table is the conic alone, behind a free front"
    )
    radius: float | str = radius_option("auto takes it from the light")
    conic: float | str = conic_option()
    slope_rms: float = slope_rms_option()
    reflectance: float | None = reflectance_option()


def outline_option() -> Any:
    """Return the option of an element's outline."""
    return option(
        "rectangle", choices=OUTLINES, note="the largest such shape within each surface's half_width"
    )


def base_of(surface: Front | Rear) -> tuple[float, float]:
    """Return radius and conic constant of a surface; those of a plane where they are not known yet."""
    if isinstance(surface.radius, str):
        return inf, 0.0
    return surface.radius, -1.0 if isinstance(surface.conic, str) else surface.conic


def freedom_of(surface: Front | Rear) -> float:
    """Return how far the sag coefficients of a surface may go, mm; 0 without a sag, or not known yet."""
    return surface.freeform.freedom if surface.freeform else 0.0


class Optic:
    """A lens or a mirror, as a problem describes it: a body with two surfaces and one outline.

    A table [lens] or [[element]] has these keys, or says otherwise what they are.
    """

    if TYPE_CHECKING:

        @property
        def front(self) -> Front: ...
        @property
        def rear(self) -> Rear: ...
        @property
        def index(self) -> float | str: ...
        @property
        def indices(self) -> Rows: ...
        @property
        def material(self) -> str: ...
        @property
        def absorption(self) -> float | str: ...
        @property
        def absorptions(self) -> Rows: ...
        @property
        def thickness(self) -> float: ...
        @property
        def density(self) -> float: ...
        @property
        def outline(self) -> str: ...
        @property
        def corner_radius(self) -> float: ...
        @property
        def clear_aperture(self) -> tuple[float, float]: ...
        @property
        def wall(self) -> str: ...
        @property
        def body(self) -> BodySpec | None: ...
        @property
        def array(self) -> ArraySpec | None: ...

    @property
    def known_index(self) -> float:
        """The index; 0 where it is not known yet."""
        return 0.0 if isinstance(self.index, str) else self.index

    noun: ClassVar[str] = "lens"

    @property
    def called(self) -> str:
        """The name of an element, else its noun."""
        return self.noun

    def face_name(self, name: str) -> str:
        """Return what a sentence calls its front or its rear."""
        return name

    @property
    def table(self) -> str:
        """Its name in dotted keys."""
        return "lens"

    def key(self, name: str) -> str:
        """Return the dotted key of one of its own, such as "rear.radius"."""
        return f"{self.table}.{name}"

    @property
    def coats(self) -> tuple[float | None, float | None]:
        """The shares of the light that coatings of front and rear let through; None is bare glass."""
        front, rear = (None if s.reflectance is None else 1 - s.reflectance for s in (self.front, self.rear))
        return front, rear

    def corners(self, half_width: tuple[float, float]) -> tuple[float, float]:
        """Return the semi-axes of the corners of a surface with these half-widths, mm; 0 of a rectangle."""
        if self.outline == "rounded":
            return self._in_proportion((self.corner_radius, self.corner_radius), half_width)
        return (0.0, 0.0) if self.outline == "rectangle" else half_width

    def clear(self, half_width: tuple[float, float]) -> tuple[float, float]:
        """Return the half-widths of the clear aperture of a surface with these, mm; 0 is all."""
        return self._in_proportion(self.clear_aperture, half_width)

    def _in_proportion(
        self, size: tuple[float, float], half_width: tuple[float, float]
    ) -> tuple[float, float]:
        """Return what a size on the larger surface is on one with these half-widths, mm."""
        most = (max(pair) for pair in zip(self.front.half_width, self.rear.half_width))
        x, y = (s * h / m for s, h, m in zip(size, half_width, most))
        return x, y

    @property
    def free(self) -> dict[str, Freeform]:
        """The settings of the free surfaces by name, front first."""
        surfaces = {"front": self.front.freeform, "rear": self.rear.freeform}
        return {name: freeform for name, freeform in surfaces.items() if freeform is not None}

    @property
    def automatic(self) -> bool:
        """Whether the base lens or a bound of the sags is left to the program."""
        bounds = [freeform.z_freedom for freeform in self.free.values()]
        return AUTO in (*bounds, *(value for s in (self.front, self.rear) for value in (s.radius, s.conic)))


@dataclass(frozen=True, kw_only=True)
class LensSpec(Optic):
    """The lens before it is designed, as the table [lens].

    >>> [*problem.optic.free]
    ['rear']
    """

    index: float | str = option(
        AUTO,
        above=1,
        high=10,
        note="refractive index, relative to the air around; auto takes it from indices or the material",
        auto=True,
        example=1.49,
    )
    thickness: float = option(low=SHORTEST, high=LONGEST, note="mm between the vertices")
    material: str = option("", note='its name; one that is known has an index, such as "PMMA"')
    indices: Rows = option((), note="[[nm, index], ...] for other wavelengths; [] takes the material's")
    absorption: float | str = option(
        0.0,
        low=0,
        high=1e3,
        note="1/mm: exp(-absorption path) of the light stays; auto takes the material's",
        auto=True,
    )
    absorptions: Rows = option(
        (), note="[[nm, 1/mm], ...] for other wavelengths; [] is absorption everywhere"
    )
    density: float = option(0.0, low=0, high=100, note="g/cm^3, for the mass; 0 is unknown")
    outline: str = outline_option()
    corner_radius: float = option(
        0.0,
        low=0,
        high=LONGEST,
        note='mm, of outline = "rounded"; that of the smaller surface is in proportion',
        only={"outline": ("rounded",)},
    )
    clear_aperture: tuple[float, float] = option(
        (0.0, 0.0),
        low=0,
        high=LONGEST,
        note="mm, half-widths of what an opaque holder leaves free of the larger surface, shaped like the "
        "outline, and of the smaller in proportion; 0 is no holder",
    )
    wall: str = option(
        "polished", choices=WALLS, note="what light does at the edges: Fresnel's law, or it ends there"
    )
    body: BodySpec | None = option(None, note="the body for a mould, which STEP files hold")
    array: ArraySpec | None = option(None, note="like lenses on one plate, each with its own source")
    front: Front = option()
    rear: Rear = option()
