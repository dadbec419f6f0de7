"""The records of a problem file that describe the scene: every key with its default, limits and a note."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isinf
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from optics.scene.photometry import ILLUMINANTS
from optics.scene.problem.toml_records import AUTO, option

PROFILES = ("uniform", "round", "gaussian", "round_gaussian", "image")
DIVERGENCES = ("uniform", "gaussian", "sun", "theta_uniform")
FLUX_UNITS = ("W", "lm")
SHAPES = ("rectangle", "ellipse", "ring")  # of stops
WALLS = ("polished", "absorbing")
OUTLINES = ("rectangle", "round", "ellipse", "rounded")
LEAST_FLUX = 1e-12  # of source.unit
SUN = 0.2665  # degrees: the mean half-angle of its disk

Rows = tuple[tuple[float, float], ...]

MAX_PIXELS = 4096
SHORTEST = 1e-6  # mm: a nanometre, less than CAD kernels tell apart
LONGEST = 1e6  # mm: a kilometre
FARTHEST = 1e9  # mm, of the planes before and behind the lens
RADII = (1e-3, 1e12)  # mm, in size
GREATEST_CONIC = 1e6  # in size
FINEST_AUTO = 6  # level that max_level = "auto" goes to at most


class SourceKeys(NamedTuple):
    """Which keys a kind of source has: a half_width above 0 (area), values of profile, a divergence, those of
    light of a file (file), 0 as flux for that of the file (own_flux); and its least distance, mm (nearest).
    """

    area: bool = False
    profiles: tuple[str, ...] = ("uniform",)
    diverges: bool = False
    file: bool = False
    own_flux: bool = False
    nearest: float = 0.0


SOURCES = {
    "collimated": SourceKeys(area=True, profiles=PROFILES, diverges=True),
    "lambertian": SourceKeys(area=True, profiles=PROFILES),
    "point": SourceKeys(nearest=SHORTEST),
    "rays": SourceKeys(file=True),
    "luminaire": SourceKeys(profiles=("uniform", "round"), file=True, own_flux=True),
}


@dataclass(frozen=True, kw_only=True)
class Source:
    """The light that comes in, as the table [source] of a problem file.

    Examples
    --------
    >>> Source(kind="collimated", half_width=(9.5, 9.5), divergence_profile="sun").half_divergence  # degrees
    0.2665
    """

    kind: str = option(
        choices=tuple(SOURCES),
        note="parallel rays along +z, a Lambertian emitter, a point, rays or a luminaire of a file",
    )
    half_width: tuple[float, float] = option(
        (0.0, 0.0), low=0, high=LONGEST, note="mm; a point has none, 0 is that of a luminaire's file"
    )
    distance: float = option(2.0, low=0, high=FARTHEST, note="mm from the source plane to the front vertex")
    flux: float = option(
        1.0, low=LEAST_FLUX, high=1e12, zero=True, note="of the whole source; 0 is that of a luminaire's file"
    )
    unit: str = option("W", choices=FLUX_UNITS, note="of flux: lumens make lx and cd of all that is reported")
    profile: str = option(
        "uniform", choices=PROFILES, note="over the area; the round ones fill the inscribed ellipse"
    )
    sigma: tuple[float, float] = option(
        (0.5, 0.5), above=0, high=1e6, note="of the gaussian profiles, relative to half_width"
    )
    image: str = option(
        "", note="picture file of the profile image, linear light, relative to the problem file", picture=True
    )
    file: str = option(
        "",
        note="rays (TM-25, Zemax .dat, LightTools .ray) or luminaire (IES, EULUMDAT), relative to the "
        "problem file",
        picture=True,
    )
    shift: tuple[float, float] = option(
        (0.0, 0.0), size=(0, LONGEST), note="mm in x and y, of a file's origin; distance is that along -z"
    )
    tilt: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0),
        size=(0, 360),
        note="right-handed degrees about own x, then own y, then own z, of a file's light around its origin",
    )
    turn: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0),
        size=(0, 360),
        note="the same about axes that stay: x, then y, then z; tilt or turn, not both",
    )
    half_angle: float = option(
        90.0, low=1e-3, high=90, note="degrees, of the cone that a lambertian or a point source lights"
    )
    exponent: float = option(0.0, low=0, high=1000, note="a point's intensity goes with cos(angle)^exponent")
    divergence: float = option(
        0.0,
        low=0,
        high=60,
        note="degrees, of collimated light: the half-angle, or sigma; 0 is parallel, but 0.2665 for the sun",
    )
    divergence_profile: str = option(
        "uniform",
        choices=DIVERGENCES,
        note="over solid angle, of angles, of the sun's disk, or over the angle (theta_uniform)",
    )
    wavelength: float = option(
        550.0,
        low=1,
        high=1e6,
        note="nm, that the lens is designed at; limits.feature compares the lens's features with it",
    )
    spectrum: str | Rows = option(
        (),
        choices=ILLUMINANTS,
        note="light to measure with: [[nm, radiant weight], ...] or a CIE illuminant; [] is wavelength alone",
    )

    @property
    def data(self) -> str:
        """The key of the file that the source is read from, where it names one."""
        return "file" if self.file else "image"

    @property
    def half_divergence(self) -> float:
        """The half-angle of a collimated source's light, degrees; 0 where it is parallel."""
        return self.divergence or (SUN if self.divergence_profile == "sun" else 0.0)


