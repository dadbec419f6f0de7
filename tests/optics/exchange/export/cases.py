"""The files that a command left, and which checks fail."""

from dataclasses import replace

from optics.exchange.export.body import WHOLE
from optics.exchange.export.read_back import mesh_checks
from thbcad.io import ply_bytes


def names(folder):
    return sorted(p.name for p in folder.iterdir())


def failing(checks):
    """Return what fails, without the words on who read it back."""
    return [c.name.partition(",")[0] for c in checks if not c.ok]


def ply_faults(folder, lens, mesh, chord, body=WHOLE, **changes):
    """Write a mesh with changes as PLY, and return which of its checks fail."""
    path = folder / "mesh.ply"
    path.write_bytes(ply_bytes(replace(mesh, **changes)))
    return failing(mesh_checks(lens, mesh, path, "ply", chord, body))
