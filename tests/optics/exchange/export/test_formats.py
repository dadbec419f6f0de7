"""`thbcad export`: every format reads back, every damage shows, refusals leave no file."""

import json
import os
import re
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from OCP.RWStl import RWStl

from optics.exchange.export.drawing_checks import drawing_checks
from optics.exchange.export.formats import FORMATS, MESHES, export
from optics.exchange.export.height_maps import x3p_checks
from optics.exchange.export.read_back import array_checks, cloud_checks, sag_checks
from optics.exchange.export.wall_distance import edge_distance
from optics.tolerancing.metrology import read_measured
from tests.optics.cases import hollow_lens, rough, small_lens, small_space
from tests.optics.exchange.export.cases import failing, names, ply_faults
from tests.optics.interface.commands.cases import refused, run
from thbcad import THBSurface, read_lens, write_lens
from thbcad.drawings import drawing_bytes, lens_sheet
from thbcad.lens import EDGES, SIDES, FreeformSurface, Lens, tessellated

pytest.importorskip("trimesh")
pytest.importorskip("lib3mf")

CHORD = 0.02
EQUAL = small_lens(sag=rough(small_space()))
LENSES = {"equal sizes": EQUAL, "Table 6.3": hollow_lens(rough)}


@pytest.fixture
def native(tmp_path):
    write_lens(EQUAL, tmp_path / "lens.json")
    return tmp_path / "lens.json"


@pytest.mark.every(4)
@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
@pytest.mark.parametrize("name", FORMATS)
def test_every_format_passes_and_repeats(tmp_path, name, lens):
    files, checks = export(lens, name, str(tmp_path / f"lens.{name}"), CHORD)
    assert failing(checks) == []
    assert len(checks) >= 2
    assert all("read back by" in c.name for c in checks)
    first = [file.read_bytes() for file in files]
    assert files == export(lens, name, str(tmp_path / f"lens.{name}"), CHORD)[0]
    assert [file.read_bytes() for file in files] == first
    assert names(tmp_path) == sorted(file.name for file in files)


def test_the_command_prints_and_stores_what_was_found(capsys, native, tmp_path):
    done = run(capsys, "export", native, "--out", tmp_path / "lens.STL", "--chord", CHORD)
    assert done.code == 0
    lines = done.out.splitlines()
    assert lines[-1].startswith(f"wrote {tmp_path / 'lens.STL'}, ")
    assert all(line.startswith("ok ") and "STL read back by trimesh" in line for line in lines[:-1])
    stored = json.loads((tmp_path / "lens.STL.json").read_text())
    assert (stored["format"], stored["chord_mm"], stored["ok"]) == ("stl", CHORD, True)
    assert len(stored["checks"]) == len(lines) - 1


def test_json_and_a_format_that_is_not_the_suffix(capsys, native, tmp_path):
    done = run(capsys, "export", native, "--out", tmp_path / "lens.bin", "--format", "npz", "--json")
    assert (done.code, json.loads(done.out)["files"]) == (0, [str(tmp_path / "lens.bin")])
    with np.load(tmp_path / "lens.bin", allow_pickle=False) as arrays:
        assert np.array_equal(arrays["rear_coefficients"], EQUAL.graphs()[1].coefficients)
        assert float(arrays["rear_radius"]) == EQUAL.rear.conic.radius
        assert float(arrays["thickness"]) == EQUAL.thickness


def test_tables_are_one_file_per_surface(capsys, native, tmp_path):
    assert run(capsys, "export", native, "--out", tmp_path / "sag.dat").code == 0
    assert names(tmp_path) == ["lens.json", "sag.dat.json", "sag_front.dat", "sag_rear.dat"]


def test_occt_reads_the_stl_too(tmp_path):
    (path,), checks = export(EQUAL, "stl", str(tmp_path / "lens.stl"), CHORD)
    mesh = tessellated(EQUAL, CHORD, single=True)
    read = RWStl.ReadFile_s(str(path))
    assert (read.NbTriangles(), read.NbNodes()) == (len(mesh.triangles), len(mesh.vertices))
    assert all(c.ok for c in checks)


# Damage shows


@pytest.mark.parametrize(("face", "word"), [(0, "front"), (1, "rear"), (2, "edges")])
def test_a_vertex_that_moves_shows(tmp_path, face, word):
    lens = LENSES["Table 6.3"]
    mesh = tessellated(lens, CHORD)
    vertices = mesh.vertices.copy()
    own = mesh.triangles[mesh.faces == face]
    others = np.unique(mesh.triangles[mesh.faces != face])
    inner = np.setdiff1d(own, others)[7]  # a vertex of no other face
    vertices[inner] += [0, 2 * CHORD, 0] if face == EDGES[0] else [0, 0, 2 * CHORD]
    fault = f"{word} against the exact surface" + "s" * (word == "edges")
    assert ply_faults(tmp_path, lens, mesh, CHORD, vertices=vertices) == [fault]


