"""Independent programs that trace the lens of a STEP file, by name.

They take nothing but the file: its faces, and the refractive index in its text.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np

from optics.base.runtime import PRECISIONS, UserError
from optics.exchange.mitsuba import load_mitsuba
from optics.exchange.verification import StepFile
from optics.light.tracing import LandingPoints
from optics.scene.sources import Rays
from optics.scene.system import System, require_lens_on_axis
from thbcad.doors import pip_command
from thbcad.lens import FreeformSurface, OpticalForm
from thbcad.sags import PlacedConic

INDEX = re.compile(r"refractive index ([0-9.]+(?:[eE][-+]?[0-9]+)?)\Z")


class Speed(NamedTuple):
    """How many rays a tracer is given.

    usual : without --rays.  most : with it.  a_second : about, at 227 x 227 poles on two cores.
    """

    usual: int
    most: int
    a_second: int


LEAST_RAYS = 1000
NODES = 769  # in each direction, at least: pearl's light moves by 0.01 pixels, in 7 s for its nodes
SPEEDS = {
    "mitsuba": Speed(10_000_000, 1_000_000_000, 1_000_000),
    "optiland": Speed(20_000, 200_000, 500),
    "occt": Speed(100_000, 1_000_000, 1_700),
}
PACKAGES = {"mitsuba": ("mitsuba", "mitsuba"), "optiland": ("optiland", "verify"), "occt": ("OCP", "optics")}


@dataclass(frozen=True)
class FileTracer:
    """A program that traces a STEP file.

    trace : rays to landing points.  coarser : the same through meshes of every second node, None where the
        faces are traced exactly.
    start : z before the lens, mm.
    resolution : of landing points, mm (degrees in the far field), by the digits of the program's numbers;
        None where the problem's limit holds.
    """

    name: str
    trace: Callable[[Rays], LandingPoints]
    coarser: Callable[[Rays], LandingPoints] | None
    start: float
    resolution: float | None


def require_tracer(name: str, rays: int | None) -> int:
    """Return how many rays a tracer is given.  rays : None is its usual number.

    Raises UserError : it is not installed, or too few or too many rays.
    """
    package, extra = PACKAGES[name]
    if find_spec(package) is None:
        raise UserError(f"{name} is not installed and cannot trace the file; {pip_command(extra)}")
    usual, most, a_second = SPEEDS[name]
    if rays is not None and not LEAST_RAYS <= rays <= most:
        raise UserError(
            f"--rays must lie between {LEAST_RAYS} and {most} for {name}, which traces about {a_second} rays "
            f"a second, got {rays}"
        )
    return usual if rays is None else rays


def require_traced(system: System) -> None:
    """Raise UserError where other programs trace no file of the system."""
    require_lens_on_axis(system, "traces of a file by other programs", "verify it without --light")


def file_tracer(name: str, file: StepFile, system: System, nodes: int = NODES) -> FileTracer:
    """Return a tracer of a STEP file to the target of a system.

    nodes : of Mitsuba's meshes, in each direction of a face that is not plane, at least.

    Raises UserError : Mitsuba cannot be loaded.
    Raises OSError : the file cannot be read.  ValueError : it is no lens, or names no refractive index.
    """
    from optics.exchange.verification import RaysBehind, tracer_by_occt, tracer_by_optiland  # OCCT

    require_traced(system)
    index, target = index_of(file), system.target.receiver
    start = (
        min(_lowest(file.solid.front, system.base.front), _lowest(file.solid.rear, system.base.rear)) - 1.0
    )
    if name != "mitsuba":
        crossed = [(0, 1 / index), (1, index)]
        through = tracer_by_occt(file, crossed) if name == "occt" else tracer_by_optiland(file, index)

        def trace(rays: Rays) -> LandingPoints:
            return through(RaysBehind(rays.origin.T, rays.direction.T, rays.flux)).landing(target)

        return FileTracer(name, trace, None, start, None)
    fine, coarse = _by_mitsuba(file, system, index, nodes)
    digits = PRECISIONS["single"][2]
    resolution = (
        float(np.degrees(digits)) if target.far_field else digits * float(np.linalg.norm(target.pose.shift))
    )
    return FileTracer(name, fine, coarse, start, resolution)


def _lowest(face: OpticalForm, surface: FreeformSurface) -> float:
    """Return a height that no point of a face is below, mm.  surface : bounds conics without a rectangle."""
    if isinstance(face, PlacedConic):
        bounded = np.isfinite(face.half_width).all()
        return min(face.vertex, float(face(*(face.half_width if bounded else surface.half_width))))
    return float(face.coefficients[..., 2].min())


def index_of(file: StepFile) -> float:
    """Return the refractive index that the text of a STEP file names."""
    found = {float(m[1]) for words in file.text.labels["material"] if (m := INDEX.match(words))}
    if len(found) != 1:
        raise ValueError(
            f"{file.path} names {len(found)} refractive indices where a lens has one; export it again"
        )
    return found.pop()


def _by_mitsuba(
    file: StepFile, system: System, index: float, least: int
) -> tuple[Callable[[Rays], LandingPoints], Callable[[Rays], LandingPoints]]:
    from optics.exchange.cross_checks.meshed_file import MeshedLens, coarser, optical_nodes  # OCCT

    nodes = optical_nodes(file, least, [s.half_width for s in (system.base.front, system.base.rear)])
    load_mitsuba(threads=system.problem.run.threads)
    outlines = [surface.outline for surface in (system.base.front, system.base.rear)]
    meshes = nodes, [*map(coarser, nodes)]
    fine, coarse = (MeshedLens(n, index, system.target.receiver, outlines) for n in meshes)
    return fine, coarse
