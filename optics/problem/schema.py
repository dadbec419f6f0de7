"""The records of a problem file: every key with its default, its limits and a note."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from optics.problem.toml_records import AUTO, option

PROFILES = ("uniform", "round", "gaussian", "image")
Number = TypeVar("Number", int, float)

MAX_PIXELS = 4096
SHORTEST = 1e-6  # mm: a nanometre, less than CAD kernels tell apart
LONGEST = 1e6  # mm: a kilometre
FARTHEST = 1e9  # mm, of the planes before and behind the lens
RADII = (1e-3, 1e12)  # mm, in size
GREATEST_CONIC = 1e6  # in size
GREATEST_WEIGHT = 1e12
FINEST_AUTO = 6  # level that max_level = "auto" goes to at most


@dataclass(frozen=True, kw_only=True)
class Source:
    kind: str = option(
        choices=("collimated", "lambertian", "point"),
        note="parallel rays along +z, a glowing area, or a point",
    )
    half_width: tuple[float, float] = option((0.0, 0.0), low=0, high=LONGEST, note="mm; a point has none")
    distance: float = option(2.0, low=0, high=FARTHEST, note="mm from the source plane to the front vertex")
    flux: float = option(1.0, low=1e-12, high=1e12, note="W")
    profile: str = option(
        "uniform", choices=PROFILES, note="over the area; round fills the inscribed ellipse"
    )
    sigma: tuple[float, float] = option(
        (0.5, 0.5), above=0, high=1e6, note="of the gaussian profile, relative to half_width"
    )
    image: str = option(
        "", note="picture file of the profile image, linear light, relative to the problem file", picture=True
    )
    half_angle: float = option(
        90.0, low=1e-3, high=90, note="degrees, of the cone that a lambertian or a point source lights"
    )
    exponent: float = option(0.0, low=0, high=1000, note="a point's intensity goes with cos(angle)^exponent")
    wavelength: float = option(
        550.0, low=1, high=1e6, note="nm; the report and limits.feature compare the lens's features with it"
    )


@dataclass(frozen=True, kw_only=True)
class Freeform:
    degree: int = option(3, low=2, high=10, note="of the splines")
    spans: tuple[int, int] = option((7, 7), low=1, high=1000, note="knot spans of level 0 in x and y")
    max_level: int | str = option(
        5,
        low=0,
        high=12,
        note="finest level of refinement; auto takes it from the light's detail",
        auto=True,
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


def _radius(automatic: str) -> Any:
    """Return the option of a surface's radius.  automatic : what "auto" stands for."""
    note = f"mm, of the vertex; positive opens to +z, inf is a plane; {automatic}"
    return option(math.inf, infinite=True, size=RADII, note=note, auto=True)


def _conic() -> Any:
    note = "conic constant K, -1 is a paraboloid, as auto is"
    return option(0.0, size=(0, GREATEST_CONIC), note=note, auto=True)


@dataclass(frozen=True, kw_only=True)
class Front:
    half_width: tuple[float, float] = option(low=SHORTEST, high=LONGEST, note="mm")
    radius: float | str = _radius("auto is a plane too")
    conic: float | str = _conic()
    freeform: Freeform | None = option(
        None, note="with the keys of lens.rear.freeform: a front that is free too"
    )


@dataclass(frozen=True, kw_only=True)
class Rear:
    half_width: tuple[float, float] = option(low=SHORTEST, high=LONGEST, note="mm")
    freeform: Freeform = option(Freeform())
    radius: float | str = _radius("auto takes it from the light")
    conic: float | str = _conic()


def base_of(surface: Front | Rear) -> tuple[float, float]:
    """Return radius and conic constant of a surface; those of a plane where they are not known yet."""
    if isinstance(surface.radius, str):
        return math.inf, 0.0
    return surface.radius, -1.0 if isinstance(surface.conic, str) else surface.conic


@dataclass(frozen=True, kw_only=True)
class LensSpec:
    index: float = option(above=1, high=10, note="refractive index, relative to the air around")
    thickness: float = option(low=SHORTEST, high=LONGEST, note="mm between the vertices")
    material: str = option("", note="its name, for the files and the manufacturer")
    density: float = option(0.0, low=0, high=100, note="g/cm^3, for the mass; 0 is unknown")
    front: Front = option()
    rear: Rear = option()

    @property
    def automatic(self) -> bool:
        """Whether the base lens or a bound of the sags is left to the program."""
        surfaces = self.front, self.rear
        free = [s.freeform.z_freedom for s in surfaces if s.freeform is not None]
        return AUTO in (*free, *(value for s in surfaces for value in (s.radius, s.conic)))


@dataclass(frozen=True, kw_only=True)
class Target:
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
    distance: float = option(
        low=SHORTEST,
        high=FARTHEST,
        infinite=True,
        note="mm from the rear vertex to the target plane; inf is the far field",
    )
    half_width: tuple[float, float] = option(low=SHORTEST, high=FARTHEST, note="mm; degrees in the far field")
    encoding: str = option("srgb", choices=("srgb", "linear"), note="of the picture's numbers")
    pixels: tuple[int, int] = option((256, 256), low=2, high=MAX_PIXELS, note="columns, rows")
    fit: str = option("crop", choices=("crop", "pad", "stretch"), note="for pictures of another shape")

    @property
    def placing(self) -> str:
        """How the light is laid on the pixels: `fit` for pictures.

        Regions and formulas are made on the pixels themselves.
        """
        return self.fit if self.kind == "image" else "stretch"


