"""A mount for a lens: a frame with a seat and four screw holes, fitted to the lens, checked, and written as
an assembly.

    python examples/mount.py [lens.json or a folder with one] [folder]

reads a lens that `thbcad design` has made, or makes a small one, and writes mount.step into the folder
(exports/mount by default).  Needs `pip install "thbcad[cad]"`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import build123d as bd
import numpy as np

from thbcad import Conic, FreeformSurface, KnotVector, Lens, THBSpace, THBSurface, read_lens
from thbcad.cad.exchange import to_build123d
from thbcad.cad.shapes import NAMES

CLEARANCE = 0.1  # mm, all round and under the rim
LEDGE = 2.0  # mm of the front's rim lie on the seat
WALL, PLATE, FLANGE = (
    3.0,
    5.0,
    9.0,
)  # mm: wall round the edges, thickness of the plate and how far it reaches beyond the wall
SCREW = 3.4  # mm, through hole of an M3 screw
CHAMFER = 0.8  # mm
ANODISED = (0.2, 0.2, 0.22)
FOLDER = Path(__file__).parents[1] / "exports" / "mount"


def small_lens() -> Lens:
    """Return a lens with a rippled rear, 40 x 30 mm."""
    kv = KnotVector.uniform(3, 12)
    space = THBSpace(kv, kv)
    u, v = (axis.ravel() for axis in np.meshgrid(kv.greville(), kv.greville(), indexing="ij"))
    ripples = THBSurface(space, 0.3 * np.sin(9 * u) * np.cos(7 * v))
    return Lens(
        FreeformSurface((20, 15), Conic(200.0, -1.0)),
        FreeformSurface((20, 15), Conic(-60.0, -1.0), ripples),
        9.0,
        1.49,
    )


def lowest(surface: FreeformSurface, width: float) -> float:
    """Return the least z of the surface within `width` of its rim, mm, as sampled."""
    x, y = (np.union1d(np.linspace(-h, h, 401), [width - h, h - width]) for h in surface.half_width)
    inside = np.logical_and.outer(*(np.abs(a) < h - width for a, h in zip((x, y), surface.half_width)))
    return float(surface.grid(x, y)[~inside].min())


def mount_for(lens: Lens) -> bd.Solid:
    """Return the mount: a plate with a window smaller than the front, a wall round the edges, and four
    holes."""
    seat = lowest(lens.front, LEDGE) - CLEARANCE
    top = lens.thickness + lowest(lens.rear, 0.0)
    window = [2 * (h - LEDGE) for h in lens.front.half_width]
    pocket = [2 * (max(pair) + CLEARANCE) for pair in zip(lens.front.half_width, lens.rear.half_width)]
    outside = [size + 2 * WALL for size in pocket]
    flange = [size + 2 * FLANGE for size in outside]
    up, down = (
        (bd.Align.CENTER, bd.Align.CENTER, bd.Align.MIN),
        (bd.Align.CENTER, bd.Align.CENTER, bd.Align.MAX),
    )

    plate = bd.chamfer((bd.Pos(Z=seat) * bd.Box(*flange, PLATE, align=down)).edges(), CHAMFER)
    wall = bd.Pos(Z=seat) * bd.Box(*outside, top - seat, align=up)
    wall = bd.chamfer(wall.faces().sort_by(bd.Axis.Z)[-1].edges(), CHAMFER)
    mount = plate + wall
    mount -= bd.Pos(Z=seat) * bd.Box(*pocket, top - seat, align=up)
    mount -= bd.Pos(Z=seat) * bd.Box(*window, PLATE, align=down)
    holes = bd.GridLocations(*(size - FLANGE for size in flange), 2, 2)
    return mount - [bd.Pos(Z=seat - PLATE / 2) * hole * bd.Cylinder(SCREW / 2, PLATE) for hole in holes]


def report(lens: bd.Shape, mount: bd.Shape) -> None:
    """Print sizes and volumes, what lens and mount have in common, and how far the mount is from the front
    and each edge."""
    for part in (lens, mount):
        size = part.bounding_box().size
        print(
            f"{part.label}: {size.X:.2f} x {size.Y:.2f} x {size.Z:.2f} mm, {part.volume:.1f} mm^3, "
            f"{len(part.faces())} faces"
        )
    common = lens & mount
    print(f"in common: {0.0 if common is None else sum(solid.volume for solid in common.solids()):g} mm^3")
    for name, face in zip(NAMES, lens.faces()):
        if name != "rear":
            print(f"from {name} to mount: {face.distance_to(mount):.4f} mm")


def main(lens: Lens, folder: Path) -> bd.Compound:
    """Write lens and mount as an assembly, read it back, print what the file holds and return it."""
    solid, mount = to_build123d(lens), mount_for(lens)
    mount.label, mount.color = "mount", bd.Color(*ANODISED)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "mount.step"
    bd.export_step(bd.Compound(label="lens in mount", children=[solid, mount]), path)
    assembly = bd.import_step(path)
    report(*assembly.children)
    return assembly


if __name__ == "__main__":
    source = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    given = small_lens() if source is None else read_lens(source / "lens.json" if source.is_dir() else source)
    main(given, Path(sys.argv[2]) if len(sys.argv) > 2 else FOLDER)
