"""What a pack holds, as one zip whose bytes depend on the result alone."""

import io
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import numpy as np

from optics.base.runtime import Check, UserError, checks_of
from optics.exchange.export import Body, Labels, export
from optics.exchange.packs.expected import (
    Quantity,
    dense_points,
    light_quantities,
    part_quantities,
    ray_files,
    ray_table,
    table_text,
)
from optics.exchange.packs.readme import DRAWING, Told, texts
from optics.exchange.results import ResultFolder, read_arrays
from optics.scene.ray_files import RaySet
from optics.scene.receivers import FarField, Plane
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.io import read_json

EPOCH = 1980, 1, 1, 0, 0, 0  # the date of every file in a zip
LEVEL = 1  # of zlib: a tenth larger than by 6, in a fifth of the time
MESH = "lens.stl"
CHORDS = {MESH: 0.01, "sag.dat": 1e-3, DRAWING: 1e-3}  # mm; the mesh is for looking at
CLAIMS = ("lens.step", "verify.json", "metrics.json", "irradiance.npz", "irradiance_16bit.png")


@dataclass(frozen=True, eq=False)
class Pack:
    """A pack.  data : bytes of the zip.  names : of its files.  checks : of what they hold.
    rows : the numbers to compare."""

    data: bytes
    names: tuple[str, ...]
    checks: tuple[Check, ...]
    rows: tuple[Quantity, ...]


def packed(result: str, wanted: str) -> Pack:
    """Return the pack of a result for a program, of `texts`.

    Raises UserError : no result folder with a verified STEP file, a result that a pack cannot hold, as
        `export` and `outgoing_rays`.
    """
    folder, program = ResultFolder(result), texts()["programs"][wanted]
    if not folder.path.is_dir():
        raise UserError(f"a pack needs a result folder, and {result} is none")
    system, record = folder.read()
    metrics = _verified(folder)
    _require_packable(system, folder.path, bool(program["rays"]))
    try:
        points, point_checks, grids = dense_points(system.designed)
    except ValueError as error:
        raise UserError(f"cannot pack {folder.path}: {error}") from None
    exported, checks = _exported(system)
    files = {"lens.step": folder.step.read_bytes()} | exported | points
    rows, rays = part_quantities(system), None
    if program["rays"]:
        written, rays = ray_files(system, program["rays"])
        files |= {"ray_table.csv": ray_table(system)} | written
        light, light_rows = _light(folder, system, rays, metrics)
        files, rows = files | light, rows + light_rows
    files["compare.csv"] = table_text(rows)
    told = Told(system, program, record["verdict"], metrics["paths"], CHORDS[MESH], grids, rows, rays)
    files = {"README.txt": told.readme(files)} | files
    return Pack(_zipped(files), tuple(files), (*checks, *point_checks), tuple(rows))


def _verified(folder: ResultFolder) -> dict[str, Any]:
    """Return the metrics of a result."""
    folder.require_recorded(CLAIMS)
    verified, metrics = (read_json(folder.path / name, "record") for name in CLAIMS[1:3])
    failed = [check.name for check in checks_of(verified) if check.subject == "file" and not check.ok]
    if failed:
        raise UserError(
            f"{folder.step} is not verified: {failed[0]} failed, see verify.json; run the design again"
        )
    return dict(metrics)


def _require_packable(system: System, path: Path, traces: bool) -> None:
    """Raise UserError for a result that is not one lens, or whose light no pack describes.

    traces : whether rays and light are packed too
    """
    row = (
        f"give them by `thbcad export {path} --scene elements --out parts.step`, and their light by "
        f"`thbcad export {path} --light rear --out light.tm25ray`"
    )
    one = "design one lens of it by --set lens.array=false, and pack that"
    shop = "take --for shop, or the rays of `thbcad export --light rear`"
    curved = not isinstance(system.target.receiver, Plane | FarField)
    for found, what, remedy in (
        (bool(system.problem.element), "elements in places of their own", row),
        (system.problem.optic.array is not None, "a plate of lenses", one),
        (traces and bool(system.stops), "stops", shop),
        (traces and any(system.slope_rms), "rough faces, which rays in files do not know", shop),
        (traces and curved, "a curved screen", shop),
    ):
        if found:
            raise UserError(
                f"a pack holds one lens, its source and a plane screen; {path} has {what}: {remedy}"
            )


def _exported(system: System) -> tuple[dict[str, bytes], list[Check]]:
    """Return mesh, tables and drawing, and the Checks of them read back.

    A body for a mould has no drawing yet: it would show the lens without it.
    """
    files, checks = dict[str, bytes](), list[Check]()
    body = Body(moulded=system.body, clear=system.clear_aperture)
    labels = Labels(system.product, system.problem.export.schema)
    with tempfile.TemporaryDirectory() as place:
        for name, chord in CHORDS.items():
            if name == DRAWING and body.is_moulded:
                continue
            written, found = export(system.designed, name[-3:], f"{place}/{name}", chord, body, labels)
            files |= {path.name: path.read_bytes() for path in written}
            checks += found
    return files, checks


def _light(
    folder: ResultFolder, system: System, rays: RaySet, metrics: Mapping[str, Any]
) -> tuple[dict[str, bytes], list[Quantity]]:
    """Return the files of the light to expect, and its numbers."""
    npz, png = (folder.path / name for name in CLAIMS[3:])
    light = read_arrays(npz, ("irradiance", "target"))
    files = {
        "irradiance.npz": npz.read_bytes(),
        "irradiance.csv": _image_text(system, light["irradiance"]),
        "irradiance.png": png.read_bytes(),
    }
    return files, light_quantities(system, rays, light, metrics)


def _image_text(system: System, light: Floats) -> bytes:
    """Return the light as CSV in the unit for people, with u above the columns and v before the rows."""
    (u, v), text = system.target.screen().centres, io.BytesIO()
    text.write(("v\\u," + ",".join(f"{x:.9g}" for x in u) + "\n").encode())
    np.savetxt(text, np.column_stack([v, system.density.factor * light]), "%.9g", delimiter=",")
    return text.getvalue()


def _zipped(files: Mapping[str, bytes]) -> bytes:
    """Return a zip of files in their order, without dates."""
    buffer = io.BytesIO()
    with ZipFile(buffer, "w") as archive:
        for name, data in files.items():
            info = ZipInfo(name, EPOCH)
            info.external_attr, info.create_system = 0o644 << 16, 3  # of a file on Unix, whoever writes it
            archive.writestr(info, data, ZIP_DEFLATED, LEVEL)
    return buffer.getvalue()
