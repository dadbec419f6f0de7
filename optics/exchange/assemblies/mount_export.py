"""A lens with its mount in files for other programs, read back and compared."""

from pathlib import Path

import numpy as np

from optics.base.runtime import Check, UserError
from optics.exchange.assemblies.proof import part_checks
from optics.exchange.export import (
    MESHES,
    READERS,
    SOLIDS,
    Labels,
    read_mesh,
    require_readers,
    triangle_checks,
)
from optics.exchange.results import require_writable
from optics.exchange.verification import state_checks
from thbcad.cad.exchange import (
    SolidState,
    brep_shape,
    brep_text,
    iges_shape,
    part_iges,
    part_mesh,
    solid_volume,
)
from thbcad.cad.parts import exact_part, mounted_part, placed_lens, placed_step, surface_numbers
from thbcad.cad.shapes import Part
from thbcad.io import write_bytes
from thbcad.lens import Lens, Tessellation
from thbcad.mounts import LEAST, Mount, read_mount, require_mount

VOLUME = 1e-6  # relative, what OCCT's integral is asked for


def mount_from(path: str) -> Mount:
    """Return the mount of a file.

    Raises UserError : it cannot be read, or describes no mount.
    """
    try:
        return read_mount(path)
    except OSError as error:
        raise UserError(f"cannot read {path}: {error.strerror}; give a mount.toml") from None
    except ValueError as error:
        raise UserError(str(error)) from None


def export_mounted(
    lens: Lens, mount: Mount, name: str, out: str, chord: float, labels: Labels
) -> tuple[list[Path], list[Check]]:
    """Write a lens with its mount in a format of solids or meshes, read it back, and return the files and the
    Checks of what they hold.

    chord : mm, the error that meshes may have.

    Raises UserError : another format; a path that cannot be written; a mount for which the lens has no room;
        a chord error that is not reached.
    """
    path = Path(out)
    if name not in (*SOLIDS, *MESHES):
        raise UserError(f"--mount needs {', '.join((*SOLIDS, *MESHES))}, got {name}")
    require_writable(path)
    require_readers(name)
    try:
        proof = require_mount(mount, lens)
        pairs = (("clearance", mount.clearance, proof.clearance), ("wall", mount.wall, proof.wall))
        short = "least {} of the mount, proven to be {:.6g} mm, short of {:g} mm by"
        checks = [
            Check(short.format(name, got, wanted), max(wanted - got, 0.0), LEAST, "mm")
            for name, wanted, got in pairs
        ]
        body = mounted_part(lens, mount)
        part = exact_part(placed_lens(body, lens), body.names)
        if name in MESHES:
            write, single = MESHES[name]
            mesh: Tessellation = part_mesh(part, chord, single)
            write_bytes(path, write(mesh))
            read = read_mesh(path, name)
            by = f"{name.upper()} read back by {READERS[name][0]}"
            off = abs(read.volume - solid_volume(part.solid, VOLUME))
            apart = np.ptp(read.vertices, axis=0) - np.ptp(mesh.vertices, axis=0)
            return [path], [
                *checks,
                Check("chord error as measured", mesh.chord, chord, "mm"),
                *triangle_checks(read, mesh, by),
                Check(f"size against the mesh in memory, {by}", float(np.abs(apart).max()), chord, "mm"),
                Check(f"volume against OCCT's of the solid, {by}", off, chord * read.area, "mm^3"),
            ]
        return [path], [*checks, *_solid(lens, part, name, path, labels)]
    except OSError as error:  # a full disk
        raise UserError(f"cannot write {path}: {error.strerror}; choose another --out") from None
    except (ValueError, RuntimeError) as error:
        raise UserError(f"cannot export {path}: {error}") from None


def _solid(lens: Lens, part: Part, name: str, path: Path, labels: Labels) -> list[Check]:
    if name == "step":
        write_bytes(path, placed_step(part, lens, labels.product, labels.schema))
        return part_checks(path, lens, False)[0]
    write_bytes(path, part_iges(part, labels.product) if name == "iges" else brep_text(part.solid))
    state = SolidState((iges_shape if name == "iges" else brep_shape)(path))
    by = f"{name.upper()} read back by OCCT"
    placed = placed_lens(state.shape, lens)
    off = abs(state.volume / solid_volume(part.solid, VOLUME) - 1)
    return [
        *state_checks(state, by, len(part.faces)),
        Check(f"volume against the part in memory, relative, {by}", off, VOLUME, ""),
        *(
            Check.none_of(
                f"{word} numbers that differ from the lens in memory, {by}",
                surface_numbers(placed.geometry(word)).differing(surface_numbers(surface)),
            )
            for word, surface in placed.surfaces.items()
        ),
    ]
