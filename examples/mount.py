"""Three mounts for three lenses: an LED lens with pins, the plate of a wall washer, a microscope's ring.

    python examples/mount.py [folder]

reads the files in examples/mounts, proves that each mount leaves the clear aperture free, and writes lens and
mount as one solid into the folder (exports/mount by default), moved to where the lens stands in its device.
For a lens of your own the command line does the same:

    thbcad export exports/pearl --mount examples/mounts/led_with_pins.toml --out part.step
    thbcad verify part.step --lens exports/pearl

Needs `pip install "thbcad[cad]"`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import build123d as bd
import numpy as np

from thbcad import Conic, FreeformSurface, KnotVector, Lens, THBSpace, THBSurface
from thbcad.cad import LensPart, write_step
from thbcad.mounts import read_mount, require_mount

HERE = Path(__file__).parent
FOLDER = HERE.parent / "exports" / "mount"


def rippled(half_width: tuple[float, float], radius: float, height: float) -> FreeformSurface:
    """Return a paraboloid with ripples of some height, mm."""
    kv = KnotVector.uniform(3, 12)
    space = THBSpace(kv, kv)
    u, v = (axis.ravel() for axis in np.meshgrid(kv.greville(), kv.greville(), indexing="ij"))
    ripples = THBSurface(space, height * np.sin(9 * u) * np.cos(7 * v))
    return FreeformSurface(half_width, Conic(radius, -1.0), ripples)


# of each mount: the lens, and where it stands
LENSES = {
    "led_with_pins": (
        Lens(FreeformSurface((6, 6)), rippled((6, 6), -12.0, 0.1), 5.0, 1.49),
        bd.Pos(0, 0, 2),
    ),
    "wall_washer": (
        Lens(FreeformSurface((20, 12)), rippled((20, 12), -60.0, 0.3), 9.0, 1.49),
        bd.Pos(0, 80, 0) * bd.Rot(X=35),
    ),
    "microscope_ring": (
        Lens(FreeformSurface((7, 7), Conic(50.0, -1.0)), rippled((7, 7), -40.0, 0.05), 5.0, 1.52),
        bd.Pos(0, 0, -30) * bd.Rot(Y=180),
    ),
}


def mounted(name: str, folder: Path) -> LensPart:
    """Write one lens with its mount, print what is proven of it, and return the part."""
    lens, place = LENSES[name]
    mount = read_mount(HERE / "mounts" / f"{name}.toml")
    proof = require_mount(mount, lens)
    part = place * LensPart(lens, name).mounted(mount)
    write_step(part, folder / f"{name}.step")
    print(
        f"{name}: flange from z = {proof.low:g} to {proof.high:g} mm, clearance {proof.clearance:.3f} mm, "
        f"walls {proof.wall:.3f} mm, {part.volume:.1f} mm^3, {len(part.faces())} faces"
    )
    return part


def main(folder: Path = FOLDER) -> list[LensPart]:
    """Write all of the gallery."""
    folder.mkdir(parents=True, exist_ok=True)
    return [mounted(name, folder) for name in LENSES]


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