@dataclass(frozen=True, kw_only=True)
class Freeform:
    """A surface's spline, as the tables [lens.front.freeform] and [lens.rear.freeform].

    Examples
    --------
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
    return option(inf, infinite=True, size=RADII, note=note, auto=True)


def conic_option(usual: float = 0.0) -> Any:
    """Return the option of a surface's conic constant.  usual : where nothing is said."""
    note = "conic constant K, -1 is a paraboloid, as auto is"
    return option(usual, size=(0, GREATEST_CONIC), note=note, auto=True)


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


@dataclass(frozen=True, kw_only=True)
class Front:
    """The surface that light meets first, as the table [lens.front].

    Examples
    --------
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
class Rear:
    """The surface that light leaves by, as the table [lens.rear]; it is free where nothing else is said.

    Examples
    --------
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


@dataclass(frozen=True, kw_only=True)
class BodySpec:
    """The body that leaves a mould, as the table [lens.body], which STEP files hold.

    Examples
    --------
    >>> BodySpec(draft=2.0, annulus=True).parting
    'auto'
    """

    draft: float = option(0.0, low=0, high=45, note="degrees by which the walls taper from the parting line")
    parting: float | str = option(
        AUTO,
        low=-LONGEST,
        high=LONGEST,
        note="mm, z of the parting line; auto is that of the land, else midway between the rims",
        auto=True,
    )
    annulus: bool = option(
        False, note="a flat land from the smaller surface's rim to the outline of the larger"
    )
    land: float | str = option(
        AUTO,
        low=-LONGEST,
        high=LONGEST,
        note="mm, z of that land; auto is the rim's, 0.1 mm outside where that is not level",
        auto=True,
    )
    edge_radius: float = option(
        0.0, low=0, high=LONGEST, note="mm, between the wall and the surfaces; outside of clear_aperture"
    )


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
    def known_index(self) -> float:
        """The index; 0 where it is not known yet."""
        return 0.0 if isinstance(self.index, str) else self.index

    noun: ClassVar[str] = "lens"

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

    Examples
    --------
    >>> [*problem.optic.free]
    ['rear']
    """

    index: float | str = option(
        AUTO,
        above=1,
        high=10,
        note="refractive index, relative to the air around; auto takes it from indices or the material",
        auto=True,
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
    )
    clear_aperture: tuple[float, float] = option(
        (0.0, 0.0),
        low=0,
        high=LONGEST,
        note="mm, half-widths of what a holder leaves free of the larger surface, shaped like the outline, "
        "and of the smaller in proportion; 0 is all",
    )
    wall: str = option(
        "polished", choices=WALLS, note="what light does at the edges: Fresnel's law, or it ends there"
    )
    body: BodySpec | None = option(None, note="the body for a mould, which STEP files hold")
    front: Front = option()
    rear: Rear = option()


@dataclass(frozen=True, kw_only=True)
class StopSpec:
    """An absorbing plate without thickness, as a table [[stop]].

    Examples
    --------
    >>> StopSpec(shape="ellipse", half_width=(8, 8), position=(0, 0, -5)).hole  # a plate with a hole in it
    True
    """

    name: str = option("", note="another of each; --set stop.NAME.position=[0, 0, -5] changes a key of it")
    shape: str = option(choices=SHAPES, note="of the hole, or of the obstacle")
    half_width: tuple[float, float] = option(low=SHORTEST, high=LONGEST, note="mm in own x and y")
    inner: tuple[float, float] = option(
        (0.0, 0.0), low=0, high=LONGEST, note="mm, of a ring: the half-widths where it begins"
    )
    position: tuple[float, float, float] = option(size=(0, FARTHEST), note="mm, of its middle")
    tilt: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0), size=(0, 360), note="right-handed degrees about own x, then own y, then own z"
    )
    hole: bool = option(
        True, note="the shape is a hole in a plate without end; false: an obstacle of this shape"
    )


@dataclass(frozen=True, kw_only=True)
class Target:
    """The light that is asked for, as the table [target].

    Examples
    --------
    >>> Target(kind="image", image="pearl.png", distance=300, half_width=(100, 100)).placing
    'crop'
    """

    kind: str = option(
        choices=("image", "tophat", "function"), note="a picture, a region of uniform light, or a formula"
    )
    image: str = option("", note="picture file, relative to the problem file; of kind image", picture=True)
    formula: str = option("", note="light at x, y from -1 to 1 over the target, y upward; of kind function")
    shape: str = option(
        "rectangle", choices=("rectangle", "ellipse", "crescent"), note="of the region of kind tophat"
    )
    lit: tuple[float, float] = option(
        (0.75, 0.75), above=0, high=1, note="width and height of that region, relative to the target's"
    )
    distance: float | None = option(
        None,
        low=SHORTEST,
        high=FARTHEST,
        infinite=True,
        note="mm from the rear vertex to the middle of the target, on the axis; inf is the far field",
    )
    position: tuple[float, float, float] | None = option(
        None, size=(0, FARTHEST), note="mm, of the target's middle, in place of distance"
    )
    tilt: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0), size=(0, 360), note="right-handed degrees about own x, then own y, then own z"
    )
    surface: str = option(
        "plane",
        choices=("plane", "cylinder", "sphere", "far_field"),
        note="what is lit, from its own -z; the axis of a cylinder is its own y",
    )
    radius: float = option(
        inf,
        size=(SHORTEST, FARTHEST),
        infinite=True,
        note="mm, of a cylinder or a sphere; above 0 it bulges to the light",
    )
    half_width: tuple[float, float] = option(
        low=SHORTEST,
        high=FARTHEST,
        note="mm in own x and y, from the middle to the border, along the surface; degrees in the far field",
    )
    encoding: str = option("srgb", choices=("srgb", "linear"), note="of the picture's numbers")
    pixels: tuple[int, int] = option((256, 256), low=2, high=MAX_PIXELS, note="columns, rows")
    fit: str = option("crop", choices=("crop", "pad", "stretch"), note="for pictures of another shape")
    seen_from: str = option(
        "behind",
        choices=("behind", "lens"),
        note="where the picture reads right: behind the target looking at the lens, or from the lens's side",
    )
    crossing: bool = option(False, note="light crosses on its way, so that the lens is about twice as curved")

    data: ClassVar[str] = "image"  # the key of the file that the target is read from, where it names one

    @property
    def placing(self) -> str:
        """How the light is laid on the pixels: `fit` for pictures.

        Regions and formulas are made on the pixels themselves.
        """
        return self.fit if self.kind == "image" else "stretch"

    @property
    def far_field(self) -> bool:
        """Whether light is asked for by direction."""
        return self.surface == "far_field" or self.distance == inf

    @property
    def curved(self) -> bool:
        """Whether light is asked for on a curved surface."""
        return self.surface in ("cylinder", "sphere")

    @property
    def gentler(self) -> str:
        """What lets light be bent less, in words."""
        farther = (
            "target.distance larger" if self.position is None else "move target.position nearer the axis"
        )
        return f"make target.half_width smaller or {farther}"

    @property
    def place(self) -> str:
        """What is lit, and where it lies, in words."""
        parts = []
        if not isinf(self.radius):
            parts.append(f"on a {self.surface} of radius {self.radius:g} mm")
        if self.far_field:
            parts.append("in the far field")
        elif self.position is None:
            parts.append(f"{self.distance:g} mm behind the lens")
        else:
            parts.append("at ({:g}, {:g}, {:g}) mm".format(*self.position))
        if any(self.tilt):
            parts.append("tilted by ({:g}, {:g}, {:g}) degrees".format(*self.tilt))
        return ", ".join(parts)
