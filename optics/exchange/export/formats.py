"""Files of a whole lens for other programs: written, read back by independent code, compared with it."""

import io
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from optics.base.runtime import Check, UserError, note
from optics.exchange.export.body import WHOLE, Body
from optics.exchange.export.drawing_checks import drawing_checks
from optics.exchange.export.height_maps import x3p_bytes, x3p_checks
from optics.exchange.export.read_back import (
    array_checks,
    cloud_checks,
    face_checks,
    mesh_checks,
    patch_checks,
    require_readers,
    sag_checks,
    solid_checks,
)
from optics.exchange.results import ResultFolder, beside, lens_of, require_own, require_writable
from optics.exchange.verification import EXACT_VOLUME, FITTED_VOLUME, volume_check
from thbcad.drawings import DRAWINGS, drawing_bytes, lens_sheet
from thbcad.io import (
    cloud_text,
    obj_bytes,
    parse_brep,
    ply_bytes,
    sag_text,
    stl_bytes,
    table_size,
    threemf_bytes,
    write_files,
)
from thbcad.lens import Lens, Product, Tessellation, placed_surfaces
from thbcad.meshes import glb_bytes

CHORD = 1e-3  # mm
MESHES: dict[str, tuple[Callable[[Tessellation], bytes], bool]] = {  # and whether the format holds float32
    "stl": (stl_bytes, True),
    "3mf": (threemf_bytes, True),
    "obj": (obj_bytes, False),
    "ply": (ply_bytes, False),
    "glb": (glb_bytes, True),
}
SOLIDS = ("step", "iges", "brep")
TABLES = ("dat", "xyz", "x3p")
OF_SURFACES = (*TABLES, "npz")
FORMATS = (*SOLIDS, *OF_SURFACES, *DRAWINGS, *MESHES)
SUFFIXES = {name: name for name in FORMATS} | {"stp": "step", "igs": "iges"}


@dataclass(frozen=True)
class Labels:
    """What CAD files say about a lens, and the schema of STEP files."""

    product: Product = Product()
    schema: str = "AP242"


NAMELESS = Labels()


def labelled_lens(result: str) -> tuple[Lens, Labels]:
    """Return the lens of a result folder or of a native lens file, and its labels.

    Raises UserError : there is none, or it is damaged.
    """
    path = Path(result)
    if path.is_dir():
        system = ResultFolder(path).read().system
        for sentence in beside(system.problem):
            note(sentence)
        return system.designed, Labels(system.product, system.problem.export.schema)
    return lens_of(path, "give a result folder or a lens.json"), NAMELESS


def moulded_in(result: str, body: Body) -> Body:
    """Return a body with what the problem of a result folder says of it.

    Raises UserError : the result is a plate.
    """
    path = Path(result)
    if not path.is_dir():
        return body
    system = ResultFolder(path).read().system
    if system.problem.optic.array is not None:
        raise UserError(
            f"{path} holds a plate of lenses, which {path / 'lens.step'} has as one solid; export lens.json "
            "of it for one lens without the plate"
        )
    return replace(body, moulded=system.body, clear=system.clear_aperture)


def format_of(out: str, wanted: str | None) -> str:
    """Return the format asked for, or else that of the suffix.

    Raises UserError : it is unknown, or not what the suffix promises.
    """
    name = Path(out).suffix[1:].lower() if wanted is None else wanted.lower()
    if name not in SUFFIXES:
        asked = f"the suffix of {out}" if wanted is None else f"the format {wanted!r}"
        raise UserError(
            f"{asked} is unknown; choose --format from {', '.join(FORMATS)}; for light take --light "
            "rear with .tm25ray, .dat or .ray, or a file that ends in .ies or .ldt; for a scene of Mitsuba "
            "one that ends in .xml"
        )
    promised = SUFFIXES.get(Path(out).suffix[1:].lower())
    if promised not in (None, SUFFIXES[name]):
        raise UserError(
            f"{out} would hold {SUFFIXES[name]}, but its suffix promises {promised}; change --format or --out"
        )
    return SUFFIXES[name]


def output_files(path: Path, name: str, body: Body = WHOLE) -> list[Path]:
    """Return the files that an export in a format writes besides its report."""
    suffix = f".{name}" if body.separate else path.suffix
    if body.separate or name in TABLES:
        return [path.with_name(f"{path.stem}_{word}{suffix}") for word in ("front", "rear")]
    return [path]


def report_of(out: str) -> Path:
    """Return the file in which the checks of an export are kept."""
    return Path(f"{out}.json")


