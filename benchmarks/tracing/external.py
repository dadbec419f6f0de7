"""The light of the pearl lens by programs that read its STEP file: seconds, differences from ours, noise.

Run: thbcad bench external

Random rays are traced on all cores.  Seconds are those of the program: reading the file and evaluating the
nodes of Mitsuba's meshes stand by themselves.  optiland's are extrapolated from FEWER rays.
"""

from __future__ import annotations

import tempfile
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter

from benchmarks.rows.row import Row
from benchmarks.tracing.error_cases import designed
from optics.base.runtime import load_backend
from optics.exchange.cross_checks import LightComparison, compare_light, file_tracer, light_comparison_checks
from optics.exchange.verification import StepFile
from optics.scene.system import System
from thbcad import write_step

FULL = {"mitsuba": 10_000_000, "occt": 100_000, "optiland": 100_000}
FEWER = {"optiland": 10_000}  # 1e5 take four minutes
PACKAGES = {"mitsuba": "mitsuba", "occt": "OCP", "optiland": "optiland"}


def rows() -> list[Row]:
    """Return the measured rows."""
    system = designed("pearl", load_backend("double"))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "lens.step"
        write_step(system.designed, path, system.product)
        return [
            row
            for name in FULL
            if find_spec(PACKAGES[name])
            for row in _measured(name, system, StepFile(path))
        ]


def _measured(name: str, system: System, file: StepFile) -> list[Row]:
    """Return the rows of one program."""
    start = perf_counter()
    tracer = file_tracer(name, file, system)
    ready = perf_counter() - start
    count = FEWER.get(name, FULL[name])
    found = compare_light(system, tracer, count, load_backend("double"))
    law = f"from {count:.0e} rays, in proportion to their number" if name in FEWER else ""
    seconds = found.seconds * FULL[name] / count
    return [
        Row(f"{name}: {FULL[name]:.0e} rays", seconds, "s", law, extrapolated=bool(law)),
        Row("   file and meshes before", ready, "s"),
        *_differences(found, system),
    ]


def _differences(found: LightComparison, system: System) -> list[Row]:
    """Return how far the light is from ours, below the limits of `verify --light`."""
    fates, landing, irradiance, z = (c.limit for c in light_comparison_checks(found, system.problem.verify))
    unit = "mm"
    out = [
        Row(
            "   flux with another fate, the same rays",
            found.to_ours.mismatched / found.emitted,
            "",
            "",
            fates,
        ),
        Row("   landing points, root mean square, the same rays", found.to_ours.rms, unit, "", landing),
        Row("   irradiance, the same rays", found.difference_of_same_rays, "", "", irradiance),
    ]
    if found.coarser is not None:
        out += [
            Row("   error of the mesh, landing points", found.mesh_landing, unit),
            Row("   error of the mesh, irradiance", found.mesh_difference),
        ]
    return [
        *out,
        Row("   irradiance beside exact cells", found.difference),
        Row("   noise of it, expected", found.noise),
        Row("   z-score", found.z, "", "", z),
    ]
