"""Checks of the light that an independent program makes through a STEP file."""

from optics.base.runtime import Check
from optics.exchange.cross_checks.light_comparison import LightComparison
from optics.scene.problem import Verify

MOST_Z = 5.0  # 3e-7 of equal lights are farther apart
MESH_FATES = 1e-3  # of the flux: at rims, and where light is just totally reflected, by single precision
ERRORS = 2.0  # of mesh and digits, that two lights may be apart


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