@dataclass(frozen=True, kw_only=True)
class Optimizer:
    iterations: tuple[int, ...] = option(
        (60,), low=1, high=100_000, note="L-BFGS iterations per level; the last number goes on"
    )
    finish: int = option(
        0,
        low=0,
        high=100_000,
        note="iterations of a last pass on unmerged pixels, in a narrow window",
    )
    memory: int = option(10, low=1, high=100, note="pairs that L-BFGS keeps")
    start: str = option(
        "transport",
        choices=("transport", "flat"),
        note="transport gives way to flat where rays spread in the lens and the map asks for too much sag",
    )
    window: str = option(
        "cells",
        choices=("cells", "pixel", "bspline", "gaussian"),
        note="how light is measured on the last level (bspline before); cells is pixel for extended sources",
    )
    blur: float = option(
        0.3,
        low=0.05,
        high=0.5,
        note="pixels, of the pixel window: the half-width of the bump that smooths it",
    )
    window_degree: int = option(
        2, low=1, high=5, note="of the B-spline window, which is window_degree + 1 pixels wide"
    )
    sigma: float = option(1.0, low=0.3, high=2.5, note="pixels, of the Gaussian window")
    merge: int = option(
        1, low=1, high=64, note="pixels merged in each direction; more for light that is blurred anyway"
    )
    rays_per_pixel: float = option(4.0, low=0.5, high=16, note="in each direction, of merged pixels")
    fresnel: bool = option(
        True, note="losses by reflection while optimising; metrics and verify always have them"
    )
    lost_flux_weight: float = option(
        100.0, low=0, high=GREATEST_WEIGHT, note="charge for light beside the target"
    )
    dark_flux_weight: float = option(
        0.0,
        low=0,
        high=GREATEST_WEIGHT,
        note="charge for light that does not reach the lit part of the target",
    )
    roughness_weight: float = option(
        0.0, low=0, high=GREATEST_WEIGHT, note="charge for the sags' bending energy"
    )


@dataclass(frozen=True, kw_only=True)
class Limits:
    thickness: float = option(0.0, low=0, note="mm, least thickness of the lens; 0 is none")
    centre_thickness: float = option(0.0, low=0, note="mm, least thickness on the axis; 0 is none")
    edge_thickness: float = option(0.0, low=0, note="mm, least thickness at the rim; 0 is none")
    greatest_thickness: float = option(
        math.inf, above=0, infinite=True, note="mm, greatest thickness anywhere; inf is none"
    )
    envelope: tuple[float, float] = option(
        (-math.inf, math.inf),
        infinite=True,
        zero=True,
        note="mm, least and greatest z of the solid; the vertex of the front is 0; inf is none",
    )
    radius: float = option(0.0, low=0, note="mm, least radius of curvature of the free surfaces; 0 is none")
    concave_radius: float = option(
        0.0, low=0, note="mm, the same where they are hollow, as the tool must fit in; 0 is none"
    )
    slope: float = option(
        90.0, above=0, high=90, note="degrees, greatest slope of a surface against the plane; 90 is none"
    )
    sag_range: float = option(
        math.inf, above=0, infinite=True, note="mm, greatest difference in height on a surface; inf is none"
    )
    feature: float = option(
        0.0, low=0, note="wavelengths, least size of what a single coefficient shapes; 0 is none"
    )
    mass: float = option(
        math.inf, above=0, infinite=True, note="g, greatest mass; needs lens.density; inf is none"
    )


@dataclass(frozen=True, kw_only=True)
class Refinement:
    indicator: str = option(
        "slope",
        choices=("slope", "vertex", "decrease"),
        note="of the cells that need refinement; slope is vertex where there is no transport start",
    )
    alpha: tuple[float, ...] = option(
        (0.1,), low=0, note="cells above alpha times the mean are refined, per level; the last number goes on"
    )


@dataclass(frozen=True, kw_only=True)
class Verify:
    rays: int = option(257, low=8, high=2049, note="rays per direction of the independent trace")
    surface: float = option(1e-10, above=0, note="mm, limit of the STEP face's deviation")
    landing: float = option(
        1e-8, above=0, note="mm (degrees in the far field), limit of the landing points' deviation"
    )
    irradiance: float = option(1e-6, above=0, note="limit of the relative difference of the irradiance")
    volume: float = option(1e-6, above=0, note="limit of the relative difference of the volume")
    rel_l2: float = option(0.5, above=0, note="greatest error of the light that a design may end with")
    lit_efficiency: float = option(
        0.5, low=0, high=1, note="least fraction of the light behind the lens that meets the lit pixels"
    )


@dataclass(frozen=True, kw_only=True)
class Export:
    schema: str = option("AP242", choices=("AP203", "AP214", "AP242"), note="of the STEP file")
    product: str = option("", note="name of the solid; the title where empty")
    author: str = option("", note="of the STEP file")
    organization: str = option("", note="of the STEP file")


@dataclass(frozen=True, kw_only=True)
class Run:
    seed: int = option(
        0, low=0, note="of the fresh rays of the metrics and of the random signs that scale the variables"
    )
    threads: int = option(0, low=0, high=1024, note="0 uses all cores; 1 repeats a run bit for bit")
    precision: str = option(
        "double", choices=("double", "single"), note="of the optimisation; metrics are always double"
    )


@dataclass(frozen=True, kw_only=True)
class Problem:
    title: str = option("lens")
    source: Source = option()
    lens: LensSpec = option()
    target: Target = option()
    optimizer: Optimizer = option(Optimizer())
    refinement: Refinement = option(Refinement())
    limits: Limits = option(Limits())
    verify: Verify = option(Verify())
    export: Export = option(Export())
    run: Run = option(Run())

    @property
    def target_z(self) -> float:
        """z of the target plane, mm."""
        return self.lens.thickness + self.target.distance


def per_level(values: Sequence[Number], level: int) -> Number:
    """Return the value of a level from a list whose last entry goes on."""
    return values[min(level, len(values) - 1)]
