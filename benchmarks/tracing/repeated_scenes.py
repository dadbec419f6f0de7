"""The scenes of `thbcad bench reported_errors`: fixed lenses, measured again and again with other seeds.

A lens is designed once, in a few steps.  After that only `run.seed` changes, so all differences come from the
measurement.  A ray file is drawn anew for each seed, because its rays are a sample of the real source.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import isqrt
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import optics
from benchmarks.checkout import EXAMPLES
from optics.base.runtime import Backend
from optics.light.analysis import measure, ray_irradiance
from optics.light.outgoing import outgoing_intensity
from optics.light.roads import Installation, read_r_table, road_checks
from optics.scene.problem import Problem, load_problem
from optics.scene.ray_files import RaySet, write_rays
from optics.scene.system import System
from thbcad import Lens
from thbcad.checks import Floats

FILE_RAYS, ROAD_RAYS = 10_000, 20_000
ROAD_STEP = 5.0  # degrees
ROAD = Installation(height=8.0, spacing=24.0, overhang=3.5, lenses=4)
DIFFUSE = 0.07  # luminance coefficient of a road that scatters evenly, cd/(m^2 lx)
REFERENCE_RAYS = 1 << 23  # of a reference by rays: 8192 on each of 32 x 32 pixels

Changes = dict[str, Any]
Number = tuple[float | None, float]  # a value, None where it is not known, and its reported error

ZONES = [
    {"name": "middle", "points": [[0.0, 0.0]], "least": 1000.0},
    {"name": "side", "points": [[6.0, -1.0]], "least": 1000.0},
    {"name": "band", "box": [[-5.0, -2.0], [5.0, 2.0]], "least": 1000.0},
    {"name": "above", "box": [[-8.0, 4.0], [8.0, 6.0]], "greatest": 1000.0},
]
OWN_ZONES: Changes = {"target.regulation": "", "target.zone": ZONES, "target.aperture": 1.0}


class Sample(NamedTuple):
    """One measurement.

    numbers : all that have an error, by name.
    irradiance : as of a Measurement, None where only a road is lit.
    margin : the greatest margin of a zone in its errors.
    """

    numbers: dict[str, Number]
    irradiance: Floats | None
    margin: float = 0.0


@dataclass(frozen=True, eq=False)
class Scene:
    """A problem whose light is measured with many seeds.

    example, changes : the problem.
    of_file : the measurement has random rays of the problem's source, from a file.
    road : its light is measured on a road alone.
    by_rays : its reference is traced by rays, since the noise of beams does not fall with the pixels.
    """

    name: str
    example: str
    changes: Changes = field(default_factory=dict)
    of_file: bool = False
    road: bool = False
    by_rays: bool = False

    @cached_property
    def problem(self) -> Problem:
        few = {"optimizer.iterations": [10], "run.threads": 1}
        return load_problem(EXAMPLES / f"{self.example}.toml", few | self.changes)

    @cached_property
    def lens(self) -> Lens:
        """The lens, designed when first needed."""
        return optics.design(self.problem).lens

    @property
    def system(self) -> System:
        """The scene as designed, whose target is that of every measurement."""
        return System(self.problem).with_all_sources

    def sample(self, seed: int, backend: Backend, finer: int = 1) -> Sample:
        """Return a measurement.

        finer : pixels in one of the problem's, in each direction; there are `finer`^2 times as many rays.
        """
        pixels = [finer * n for n in self.problem.target.pixels]
        changes: Changes = {"run.seed": seed, "target.pixels": pixels}
        with tempfile.TemporaryDirectory() as folder:
            if self.of_file:
                file = Path(folder) / "source.tm25ray"
                write_rays(self._drawn_rays(seed, FILE_RAYS * finer**2), file)
                changes |= {"source.kind": "rays", "source.half_width": [0.0, 0.0], "source.file": str(file)}
            system = System(self.problem.with_(**changes))
            if self.road:
                return Sample(
                    dict(_on_road(system.with_lens(self.lens), backend, ROAD_RAYS * finer**2)), None
                )
            found = measure(system.with_lens(self.lens), backend)
        numbers = dict(reported(found.metrics))
        if found.metrics["paths"] == "sequential":
            del numbers["rel_l2_sequential"]  # it is rel_l2
        margins = [row["margin_in_errors"] or 0.0 for row in found.metrics.get("zones", ())]
        return Sample(numbers, found.irradiance, max(map(abs, margins), default=0.0))

    def by_many_rays(self, seed: int, backend: Backend) -> Floats:
        """Return the light along the path by many rays, whatever measures it else; as `Sample.irradiance`."""
        system = System(self.problem.with_(**{"run.seed": seed}))
        screen, path = system.target.screen(), system.with_lens(self.lens).shaded_path
        light, _ = ray_irradiance(system, path, screen, backend, REFERENCE_RAYS)
        return light.irradiance / screen.projection()

    def _drawn_rays(self, seed: int, count: int) -> RaySet:
        """Return independent random rays of the problem's square Lambertian source."""
        source = self.problem.source
        s, t, share, turn = np.random.default_rng((seed, count)).uniform(size=(4, count))
        x, y = (half * (2 * at - 1) for half, at in zip(source.half_width, (s, t)))
        sine, angle = np.sqrt(share) * np.sin(np.radians(source.half_angle)), 2 * np.pi * turn
        direction = np.stack([sine * np.cos(angle), sine * np.sin(angle), np.sqrt(1 - sine**2)], axis=1)
        position = np.stack([x, y, np.zeros(count)], axis=1)
        return RaySet(position, direction, np.full(count, 1.0 / count), unit="lm")


