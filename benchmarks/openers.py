"""The STEP files of the examples opened by FreeCAD and gmsh: solids, faces, bounding box, volume, messages.

Run: thbcad bench openers

gmsh is the package of that name (extra `peers`), FreeCAD the program `freecadcmd`; what is not installed is
left out.  Both integrate volumes by the default quadrature of OpenCASCADE, which is off by up to 2.5e-4 on
rough faces: the same quadrature of our solid is the reference, not the closed form.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps

from benchmarks.cad import rough_lens
from benchmarks.checkout import EXAMPLES
from benchmarks.rows.row import Row
from optics.base.runtime import UserError
from optics.exchange.assemblies import placed_text
from optics.exchange.export import Body
from optics.scene.problem import load_problem
from optics.scene.system import System
from thbcad import Conic, FreeformSurface, KnotVector, Lens, THBSpace, THBSurface
from thbcad.cad.exchange import SolidState, part_step, step_shape
from thbcad.cad.shapes import Part, lens_part
from thbcad.io import volume
from thbcad.lens import Flange, Product

Programs = Mapping[str, Callable[[Path], dict[str, Any]]]

BOX = 1e-6  # mm; both programs widen boxes by the tolerance of the faces
VOLUME = 1e-9  # relative
BODIES = {  # of a lens of 100 x 100 mm
    "round": Body(aperture=(45.0, 45.0)),
    "elliptic": Body(aperture=(48.0, 35.0)),
    "polygon": Body(polygon=[(-45.0, -40.0), (40.0, -45.0), (45.0, 30.0), (0.0, 48.0)]),
    "flange": Body(flange=Flange(5.0, 1.0, 3.0)),
    "patches": Body(patches=True),
}
FRONTS = {"sphere": 0.0, "ellipsoid": 0.5, "paraboloid": -1.0, "hyperboloid": -2.0}  # conic constants
RELIEF = 1e-3  # of the thickness: random heights of the unshaped surfaces
GMSH = """
import gmsh, json, sys
gmsh.initialize(interruptible=False)
gmsh.option.setNumber("General.Terminal", 0)
gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
gmsh.logger.start()
gmsh.model.occ.importShapes(sys.argv[1])
gmsh.model.occ.synchronize()
solids = gmsh.model.getEntities(3)
print(json.dumps({
    "solids": len(solids),
    "faces": len(gmsh.model.getEntities(2)),
    "volume": sum(gmsh.model.occ.getMass(3, tag) for _, tag in solids),
    "box": gmsh.model.occ.getBoundingBox(*(solids or [(-1, -1)])[0]),
    "messages": [line for line in gmsh.logger.get() if not line.startswith("Info")],
}))
"""
FREECAD = """
import json, os, Part
shape = Part.Shape()
shape.read(os.environ["STEP_FILE"])
box = shape.BoundBox
print("\\n" + json.dumps({
    "solids": len(shape.Solids),
    "faces": len(shape.Faces),
    "volume": shape.Volume,
    "box": [box.XMin, box.YMin, box.ZMin, box.XMax, box.YMax, box.ZMax],
    "messages": [] if shape.isValid() and shape.Solids[0].isClosed() else ["not valid or not closed"],
}))
"""


@dataclass(frozen=True)
class Opened:
    """How far a file, as a program opened it, is from our solid.

    faults : solids and faces too many or missing, and messages.  box : mm.  volume : relative.
    """

    faults: int
    box: float
    volume: float


def rows() -> list[Row]:
    """Return the measured rows.

    Raises UserError : neither program is installed.
    """
    programs = _programs()
    if not programs:
        raise UserError("neither gmsh nor FreeCAD is installed; pip install gmsh, or install freecadcmd")
    opened: dict[str, list[Opened]] = {program: [] for program in programs}
    quadrature = []
    with TemporaryDirectory() as folder:
        for name, path in _files(Path(folder)):
            own = SolidState(step_shape(path))
            off = abs(_default_volume(own) / volume(placed_text(path).solid) - 1)
            quadrature.append(Row(f"{name}: default quadrature against ours, relative", off))
            for program, opens in programs.items():
                opened[program].append(_compared(opens(path), own))
    return [*(row for program in opened for row in _rows(program, opened[program])), *quadrature]


def _rows(program: str, files: Sequence[Opened]) -> list[Row]:
    """Return the rows of a program: the worst of all files."""
    name = f"{program}, {len(files)} files"
    return [
        Row(f"{name}: solids, faces and messages that are wrong", sum(f.faults for f in files), "", "", 0),
        Row(f"{name}: bounding box against ours", max(f.box for f in files), "mm", "", BOX),
        Row(
            f"{name}: volume against the same quadrature of ours, relative",
            max(f.volume for f in files),
            "",
            "",
            VOLUME,
        ),
    ]


def _compared(seen: dict[str, Any], own: SolidState) -> Opened:
    return Opened(
        faults=abs(seen["solids"] - 1) + abs(seen["faces"] - own.faces) + len(seen["messages"]),
        box=float(abs(np.subtract(seen["box"], own.box)).max()),
        volume=abs(seen["volume"] / _default_volume(own) - 1),
    )


def _default_volume(solid: SolidState) -> float:
    """Return the volume in mm^3 by the default quadrature of OCCT, as other programs show it."""
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(solid.shape, properties)
    return properties.Mass()


def _programs() -> Programs:
    """Return what opens a file, by the name of the program."""
    found: dict[str, Callable[[Path], dict[str, Any]]] = {}
    if find_spec("gmsh"):
        found["gmsh"] = _by_gmsh
    if shutil.which("freecadcmd"):
        found["FreeCAD"] = _by_freecad
    return found


def _by_gmsh(path: Path) -> dict[str, Any]:
    done = subprocess.run([sys.executable, "-c", GMSH, str(path)], capture_output=True, text=True, check=True)
    opened: dict[str, Any] = json.loads(done.stdout)
    return opened


def _by_freecad(path: Path) -> dict[str, Any]:
    script = path.with_name("open.py")
    script.write_text(FREECAD, "utf-8")
    done = subprocess.run(
        ["freecadcmd", str(script)],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "STEP_FILE": str(path)},
    )
    opened: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return opened


def _files(folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield (name, STEP file) of every example and of every kind of body."""
    for name, part in _bodies():
        path = folder / "body.step"
        path.write_bytes(part_step(part, Product()))
        yield name, path
    subprocess.run(
        [sys.executable, str(EXAMPLES / "mount.py"), str(folder / "mounts")], check=True, capture_output=True
    )
    for path in sorted((folder / "mounts").glob("*.step")):
        yield f"{path.stem}, moved", path


