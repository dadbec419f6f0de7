"""The lens as a CAD file: time, size and what is read back, for rough synthetic lenses that fill the whole
net.

Run on one core: thbcad bench cad
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.checkout import EXAMPLES
from benchmarks.rows.row import Row
from optics.base.runtime import Backend, Check, load_backend
from optics.exchange.export import export
from optics.exchange.verification import (
    StepFile,
    differing_numbers,
    optiland_available,
    optiland_checks,
    text_and_occt_checks,
    verify,
)
from optics.scene.problem import load_problem
from optics.scene.system import System
from thbcad import Conic, FreeformSurface, KnotVector, Lens, THBSpace, THBSurface
from thbcad.cad.exchange import SolidFile, brep_bytes, iges_bytes, part_step, read_brep, read_iges, step_bytes
from thbcad.cad.shapes import lens_part
from thbcad.lens import OpticalForm, Product, optical_forms
from thbcad.sags import PlacedConic

MEGABYTES = {227: 5.0, 451: 20.0}  # by the poles per direction
SECONDS = {227: 2.3, 451: 8.0}  # from the splines to the verified file, imports not counted
RELIEF = 0.05  # mm
CHORD = 0.01  # mm
PROBLEM = EXAMPLES / "pearl.toml"
OPTILAND = "trace by optiland"
FACE = {"step": 1e-12, "iges": 1e-8, "brep": 1e-12}  # mm
VOLUME = 1e-6  # relative
SAMPLES = 997  # per direction; a prime, so that points fall everywhere between knots
QUARTER = 1 / 3  # of the file of the full net
PRODUCT = Product("rough lens", "thbcad", "thbcad", "PMMA", 1.19)


@dataclass(frozen=True, eq=False)
class Trip:
    """A lens that went through a STEP file: what was read, seconds by step, checks (by optiland apart), and
    the size of the file in MB."""

    read: SolidFile
    seconds: dict[str, float]
    checks: list[Check]
    megabytes: float


def rows() -> list[Row]:
    """Return the measured rows."""
    found = []
    system, backend = System(load_problem(PROBLEM)), load_backend("double", 2)
    with TemporaryDirectory() as folder:
        step_trip(system.with_lens(rough_lens(19)), backend, Path(folder))  # loads and compiles
        for poles in MEGABYTES:
            lens = rough_lens(poles)
            trip = step_trip(system.with_lens(lens), backend, Path(folder))
            found += [*_time_rows(poles, trip), *_step_rows(poles, lens, trip), *_check_rows(poles, trip)]
            found += [*_other_rows(poles, lens, Path(folder)), _mesh_row(poles, lens, Path(folder))]
    return [*found, _quarter_row()]


def rough_lens(poles: int) -> Lens:
    """Return a lens of 100 x 100 mm whose rear is a paraboloid with poles x poles random heights, smoothed as
    1 / frequency^2."""
    kv = KnotVector.uniform(3, poles - 3)
    frequency = np.hypot(np.fft.fftfreq(poles)[:, None], np.fft.rfftfreq(poles)[None, :])
    frequency[0, 0] = np.inf
    noise = np.random.default_rng(0).standard_normal((poles, poles))
    heights = np.fft.irfft2(np.fft.rfft2(noise) / frequency**2, (poles, poles))
    return _lens(THBSurface(THBSpace(kv, kv), RELIEF * (heights / np.abs(heights).max()).ravel()))


def step_trip(system: System, backend: Backend, folder: Path) -> Trip:
    """Build, write, read and verify a lens as `thbcad verify` does, by optiland too where it is installed."""
    seconds, path = {}, folder / "lens.step"

    def timed(name: str, function: Callable[[], Any]) -> Any:
        start = perf_counter()
        result = function()
        seconds[name] = perf_counter() - start
        return result

    part = timed("build the solid", lambda: lens_part(system.designed))
    timed("write the STEP file", lambda: path.write_bytes(part_step(part, system.product)))
    file = StepFile(path)
    timed("read its text", lambda: file.text)
    read = timed("read it with OCCT", lambda: file.solid)
    checks = timed(
        "compare text, OCCT's rays, volume and area with the lens",
        lambda: text_and_occt_checks(system, file, backend),
    )
    checks += timed("verify solid, poles, landing points, irradiance", lambda: verify(system, file, backend))
    if optiland_available():
        checks += timed(OPTILAND, lambda: optiland_checks(system, file))
    return Trip(read, seconds, checks, path.stat().st_size / 1e6)


def _lens(sag: THBSurface) -> Lens:
    return Lens(FreeformSurface((50, 50)), FreeformSurface((50, 50), Conic(-150.0, -1.0), sag), 20.0, 1.49)


def _time_rows(poles: int, trip: Trip) -> list[Row]:
    total = sum(time for name, time in trip.seconds.items() if name != OPTILAND)
    return [
        *(Row(f"{poles}^2 poles: {name}", time, "s") for name, time in trip.seconds.items()),
        Row(f"{poles}^2 poles: all of this but optiland", total, "s", "2 threads", SECONDS[poles]),
        Row(f"{poles}^2 poles: STEP file", trip.megabytes, "MB", "", MEGABYTES[poles]),
    ]


def _step_rows(poles: int, lens: Lens, trip: Trip) -> list[Row]:
    read = trip.read
    faults = (
        abs(read.solids - 1) + abs(read.faces - 6) + read.free_edges + (not read.valid) + (not read.closed)
    )
    return [
        Row(
            f"{poles}^2 poles: STEP, faults of the solid",
            faults,
            "",
            "solids, faces, free edges, closed, valid",
            0,
        ),
        *_face_rows(poles, lens, read, "step"),
        Row(
            f"{poles}^2 poles: STEP, volume by OCCT against the closed form",
            abs(read.volume / lens.volume() - 1),
            "",
            "",
            VOLUME,
        ),
    ]


def _check_rows(poles: int, trip: Trip) -> list[Row]:
    """Return how many checks failed, and the values of those of landing points and volume."""
    failed = sum(not c.ok for c in trip.checks)
    shown = [c for c in trip.checks if "landing" in c.name or "volume" in c.name]
    return [
        Row(f"{poles}^2 poles: checks that failed", failed, "", f"of {len(trip.checks)}", 0),
        *(Row(f"{poles}^2 poles: {c.name}", c.value, c.unit, "", c.limit) for c in shown),
    ]


def _mesh_row(poles: int, lens: Lens, folder: Path) -> Row:
    """Return the greatest error of an STL file, relative to the chord error that was stated."""
    _, checks = export(lens, "stl", str(folder / "lens.stl"), CHORD)
    worst = max(c.value for c in checks if c.unit == "mm")
    return Row(
        f"{poles}^2 poles: STL, error over the stated chord error of {CHORD} mm", worst / CHORD, "", "", 1.0
    )


def _other_rows(poles: int, lens: Lens, folder: Path) -> list[Row]:
    found = []
    for name, data, read in (
        ("iges", iges_bytes(lens, PRODUCT), read_iges),
        ("brep", brep_bytes(lens), read_brep),
    ):
        path = folder / f"lens.{name}"
        path.write_bytes(data)
        found += [
            Row(f"{poles}^2 poles: {name.upper()} file", len(data) / 1e6, "MB"),
            *_face_rows(poles, lens, read(path), name),
        ]
    return found


def _face_rows(poles: int, lens: Lens, read: SolidFile, name: str) -> list[Row]:
    faces = (read.front, read.rear)
    differ = sum(differing_numbers(face, own) for face, own in zip(faces, optical_forms(lens)))
    x = np.linspace(-50, 50, SAMPLES)
    exact = (lens.front.grid(x, x), lens.thickness + lens.rear.grid(x, x))
    error = max(float(np.abs(_heights(face, x) - z).max()) for face, z in zip(faces, exact))
    return [
        Row(f"{poles}^2 poles: {name.upper()}, poles that differ", differ, "", "", 0),
        Row(
            f"{poles}^2 poles: {name.upper()}, faces against the lens",
            error,
            "mm",
            f"{SAMPLES}^2 points per face",
            FACE[name],
        ),
    ]


def _heights(face: OpticalForm, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return z over x times x, mm."""
    if isinstance(face, PlacedConic):
        return face(x[:, None], x[None, :])
    u, v = (np.clip(x, kv.start, kv.stop) for kv in (face.kv_u, face.kv_v))
    heights: NDArray[np.float64] = face.grid(u, v)[..., 2]
    return heights


def _quarter_row() -> Row:
    """Return the size of a file whose lens has 256^2 spans in one quarter and 32^2 elsewhere, as a share of
    that with 256^2 spans."""
    quarter, full = THBSpace(*[KnotVector.uniform(3, 32)] * 2), THBSpace(*[KnotVector.uniform(3, 256)] * 2)
    for level in range(3):
        quarter = quarter.refine({level: np.argwhere(np.ones((16 << level, 16 << level)))})
    rng = np.random.default_rng(0)
    sizes = [
        len(step_bytes(_lens(THBSurface(space, 1e-3 * rng.standard_normal(space.dim)))))
        for space in (quarter, full)
    ]
    return Row(
        "refined in one quarter: STEP file, share of the full net's",
        sizes[0] / sizes[1],
        "",
        f"{sizes[0] / 1e6:.2f} MB",
        QUARTER,
    )