SCENES = (
    Scene(
        "extended",
        "extended",
        {
            "target.pixels": [32, 32],
            "target.shape": "rectangle",  # light with two mirror planes takes a quarter of the rays
            "lens.rear.freeform.max_level": 2,
            "optimizer.merge": 1,
            "optimizer.finish": 0,
        },
    ),
    Scene(
        "sun",
        "pearl",
        {
            "target.pixels": [32, 32],
            "lens.rear.freeform.max_level": 1,
            "source.divergence": 0.2665,
            "source.divergence_profile": "sun",
        },
        by_rays=True,
    ),
    Scene(
        "diverging beam",
        "tophat_square",
        {"target.pixels": [32, 32], "lens.rear.freeform.max_level": 1, "source.divergence": 0.25},
        by_rays=True,
    ),
    Scene(
        "ray file",
        "headlamp_led",
        {"target.pixels": [32, 16], "lens.rear.freeform.max_level": 0} | OWN_ZONES,
        of_file=True,
    ),
    Scene(
        "two sources",
        "two_sources",
        {
            "target.pixels": [32, 32],
            "lens.rear.freeform.spans": [24, 24],
            "optimizer.iterations": [60],
        },
    ),
    Scene("plate", "street_plate", {"target.pixels": [32, 24], "lens.rear.freeform.max_level": 1}),
    Scene(
        "road",
        "street",
        {
            "target.pixels": [32, 16],
            "lens.front.freeform.max_level": 1,
            "lens.rear.freeform.max_level": 1,
        },
        road=True,
    ),
)
BY_CELLS = (
    Scene(
        "top hat by cells",
        "tophat_square",
        {"target.pixels": [32, 32], "lens.rear.freeform.max_level": 1},
    ),
    Scene(
        "zones by cells",
        "headlamp",
        {"target.pixels": [32, 16], "lens.rear.freeform.max_level": 1} | OWN_ZONES,
    ),
)


def reported(metrics: dict[str, Any], within: str = "") -> Iterator[tuple[str, Number]]:
    """Yield (name, number) of all metrics that have an error, zones by their names."""
    for key, value in metrics.items():
        if isinstance(value, dict):
            yield from reported(value, f"{within}{key}.")
        own = key.removesuffix("_error").removesuffix("_std")
        name = next((name for name in (f"{own}_debiased", own) if name in metrics and name != key), None)
        if name is not None and own != key:
            yield within + name, (metrics[name], value)
    for row in metrics.get("zones", ()):
        yield f"zone {row['name']}", (row["value"], row["error"])


def coarser(image: Floats, projection: Floats, shape: tuple[int, int]) -> Floats:
    """Return light on fewer pixels, where each is a block of the image's, weighted with its projection."""
    times = isqrt(image.size // (shape[0] * shape[1]))

    def mean(values: Floats) -> Floats:
        blocks: Floats = values.reshape(shape[0], times, shape[1], times).mean(axis=(1, 3))
        return blocks

    whole = np.broadcast_to(projection, image.shape)
    return mean(image * whole) / mean(whole)


def _on_road(system: System, backend: Backend, rays: int) -> Iterator[tuple[str, Number]]:
    """Yield (name, number) of a road under lamps with the light of a lens.

    Its surface scatters evenly: r = q cos(gamma)^3, read from a file as users give it.
    """
    light = outgoing_intensity(system, backend, rays, ROAD_STEP)
    parts = [replace(light.luminaire, candela=candela) for candela in light.parts]
    tangents = np.append(np.arange(0, 2, 0.25), np.arange(2, 12.1, 0.5))  # the rows of an r-table
    r = 1e4 * DIFFUSE * (1 + tangents**2) ** -1.5
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "diffuse.txt"
        np.savetxt(file, np.tile(r[:, None], (1, 20)), "%.6f")
        surfaces = {"P4": None, "M5": read_r_table(file)}
    for name, surface in surfaces.items():
        for check in road_checks(name, ROAD, light.luminaire, parts, surface):
            yield f"{name}, {check.name}", (check.value, check.error)