def _bodies() -> Iterator[tuple[str, Part]]:
    """Yield (name, solid) of every example with random heights, of conic fronts, and of cut bodies."""
    for file in sorted(EXAMPLES.glob("*.toml")):
        yield file.stem, lens_part(_rough(System(load_problem(file)).base))
    rough = rough_lens(227)
    yield "227^2 poles", lens_part(rough)
    for name, body in BODIES.items():
        yield f"227^2 poles, {name}", body.part(rough)
    kv = KnotVector.uniform(3, 8)
    sag = THBSurface(THBSpace(kv, kv), np.zeros((len(kv.greville())) ** 2))
    for name, constant in FRONTS.items():
        for half in (10.0, 12.0):
            rear = FreeformSurface((half, half), Conic(-60.0, -1.0), sag)
            front = FreeformSurface((10.0, 10.0), Conic(40.0, constant))
            yield f"{name} before {half:g} mm", lens_part(_rough(Lens(front, rear, 12.0, 1.5)))


def _rough(lens: Lens) -> Lens:
    """Return a lens with random heights on its free surfaces."""
    rng = np.random.default_rng(0)
    return lens.with_sags(
        [
            THBSurface(sag.space, RELIEF * lens.thickness * rng.uniform(-1, 1, sag.space.dim))
            for sag in lens.sags
        ]
    )
