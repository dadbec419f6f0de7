"""The content of exported files, read by independent programs, against the exact surfaces of the lens."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline, NdBSpline

from optics.base.runtime import Check, UserError
from optics.exchange.export.body import WHOLE, Body
from optics.exchange.export.wall_distance import wall_distance
from optics.exchange.verification import state_checks
from thbcad.checks import Floats, Integers
from thbcad.doors import pip_command
from thbcad.io import patched_deviation
from thbcad.lens import FRONT, REAR, FreeformSurface, Lens, Tessellation
from thbcad.splines import BSplineSurface, NURBSSurface

if TYPE_CHECKING:
    from thbcad.cad.exchange import SolidFile, SolidState

SURFACE = 1e-10  # mm; conics as splines are within 1e-11 mm
SOLID_SURFACE = {"step": SURFACE, "iges": 1e-8, "brep": SURFACE}  # mm
VOLUME = 1e-6  # relative, what OCCT's integral is asked for
SAMPLES = 2**20  # per face of a mesh
READERS = {
    "stl": ("trimesh",),
    "obj": ("trimesh",),
    "ply": ("trimesh",),
    "3mf": ("lib3mf", "trimesh"),
    "glb": ("trimesh",),
}


def require_readers(name: str) -> None:
    """Raise UserError unless what reads a format back is installed."""
    for module in READERS.get(name, ()):
        try:
            import_module(module)
        except ImportError:
            raise UserError(
                f"a {name} file is read back by {module}, which is not installed; {pip_command('optics')}"
            ) from None


def solid_checks(lens: Lens, read: SolidFile, name: str, faces: int, body: Body) -> list[Check]:
    """Return the Checks of a solid as OCCT read it.  faces : how many are expected."""
    from optics.exchange.verification import differing_numbers, surface_deviation  # OCCT

    by = f"{name.upper()} read back by OCCT"
    checks = _whole_checks(read, by, faces, body.volume(lens))
    for face, (word, exact, surface, vertex) in zip((read.front, read.rear), body.optical(lens)):
        differing = differing_numbers(face, exact)
        off = surface_deviation(face, surface, vertex, body.is_moulded)
        checks += [
            Check.none_of(f"{word} poles and knots that differ from the lens in memory, {by}", differing),
            Check(f"{word} face, {by}", off, SOLID_SURFACE[name], "mm"),
        ]
    return checks


def patch_checks(lens: Lens, path: Path, faces: int) -> list[Check]:
    """Return the Checks of a STEP file whose front and rear are patches."""
    from thbcad.cad.exchange import SolidState, step_shape  # OCCT

    checks = _whole_checks(SolidState(step_shape(path)), "STEP read back by OCCT", faces, lens.volume())
    return [*checks, Check("front and rear, text of the file", patched_deviation(path, lens), SURFACE, "mm")]


def face_checks(
    word: str, exact: BSplineSurface, read: Sequence[BSplineSurface | NURBSSurface], name: str
) -> list[Check]:
    """Return the Checks of a file with one loose face."""
    from optics.exchange.verification import differing_numbers  # OCCT

    by, differing = f"{name.upper()} read back by OCCT", differing_numbers(read[0], exact)
    return [
        Check.none_of(f"faces besides the one expected, {by}", len(read) - 1),
        Check.none_of(f"{word} poles and knots that differ from the lens in memory, {by}", differing),
    ]


def _whole_checks(state: SolidState, by: str, faces: int, volume: float) -> list[Check]:
    off = abs(state.volume / volume - 1)
    return [
        *state_checks(state, by, faces),
        Check(f"volume against the closed form, relative, {by}", off, VOLUME, ""),
    ]


def mesh_checks(
    lens: Lens, mesh: Tessellation, path: Path, name: str, chord: float, body: Body = WHOLE
) -> list[Check]:
    """Return the Checks of a mesh file: closed, oriented, nowhere farther from the body than `chord`, mm.

    Front and rear are compared in z, the edges by the distance, at the corners, the middles of the sides and
    the centroids of triangles.  Of large meshes every n-th triangle counts, for about a million points a
    face.
    """
    read = read_mesh(path, name)
    by = f"{name.upper()} read back by {READERS[name][0]}"
    off = read.volume - body.volume(lens)
    checks = [
        *triangle_checks(read, mesh, by),
        Check(f"volume against the closed form, {by}", abs(off), chord * read.area, "mm^3"),
    ]
    if checks[0].ok:
        corners = read.vertices.view(np.ndarray)
        faces = np.sort(mesh.faces) if name == "glb" else mesh.faces  # in GLB they are one after the other
        for face, (word, surface, vertex) in zip((FRONT, REAR), lens.faces):
            points = _samples(corners, read.faces[faces == face])
            # in z, and in x and y beside the rectangle
            x, y = (np.clip(points[:, d], -h, h) for d, h in enumerate(surface.half_width))
            error = points - np.column_stack([x, y, vertex + surface(x, y)])
            farthest = float(np.linalg.norm(error, axis=1).max())
            checks.append(Check(f"{word} against the exact surface, {by}", farthest, chord, "mm"))
        walls = (
            (word, _samples(corners, read.faces[faces == face]))
            for face, word in enumerate(mesh.names)
            if face not in (FRONT, REAR)
        )
        edges = wall_distance(lens, body, walls)
        checks.append(Check(f"edges against the exact surfaces, {by}", edges, chord, "mm"))
    return checks


def triangle_checks(read: Any, mesh: Tessellation, by: str) -> list[Check]:
    """Return the Checks that a trimesh.Trimesh has all triangles of a mesh, closed and oriented."""
    return [
        Check.none_of(f"triangles missing or added, {by}", abs(len(read.faces) - len(mesh.triangles))),
        Check.none_of(f"mesh not watertight, {by}", not read.is_watertight),
        Check.none_of(f"mesh not consistently oriented, {by}", not read.is_winding_consistent),
    ]


def sag_checks(word: str, surface: FreeformSurface, path: Path, chord: float) -> list[Check]:
    """Return the Checks of a grid sag: numpy reads it, scipy interpolates it as OpticStudio, bicubically."""
    first, *_ = path.read_text("ascii").split("\n", 1)
    (nx, ny), (dx, dy) = (int(n) for n in first.split()[:2]), (float(d) for d in first.split()[2:4])
    rows = np.loadtxt(path, skiprows=1).reshape(ny, nx, 5)[::-1]
    x, y = dx * (np.arange(nx) - (nx - 1) / 2), dy * (np.arange(ny) - (ny - 1) / 2)
    z, zx, zy, zxy = rows[..., :4].transpose(2, 1, 0)
    mid_x, mid_y = ((a[:-1] + a[1:]) / 2 for a in (x, y))
    lines, slopes = (CubicHermiteSpline(x, f, fx, axis=0)(mid_x) for f, fx in ((z, zx), (zy, zxy)))
    between = CubicHermiteSpline(y, lines, slopes, axis=1)(mid_y) - surface.grid(mid_x, mid_y)
    by = "DAT read back by numpy"
    return [
        Check(f"{word} sags at the points, {by}", _greatest(z - surface.grid(x, y)), SURFACE, "mm"),
        Check(f"{word} sags between the points, bicubic, {by}", _greatest(between), chord, "mm"),
    ]


def cloud_checks(word: str, surface: FreeformSurface, vertex: float, path: Path) -> list[Check]:
    """Return the Checks of a point cloud with normals."""
    x, y, z, *normal = np.loadtxt(path).T
    outward = 1 if word == "rear" else -1
    exact = np.array([-surface(x, y, (1, 0)), -surface(x, y, (0, 1)), np.ones_like(x)]) * outward
    turned = np.array(normal) - exact / np.linalg.norm(exact, axis=0)
    by = "XYZ read back by numpy"
    return [
        Check(f"{word} points, {by}", _greatest(z - vertex - surface(x, y)), SURFACE, "mm"),
        Check(f"{word} normals, {by}", _greatest(turned), SURFACE, ""),
    ]


def array_checks(lens: Lens, path: Path) -> list[Check]:
    """Return the Checks of an NPZ file: scipy evaluates its splines within every knot span."""
    checks = []
    with np.load(path, allow_pickle=False) as arrays:
        for word, surface, _ in lens.faces:
            knots = arrays[f"{word}_knots_x"], arrays[f"{word}_knots_y"]
            spline = NdBSpline(knots, arrays[f"{word}_coefficients"], arrays[f"{word}_degrees"])
            x, y = (np.unique(k) for k in knots)
            x, y = (np.unique(np.concatenate([a, a[:-1] + np.diff(a) / 3])) for a in (x, y))
            z = spline(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1))
            off = _greatest(z - surface.grid(x, y))
            checks.append(Check(f"{word}, NPZ read back by numpy and scipy", off, SURFACE, "mm"))
    return checks


def _greatest(values: Floats) -> float:
    return float(np.abs(values).max())


def _samples(corners: Floats, triangles: Integers) -> Floats:
    """Return corners, middles of the sides and centroids of triangles, (n, 3)."""
    step = -(-5 * len(triangles) // SAMPLES)
    a, b, c = (corners[triangles[::step, k]] for k in range(3))
    return np.concatenate([a, (a + b) / 2, (b + c) / 2, (c + a) / 2, (a + b + c) / 3])


def read_mesh(path: Path, name: str) -> Any:
    """Return the mesh of a file in mm as a trimesh.Trimesh, as a program that did not write it reads it;
    corners of STL and GLB are merged."""
    if name == "3mf":
        return _read_3mf(path)
    trimesh = import_module("trimesh")
    if name != "glb":
        return trimesh.load_mesh(path, file_type=name, process=name == "stl")
    mesh = trimesh.load_scene(path, file_type=name).to_mesh()
    mesh.apply_scale(1e3)  # from the metres of the standard
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    return mesh


def _read_3mf(path: Path) -> Any:
    """Return the one mesh of a 3MF file, as a trimesh.Trimesh; the consortium's library lib3mf reads it."""
    model = import_module("lib3mf").get_wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(str(path))
    objects = model.GetMeshObjects()
    objects.MoveNext()
    mesh = objects.GetCurrentMeshObject()
    rows = (
        (b"".join(map(bytes, items)), dtype)
        for items, dtype in ((mesh.GetVertices(), "<f4"), (mesh.GetTriangleIndices(), "<u4"))
    )
    vertices, triangles = (np.frombuffer(data, dtype).reshape(-1, 3) for data, dtype in rows)
    return import_module("trimesh").Trimesh(
        vertices.astype(np.float64), triangles.astype(np.int64), process=False
    )