def test_a_triangle_that_is_missing_or_turned_shows(tmp_path):
    mesh = tessellated(EQUAL, CHORD)
    missing = ply_faults(tmp_path, EQUAL, mesh, CHORD, triangles=mesh.triangles[1:], faces=mesh.faces[1:])
    assert {"triangles missing or added", "mesh not watertight"} <= set(missing)
    turned = mesh.triangles.copy()
    turned[5] = turned[5, ::-1]
    assert "mesh not consistently oriented" in ply_faults(tmp_path, EQUAL, mesh, CHORD, triangles=turned)
    inside_out = ply_faults(tmp_path, EQUAL, mesh, CHORD, triangles=mesh.triangles[:, ::-1])
    assert inside_out == ["volume against the closed form"]


def changed_line(path, number, column, change):
    lines = path.read_text().splitlines()
    words = lines[number].split()
    words[column] = f"{float(words[column]) + change:.17g}"
    lines[number] = " ".join(words)
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize(
    ("column", "change", "place"),
    [(0, 1e-9, "at"), (1, 1.0, "between"), (2, 1.0, "between"), (3, 5.0, "between")],
)
def test_a_changed_sag_or_derivative_shows(tmp_path, column, change, place):
    (_, rear), _ = export(EQUAL, "dat", str(tmp_path / "sag.dat"), 1e-3)
    changed_line(rear, 30, column, change)
    assert failing(sag_checks("rear", EQUAL.rear, rear, 1e-3)) == [f"rear sags {place} the points"]


def test_a_changed_point_or_normal_shows(tmp_path):
    (_, rear), _ = export(EQUAL, "xyz", str(tmp_path / "cloud.xyz"), 1e-3)
    changed_line(rear, 30, 2, 1e-9)
    changed_line(rear, 40, 4, 1e-9)
    assert failing(cloud_checks("rear", EQUAL.rear, EQUAL.thickness, rear)) == ["rear points", "rear normals"]


def test_a_changed_height_or_place_of_an_x3p_file_shows(tmp_path):
    """The same surface gives the same bytes, as no date stands in the file; `thbcad asbuilt` reads them."""
    (_, rear), checks = export(EQUAL, "x3p", str(tmp_path / "heights.x3p"))
    assert all(check.ok for check in checks)
    read = read_measured(rear, EQUAL.rear)
    assert (read.beside, read.missing) == (0, 0)
    assert np.abs(read.points[2] - EQUAL.rear(*read.points[:2])).max() < 1e-12
    first = rear.read_bytes()
    assert export(EQUAL, "x3p", str(rear.with_name("heights.x3p")))[0][1].read_bytes() == first
    with zipfile.ZipFile(rear) as parts:
        held = {name: parts.read(name) for name in parts.namelist()}
    for name, old, new, place in (
        ("bindata/data.bin", held["bindata/data.bin"][:8], bytes(8), "rear heights"),
        ("main.xml", b"<Increment>", b"<Increment>1", "rear places of the heights"),
    ):
        with zipfile.ZipFile(rear, "w") as parts:
            for part, content in (held | {name: held[name].replace(old, new, 1)}).items():
                parts.writestr(part, content)
        assert failing(x3p_checks("rear", EQUAL.rear, rear)) == [place]


def test_arrays_tell_a_disk_from_its_square(tmp_path):
    disk = FreeformSurface((10.0, 10.0), corners=(10.0, 10.0))
    (path,), _ = export(Lens(disk, disk, 5.0, 1.5), "npz", str(tmp_path / "disk.npz"), 1e-3)
    with np.load(path) as arrays:
        assert arrays["rear_corners"].tolist() == [10.0, 10.0]


def test_loose_faces_of_a_round_lens_are_said_to_go_on(capsys, tmp_path):
    disk = FreeformSurface((10.0, 10.0), corners=(10.0, 10.0))
    write_lens(Lens(disk, disk, 5.0, 1.5), tmp_path / "disk.json")
    done = run(capsys, "export", tmp_path / "disk.json", "--out", tmp_path / "disk.step", "--separate")
    assert "the faces go on beyond the outline of the lens" in done.out


def test_a_changed_coefficient_shows(tmp_path):
    (path,), _ = export(EQUAL, "npz", str(tmp_path / "lens.npz"), 1e-3)
    with np.load(path) as arrays:
        held = dict(arrays)
    held["rear_coefficients"][3, 4] += 1e-8
    np.savez(path, **held)
    assert failing(array_checks(EQUAL, path)) == ["rear"]


