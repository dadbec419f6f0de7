"""Checks of a STEP file, as OCCT reads it, against the designed lens and the light that it must give."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from optics.base.runtime import Backend, Check, UserError
from optics.exchange.verification.solid_text import FINE_VOLUME
from optics.exchange.verification.step_file import ExportedStep, StepFile, faces_besides
from optics.exchange.verification.trace_comparison import file_landing, light_checks
from optics.light.tracing import LandingPoints
from optics.scene.problem import Verify
from optics.scene.system import MadePart, System, designed_part
from thbcad.cad.exchange import SolidFile, solid_volume, step_bytes
from thbcad.checks import Floats
from thbcad.io import write_bytes
from thbcad.lens import FreeformSurface, Lens, OpticalForm, optical_forms
from thbcad.sags import PlacedConic, graph_of_poles
from thbcad.splines import BSplineSurface, KnotVector, NURBSSurface

if TYPE_CHECKING:
    from thbcad.moulds import Made

Surface = BSplineSurface | NURBSSurface | PlacedConic

TOLERANCE = 1e-6  # mm
SURFACE_SAMPLES = 6  # per knot span and direction
AT_ONCE = 2**18  # points of a face: what is computed of them stays in the processor's cache
CONIC_SAMPLES = 101  # per direction of a face without knots, as many as 17 spans have


def export_step(part: MadePart, schema: str, path: Path) -> list[Check]:
    """Write the STEP file of an element, and return the check of its bytes.

    Raises UserError : OCCT cannot make its body.
    """
    try:
        written = step_bytes(part.made, part.product, schema)
    except ValueError as error:
        raise UserError(f"cannot write the STEP file of the lens: {error}") from None
    write_bytes(path, written)
    return [Check.none_of("file differs from what was written", path.read_bytes() != written)]


def read_back_step(made: Made, path: Path, limits: Verify) -> ExportedStep:
    """Return the STEP file of a lens or its body as OCCT reads it."""
    file = StepFile(path)
    checks = _solid_checks(made, file, limits.surface)  # the text of the file gives the volume
    return ExportedStep(checks, file.solid.front, file.solid.rear)


def trace_back_step(system: System, path: Path) -> tuple[list[Check], LandingPoints]:
    """Return the checks of the designed lens's STEP file as OCCT reads it, and its `file_landing`."""
    step = read_back_step(designed_part(system).made, path, system.problem.verify)
    return step.checks, file_landing(system, step, StepFile(path))


def verify(system: System, file: StepFile, backend: Backend) -> list[Check]:
    """Return the list of Checks of a STEP file as OCCT reads it against the lens in memory.

    backend : of double precision.
    """
    return [
        *occt_checks(system.made, file, system.problem.verify),
        *light_checks(system, file_landing(system, file.solid, file), backend),
    ]


def occt_checks(made: Made, file: StepFile, limits: Verify) -> list[Check]:
    """Return the Checks of a STEP file as OCCT reads it against a lens or its body in memory."""
    return [*_solid_checks(made, file, limits.surface), _volume_check(made, file, limits.volume)]


def _volume_check(made: Made, file: StepFile, limit: float) -> Check:
    """Return the check of the volume by OCCT."""
    volume = made.volume()
    off = abs(file.solid.volume / volume - 1)
    if off > limit:  # OCCT's estimate of its own error is too low on rough surfaces: ask for more
        off = abs(solid_volume(file.solid.shape, FINE_VOLUME) / volume - 1)
    return Check("volume by OCCT against the closed form, relative", off, limit, "")


def _solid_checks(made: Made, file: StepFile, limit: float) -> list[Check]:
    """Return the checks of faces, edges, tolerances and numbers."""
    step = file.solid
    return [
        Check.none_of("solids besides the one expected", abs(step.solids - 1)),
        Check.none_of(*faces_besides(made, step.faces)),
        Check.none_of("free edges", step.free_edges),
        Check("tolerance that faces, edges and vertices need to meet", step.tolerance, TOLERANCE, "mm"),
        Check.none_of("shell not closed", not step.closed),
        Check.none_of("solid not valid (OCCT)", not step.valid),
        *_geometry(made, file.solid, limit),
    ]


