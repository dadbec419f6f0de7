"""Landing points on pixels, how far two traces of the same rays are apart, and checks of light by others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optics.base.runtime import Backend, Check
from optics.exchange.cross_checks.light_comparison import LightComparison
from optics.light.tracing import LandingPoints, Tracer
from optics.scene.paths import LightPath
from optics.scene.problem import Verify
from optics.scene.receivers import Screen
from optics.scene.sources import RayGrid, Rays
from thbcad.checks import Floats

NO_LIGHT = 1e-12  # of a ray's mean flux: rays with less count nowhere, and programs may round it to none
MOST_Z = 5.0  # 3e-7 of equal lights are farther apart
MESH_FATES = 1e-3  # of the flux: at rims, and where light is just totally reflected, by single precision
ERRORS = 2.0  # of mesh and digits, that two lights may be apart


@dataclass(frozen=True, eq=False)
class Distances:
    """Landing points of the same rays by two tracers; sums of two of them are those of all rays.

    squares : sum of squared distances of rays that land on the target by both.  greatest : distance.
    count : of these rays.  mismatched : flux of rays that arrive by one only, W.
    """

    squares: float = 0.0
    greatest: float = 0.0
    count: int = 0
    mismatched: float = 0.0

    def __add__(self, other: Distances) -> Distances:
        return Distances(
            self.squares + other.squares,
            max(self.greatest, other.greatest),
            self.count + other.count,
            self.mismatched + other.mismatched,
        )

    @property
    def rms(self) -> float:
        """Root mean square distance; infinite where no ray lands on the target by both."""
        return float(np.sqrt(self.squares / self.count)) if self.count else float("inf")


def exact_landing(path: LightPath, rays: RayGrid | Rays, backend: Backend) -> LandingPoints:
    """Return where rays along a path land.  backend : of double precision."""
    with backend.dr.suspend_grad():
        _, landing = Tracer(backend, path, rays).trace()
    backend.dr.eval(landing.x, landing.y, landing.flux)
    flux = landing.flux.numpy()
    points = np.column_stack([landing.x.numpy(), landing.y.numpy()])
    return LandingPoints(np.where(flux[:, None] > 0, points, np.nan), flux)


def distances(one: LandingPoints, other: LandingPoints, emitted: Floats, screen: Screen) -> Distances:
    """Return the Distances of the same rays.  emitted : flux of the rays, (n,) W."""
    least = NO_LIGHT * emitted.mean()
    lit, others_lit = one.flux > least, other.flux > least
    both = lit & others_lit
    both[both] = (np.abs(other.points[both]) <= screen.half_width).all(axis=1)
    apart = np.linalg.norm(one.points[both] - other.points[both], axis=1)
    return Distances(
        squares=float((apart**2).sum()),
        greatest=float(apart.max(initial=0.0)),
        count=len(apart),
        mismatched=float(emitted[lit != others_lit].sum()),
    )


def binned(landing: LandingPoints, screen: Screen) -> Floats:
    """Return flux and sum of squared flux of the rays on every pixel, (2, rows, columns), W and W^2."""
    return np.stack([screen.binned(landing.points, landing.flux**power) for power in (1, 2)])


def on_target(landing: LandingPoints, screen: Screen) -> int:
    """Return how many rays land on the target."""
    lit = landing.flux > 0
    return int((np.abs(landing.points[lit]) <= screen.half_width).all(axis=1).sum())


def light_comparison_checks(found: LightComparison, limits: Verify) -> list[Check]:
    """Return the Checks of a LightComparison.

    Where a mesh is traced, landing points and irradiance may be as far from ours as ERRORS times the error
    that its nodes and its digits make; faces that are traced exactly keep the limits of the problem.
    """
    name, unit = found.name, found.screen.unit
    if found.resolution is None:
        fates, landing, irradiance = 0.0, limits.landing, limits.irradiance
    else:
        fates = MESH_FATES
        landing = ERRORS * (found.mesh_landing + found.resolution)
        irradiance = ERRORS * found.mesh_difference + found.border_noise
    same = f"the same {found.rays} random rays by {name} through the file and by ours"
    mismatched = found.to_ours.mismatched / found.emitted
    return [
        Check(f"{same}: flux with another fate, relative", mismatched, fates, ""),
        Check(f"{same}: landing points, root mean square", found.to_ours.rms, landing, unit),
        Check(f"{same}: irradiance, relative", found.difference_of_same_rays, irradiance, ""),
        Check(f"irradiance by {name} beside ours of {_beside(found)}: z-score", found.z, MOST_Z, ""),
    ]


def light_comparison_lines(found: LightComparison) -> list[str]:
    """Return the numbers of a LightComparison as lines of text."""
    (rows, columns), unit = found.screen.shape, found.screen.unit
    lines = [
        f"{found.name}: {found.rays} random rays through the STEP file in {found.seconds:.3g} s, "
        f"{found.rays_per_pixel:.0f} on each of {columns} x {rows} merged pixels",
        f"  the same rays, without noise: irradiance {found.difference_of_same_rays:.2e} apart, "
        f"landing points {found.to_ours.rms:.2e} {unit} (at most {found.to_ours.greatest:.2e})",
    ]
    if found.coarser is not None:
        lines.append(
            f"  error of the mesh, from every second node: irradiance {found.mesh_difference:.2e}, "
            f"landing points {found.mesh_landing:.2e} {unit}"
        )
    lines.append(
        f"  beside our {_beside(found)}: irradiance {found.difference:.4f} apart, noise {found.noise:.4f}, "
        f"z-score {found.z:.2f}"
    )
    return lines


def _beside(found: LightComparison) -> str:
    return "cells" if found.ours_error is None else "other rays"