@pytest.mark.parametrize("side", SIDES, ids=lambda side: side.name)
def test_edge_distances_of_points_beside_a_ruled_edge(side):
    """Points R(u, w) moved along the normal of the ruled face lie as far from it as they were moved."""
    lens = hollow_lens()
    rng = np.random.default_rng(SIDES.index(side))
    s, w = rng.uniform(-0.9, 0.9, 200), rng.uniform(0.1, 0.9, 200)[:, None]
    axis, sign = side.axis == 1, 1 if side.end else -1
    rims, slopes = [], []
    for surface, vertex in ((lens.front, 0.0), (lens.rear, lens.thickness)):
        places = [s * surface.half_width[0], np.full_like(s, sign * surface.half_width[1])][
            :: -1 if axis else 1
        ]
        order = (0, 1) if axis else (1, 0)
        rims.append(np.column_stack([*places, vertex + surface(*places)]))
        along = np.eye(3)[int(axis)] + np.outer(surface(*places, order), [0, 0, 1])
        slopes.append(surface.half_width[0] * along)
    along, across = (1 - w) * slopes[0] + w * slopes[1], rims[1] - rims[0]
    normals = np.cross(along, across)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = (1 - w) * rims[0] + w * rims[1]
    assert edge_distance(lens, side, points) < 1e-13
    assert edge_distance(lens, side, points + 1e-3 * normals) == pytest.approx(1e-3, rel=1e-9)


@pytest.mark.parametrize("name", ["svg", "dxf"])
def test_a_drawing_of_another_lens_or_with_a_curve_less_shows(tmp_path, name):
    path = tmp_path / f"lens.{name}"
    export(EQUAL, name, str(path), CHORD)
    sheet = lens_sheet(EQUAL, chord=CHORD)
    rear = EQUAL.rear
    thicker = rear.with_sag(THBSurface(rear.sag.space, rear.sag.coefficients + 2 * CHORD))
    assert failing(drawing_checks(EQUAL.with_rear(thicker), sheet, path, name)) == [
        "rear in sections",
        "rear beyond its outline",
    ]
    less = replace(sheet, views=sheet.views[1:])
    path.write_bytes(drawing_bytes(less, name))
    assert failing(drawing_checks(EQUAL, sheet, path, name)) == ["curves missing or added"]


# Refusals


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--out", "lens.foo"], "the suffix of .*lens.foo is unknown; choose --format from step, iges"),
        (["--out", "lens.tm25ray"], "for light take --light rear with .tm25ray"),
        (["--out", "lens"], "for a scene of Mitsuba one that ends in .xml"),
        (["--out", "lens.stl", "--format", "amf"], "the format 'amf' is unknown"),
        (["--out", "lens.step", "--format", "stl"], "lens.step would hold stl, but its suffix promises step"),
        (["--out", "lens.STL", "--format", "brep"], "lens.STL would hold brep, but its suffix promises stl"),
        (["--out", "none/lens.stl"], "cannot write .*lens.stl: there is no folder"),
        (["--out", "folder.stl"], "cannot write .*folder.stl: it is a folder"),
        (["--out", "pipe.stl"], "cannot write .*pipe.stl: it is a device or a pipe"),
        (["--out", "lens.stl", "--chord", "1e-7"], "cannot export .*lens.stl: chord must be at least"),
        (
            ["--out", "lens.ply", "--chord", "1e-8"],
            "cannot export .*lens.ply: a chord error of 1e-08 mm needs",
        ),
        (["--out", "lens.obj", "--chord", "nan"], "cannot export .*lens.obj: chord must be a finite number"),
    ],
)
def test_refusals_are_one_sentence_and_leave_no_file(capsys, native, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.stl").mkdir()
    os.mkfifo(tmp_path / "pipe.stl")
    before = names(tmp_path)
    assert re.search(words, refused(capsys, "export", native, *arguments))
    assert names(tmp_path) == before


@pytest.mark.parametrize("result", ["none", "lens.txt"])
def test_what_is_no_lens_is_refused(capsys, tmp_path, result):
    (tmp_path / "lens.txt").write_text("nothing")
    assert str(tmp_path / result) in refused(
        capsys, "export", tmp_path / result, "--out", tmp_path / "lens.stl"
    )
    assert names(tmp_path) == ["lens.txt"]


def test_an_old_file_survives_a_failure(capsys, native, tmp_path):
    (tmp_path / "lens.stl").write_bytes(b"old")
    assert run(capsys, "export", native, "--out", tmp_path / "lens.stl", "--chord", "1e-7").code == 2
    assert (tmp_path / "lens.stl").read_bytes() == b"old"


def test_a_failed_check_is_exit_code_1(capsys, native, tmp_path, monkeypatch):
    write, single = MESHES["ply"]
    monkeypatch.setitem(
        MESHES,
        "ply",
        (lambda mesh: write(type(mesh)(mesh.vertices + 0.1, mesh.triangles, mesh.faces, 0.0)), single),
    )
    done = run(capsys, "export", native, "--out", tmp_path / "lens.ply", "--chord", CHORD)
    assert done.code == 4
    assert "FAILED rear against the exact surface, PLY read back by trimesh" in done.out
    assert read_lens(native).thickness == EQUAL.thickness
    assert not json.loads((tmp_path / "lens.ply.json").read_text())["ok"]