def export(
    lens: Lens, name: str, out: str, chord: float = CHORD, body: Body = WHOLE, labels: Labels = NAMELESS
) -> tuple[list[Path], list[Check]]:
    """Write the lens in a format, read it back, and return the files and the Checks of what they hold.

    A sag table, point cloud or X3P file holds one surface: OUT_front and OUT_rear are written.

    chord : mm, the error that meshes may have, and grid sags between their points
    body : of the solid formats step, iges and brep; aperture, polygon and flange also of meshes and
        drawings, factors of all
    labels : for STEP and IGES

    Raises UserError : the path cannot be written, what reads the format back is not installed, a chord error
        that cannot be kept, a body that the format or the lens does not allow.
    """
    path = Path(out)
    for option, asked, allowed in (
        ("--patches needs", body.patches, ("step",)),
        ("--separate needs", body.separate, SOLIDS),
        ("--cavity needs", body.cavity is not None, SOLIDS),
        (
            "a drawing shows the lens without lens.body, of lens.json of the result; lens.body needs",
            body.is_moulded,
            (*SOLIDS, *MESHES, *OF_SURFACES),
        ),
        ("--aperture, --polygon and --flange need", body.shaped, (*SOLIDS, *MESHES, *DRAWINGS)),
    ):
        if asked and name not in allowed:
            raise UserError(f"{option} {', '.join(allowed)}, got {name}")
    require_writable(path)
    require_readers(name)
    try:
        lens, body = body.enlarged(lens)
        if name in MESHES:
            write, single = MESHES[name]
            mesh = body.mesh(lens, chord, single)
            return _written({path: write(mesh)}), mesh_checks(lens, mesh, path, name, chord, body)
        if name in TABLES:
            return _tables(lens, name, path, chord)
        if name == "npz":
            return _written({path: _arrays(lens)}), array_checks(lens, path)
        if name in DRAWINGS:
            sheet = lens_sheet(lens, labels.product, chord, body.aperture, body.flange, body.polygon)
            files = _written({path: drawing_bytes(sheet, name)})
            return files, drawing_checks(lens, sheet, path, name, body)
        if body.separate:
            return _faces(lens, name, path)
        return _solid(lens, name, path, body, labels)
    except OSError as error:  # a full disk
        raise UserError(f"cannot write {path}: {error.strerror}; choose another --out") from None
    except (ValueError, RuntimeError, ImportError) as error:
        raise UserError(f"cannot export {path}: {error}") from None


def require_free_files(files: Sequence[Path], out: str, force: bool) -> None:
    """Raise UserError where files, or the report of an export, cannot be written or would replace others.

    force : replace them nevertheless, but never a file of a result
    """
    report = report_of(out)
    for path in (*files, report):
        require_writable(path)
        if ResultFolder(path.parent).owns(path.name):
            raise UserError(f"{path} is part of the result in {path.parent}; choose another --out")
    require_own(report.parent, [path.name for path in (*files, report)], report.name, force)


def _written(files: dict[Path, bytes]) -> list[Path]:
    """Write files, all or none of them."""
    write_files(files)
    return list(files)


def _tables(lens: Lens, name: str, path: Path, chord: float) -> tuple[list[Path], list[Check]]:
    """Write a sag table, a point cloud or an X3P file of the front and of the rear."""
    files: dict[Path, bytes] = {}
    checks = []
    for file, (word, surface, vertex) in zip(output_files(path, name), lens.faces):
        size = table_size(surface)
        if name == "dat":
            files[file] = sag_text(surface, size)
            checks.append(partial(sag_checks, word, surface, file, chord))
        elif name == "x3p":
            files[file] = x3p_bytes(surface, size)
            checks.append(partial(x3p_checks, word, surface, file))
        else:
            files[file] = cloud_text(surface, vertex, word == "rear", size)
            checks.append(partial(cloud_checks, word, surface, vertex, file))
    return _written(files), [result for check in checks for result in check()]


def _arrays(lens: Lens) -> bytes:
    """Return an NPZ file: front and rear as splines z(x, y), conic included, in mm.

    Nothing in it is executed.
    """
    arrays: dict[str, ArrayLike] = {"thickness": np.float64(lens.thickness), "index": np.float64(lens.index)}
    for (word, surface, _), graph in zip(lens.faces, lens.own_graphs()):
        arrays |= {
            f"{word}_knots_x": graph.kv_u.knots,
            f"{word}_knots_y": graph.kv_v.knots,
            f"{word}_degrees": np.array([graph.kv_u.degree, graph.kv_v.degree]),
            f"{word}_coefficients": graph.coefficients,
            f"{word}_half_width": np.array(surface.half_width),
            f"{word}_corners": np.array(surface.corners),
            f"{word}_radius": np.float64(surface.conic.radius),
            f"{word}_conic": np.float64(surface.conic.constant),
        }
    buffer = io.BytesIO()
    # numpy's stubs let any keyword be `allow_pickle`
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    return buffer.getvalue()


def _solid(lens: Lens, name: str, path: Path, body: Body, labels: Labels) -> tuple[list[Path], list[Check]]:
    """Write the lens as a solid in a CAD format."""
    # OCCT
    from thbcad.cad.exchange import brep_text, part_iges, part_step, read_brep, read_iges, read_step

    part = body.part(lens)
    if name == "step":
        files = _written({path: part_step(part, labels.product, labels.schema)})
    else:
        files = _written({path: part_iges(part, labels.product) if name == "iges" else brep_text(part.solid)})
    if body.patches:
        return files, patch_checks(lens, path, len(part.faces))
    read = {"step": read_step, "iges": read_iges, "brep": read_brep}[name](path)
    checks = solid_checks(lens, read, name, len(part.faces), body)
    walled = body.shaped or body.cavity is not None or body.is_moulded
    if name == "step" and walled:  # by its text, without OCCT
        limit = FITTED_VOLUME if body.fitted(lens) else EXACT_VOLUME
        checks.append(volume_check(parse_brep(path), body.volume(lens), limit))
    return files, checks


def _faces(lens: Lens, name: str, path: Path) -> tuple[list[Path], list[Check]]:
    """Write front and rear as loose faces, one to a file."""
    from thbcad.cad.exchange import read_faces, write_faces  # OCCT

    surfaces, files = dict(zip(("front", "rear"), placed_surfaces(lens))), {}
    with tempfile.TemporaryDirectory() as folder:
        for word, surface in surfaces.items():
            file = path.with_name(f"{path.stem}_{word}.{name}")
            write_faces([surface], Path(folder) / file.name)
            files[file] = (Path(folder) / file.name).read_bytes()
    checks = [
        face_checks(word, surfaces[word], read_faces(file), name)
        for word, file in zip(surfaces, _written(files))
    ]
    return list(files), [check for face in checks for check in face]
