"""The records of a problem file that steer a run: optimiser, limits, refinement, verification, files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from optics.scene.keys import AUTO, option
from optics.scene.problem.choices import ENGINES

Number = TypeVar("Number", int, float)

GREATEST_WEIGHT = 1e12
METHODS = ("lbfgs", "adam")
# limits of uniform light, and of other light; a formula may ask for either
OF_UNIFORM = {"target.kind": ("tophat", "function")}
OF_PICTURES = {"target.kind": ("image", "function")}
GREATEST_STEP = 50.0  # in units of 0.02 z_freedom: the whole of it


@dataclass(frozen=True, kw_only=True)
class Optimizer:
    """How the lens is optimised, as the table [optimizer].

    >>> problem.with_(**{"optimizer.iterations": 20}).optimizer.iterations  # of every level
    (20,)
    """

    engine: str = option(
        "exact",
        choices=ENGINES,
        note="what traces the light while optimising; metrics are always by the exact tracer",
    )
    method: str = option("lbfgs", choices=METHODS, note="of the optimisation")
    step: float = option(
        0.05,
        above=0,
        high=GREATEST_STEP,
        note="of Adam, in units of 0.02 z_freedom",
        only={"method": ("adam",)},
    )
    iterations: tuple[int, ...] = option(
        (72,),
        low=1,
        high=100_000,
        note="iterations per level; the last number goes on; blurred light is sharp in as many before",
    )
    finish: int = option(
        0, low=0, high=100_000, note="iterations of a last pass, with the rays of unmerged pixels"
    )
    memory: int = option(10, low=1, high=100, note="pairs that L-BFGS keeps", only={"method": ("lbfgs",)})
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
        only={"window": ("cells", "pixel")},
    )
    window_degree: int = option(
        2,
        low=1,
        high=5,
        note="of the B-spline window, which is window_degree + 1 pixels wide",
        only={"window": ("bspline", "cells", "pixel")},
    )
    sigma: float = option(
        1.0, low=0.3, high=2.5, note="pixels, of the Gaussian window", only={"window": ("gaussian",)}
    )
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
    """What the lens must keep to be made, as the table [limits].

    >>> problem.with_(**{"limits.edge_thickness": 2}).limits.edge_thickness  # mm
    2.0
    """

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
    """Which cells get finer splines, as the table [refinement].

    >>> problem.with_(**{"refinement.alpha": [0.3, 0.1]}).refinement.alpha  # of level 0, and of all others
    (0.3, 0.1)
    """

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
    """What the light must reach and the files must keep, as the table [verify].

    >>> problem.with_(**{"verify.min_over_mean": 0.8}).verify.min_over_mean  # E_min / E_mean of uniform light
    0.8
    """

    rays: int = option(257, low=8, high=2049, note="rays per direction of the independent trace")
    surface: float = option(1e-10, above=0, note="mm, limit of the STEP face's deviation")
    landing: float = option(
        1e-8, above=0, note="mm (degrees in the far field), limit of the landing points' deviation"
    )
    irradiance: float = option(1e-6, above=0, note="limit of the relative difference of the irradiance")
    volume: float = option(1e-6, above=0, note="limit of the relative difference of the volume")
    grid: int = option(
        21,
        low=9,
        high=101,
        note="boxes in each direction over the lit region, on which uniformity is judged",
        only=OF_UNIFORM,
    )
    min_over_mean: float = option(
        0.7, low=0, high=1, note="least U0 = E_min / E_mean of uniform light; 0 is none", only=OF_UNIFORM
    )
    min_over_max: float = option(
        0.5, low=0, high=1, note="least E_min / E_max of uniform light; 0 is none", only=OF_UNIFORM
    )
    rsd: float = option(
        0.12,
        above=0,
        infinite=True,
        note="greatest std E / E_mean of uniform light; inf is none",
        only=OF_UNIFORM,
    )
    rel_l2: float | str = option(
        AUTO, above=0, infinite=True, auto=True, note="greatest error of the light; auto is 0.1 of a picture"
    )
    contrast_error: float = option(
        0.25,
        above=0,
        infinite=True,
        note="greatest ||E - T|| / ||T - mean T|| of a picture; inf is none",
        only=OF_PICTURES,
    )
    lit_efficiency: float = option(
        0.5, low=0, high=1, note="least flux on the lit region / flux of the source; 0 is none"
    )
    stray: float = option(
        math.inf, above=0, infinite=True, note="greatest flux beside the target / flux of the source"
    )
    beam_angle: tuple[float, float] = option(
        (0.0, math.inf),
        low=0,
        infinite=True,
        zero=True,
        note="degrees, least and greatest full width at half of the peak, in the far field",
    )
    field_angle: tuple[float, float] = option(
        (0.0, math.inf), low=0, infinite=True, zero=True, note="the same at a tenth of the peak"
    )


@dataclass(frozen=True, kw_only=True)
class Export:
    """The words in the STEP file, as the table [export].

    >>> problem.with_(**{"export.schema": "AP214"}).export.schema
    'AP214'
    """

    schema: str = option("AP242", choices=("AP214", "AP242"), note="of the STEP file")
    product: str = option("", note="name of the solid; the title where empty")
    author: str = option("", note="of the STEP file")
    organization: str = option("", note="of the STEP file")


@dataclass(frozen=True, kw_only=True)
class Run:
    """Seed, threads and precision, as the table [run].

    >>> problem.with_(**{"run.threads": 2}).run.threads, problem.run.precision
    (2, 'mixed')
    """

    seed: int = option(
        0, low=0, note="of the fresh rays of the metrics and of the random signs that scale the variables"
    )
    threads: int = option(0, low=0, high=1024, note="0 uses all cores; the lens is the same for any number")
    precision: str = option(
        "mixed",
        choices=("mixed", "double", "single"),
        note="of the optimisation; mixed is single for rays drawn from a source, whose noise is far above "
        "its rounding, else double; metrics are always double",
    )
    keep: str = option(
        "result",
        choices=("result", "levels"),
        note="levels keeps the surface, the irradiance and the indicators of every level",
    )


def per_level(values: Sequence[Number], level: int) -> Number:
    """Return the value of a level from a list whose last entry goes on."""
    return values[min(level, len(values) - 1)]