def _geometry(made: Made, step: SolidFile, limit: float) -> list[Check]:
    """Return the checks of the optical faces."""
    trimmed, checks = not isinstance(made, Lens), []
    lens = made.lens if not isinstance(made, Lens) else made
    for name, read, wanted in zip(("front", "rear"), (step.front, step.rear), optical_forms(lens)):
        count = differing_numbers(read, wanted)
        checks.append(Check.none_of(f"{name} poles and knots that differ from the lens in memory", count))
    for read, (name, surface, vertex) in zip((step.front, step.rear), lens.faces):
        deviation = surface_deviation(read, surface, vertex, trimmed)
        checks.append(Check(f"{name} face against the lens in memory", deviation, limit, "mm"))
    return checks


def surface_deviation(
    face: OpticalForm, surface: FreeformSurface, vertex: float, trimmed: bool = False
) -> float:
    """Return the greatest |z_face(x, y) - z_surface(x, y)| in mm at points within every knot span.

    Where a file bounds a conic by a rectangle, the difference of its half-widths counts too, unless drafted
    walls trim it.

    face : as `optical_forms`.  surface : FreeformSurface at z = vertex.
    """
    if isinstance(face, PlacedConic):
        x, y = (np.linspace(-h, h, CONIC_SAMPLES) for h in surface.half_width)
        size = max(abs(a - b) for a, b in zip(face.half_width, surface.half_width))
        apart = np.abs(face(x[:, None], y[None, :]) - vertex - surface.grid(x, y)).max()
        return float(apart if trimmed or np.isinf(size) else max(apart, size))
    u, v = (_samples(kv) for kv in (face.kv_u, face.kv_v))
    strips = np.array_split(u, 1 + len(u) * len(v) // AT_ONCE)
    apart, *ends = np.max([_apart(face, surface, vertex, strip, v) for strip in strips], axis=0)
    return float(max(apart, *(abs(end - h) for end, h in zip(ends, surface.half_width))))


def _apart(
    face: BSplineSurface, surface: FreeformSurface, vertex: float, u: Floats, v: Floats
) -> tuple[float, float, float]:
    """Return the deviation on a grid of parameters, and the greatest |x| and |y| of the face there."""
    graph, bent = graph_of_poles(face), 0.0
    if graph is None:
        points = face.grid(u, v)
        x, y, heights = points[:, 0, 0], points[0, :, 1], points[..., 2]
        bent = max(np.abs(points[..., 0] - x[:, None]).max(), np.abs(points[..., 1] - y[None, :]).max())
    else:
        x, y = face.kv_u.collocation(u) @ graph[0], face.kv_v.collocation(v) @ graph[1]
        heights = graph[2].grid(u, v)
    hx, hy = surface.half_width
    z = vertex + surface.grid(np.clip(x, -hx, hx), np.clip(y, -hy, hy))
    return float(max(np.abs(heights - z).max(), bent)), float(np.abs(x).max()), float(np.abs(y).max())


def _samples(kv: KnotVector) -> Floats:
    b = kv.breaks
    inner = (b[:-1, None] + np.diff(b)[:, None] * (np.arange(SURFACE_SAMPLES) / SURFACE_SAMPLES)).ravel()
    return np.append(inner, b[-1])


def differing_numbers(read: Surface | None, wanted: Surface) -> int:
    """Return how many numbers of a face differ from the wanted ones: poles, weights and knots of a spline,
    points, directions and the radius of a plane or a sphere.

    Where it has others or another number of them, all of them count.
    """
    rows, expected = _numbers(read), _numbers(wanted)
    if [row.shape for row in rows] != [row.shape for row in expected]:
        return sum(row.size for row in expected)
    return sum(int((a != b).sum()) for a, b in zip(rows, expected))


def _numbers(surface: Surface | None) -> list[Floats]:
    """Return the numbers that a file holds of a surface."""
    if surface is None:
        return []
    if isinstance(surface, PlacedConic):
        return [surface.numbers]
    knots = [surface.kv_u.knots, surface.kv_v.knots]
    if isinstance(surface, BSplineSurface):
        return [surface.coefficients, *knots]
    return [surface.coefficients, surface.weights, *knots]
