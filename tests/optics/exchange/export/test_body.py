"""`thbcad export` of every body of a lens: files pass and repeat, are sound by themselves, and refusals leave
nothing behind."""

import errno
import json
import os
import re
from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from optics.exchange.export.body import Body
from optics.exchange.export.drawing_checks import drawing_checks
from optics.exchange.export.formats import MESHES, SOLIDS, export
from tests.cases import slow_unless
from tests.optics.cases import hollow_lens, rough, small_lens, small_space
from tests.optics.exchange.export.cases import failing, names, ply_faults
from tests.optics.interface.commands.cases import refused, run
from thbcad import write_lens
from thbcad.cad.exchange import read_faces
from thbcad.drawings import DRAWINGS, drawing_bytes, lens_sheet
from thbcad.lens import Flange, placed_surfaces

EQUAL = small_lens(sag=rough(small_space()))
HOLLOW = hollow_lens(rough, rough)
LENSES = {"equal sizes": EQUAL, "Table 6.3, both free": HOLLOW}
OFTEN = ("flange and aperture", "polygon")  # bodies of the tests that are not slow
WALLED = ("aperture", "circle", "flange", *OFTEN)
FLANGE, APERTURE = ["--flange", 2.0, 0.5, 1.0], ["--aperture", 4.5, 4.0]
BODIES = {
    "solid": [],
    "aperture": APERTURE,
    "circle": ["--aperture", 4.0, 4.0],
    "polygon": ["--polygon", -4.0, -3.0, 0.5, -1.0, 4.0, -3.5, 0.0, 4.0],
    "flange": FLANGE,
    "flange and aperture": [*FLANGE, *APERTURE],
    "patches": ["--patches"],
}
# the front's rim of Table 6.3 reaches up to z = -2.5 mm, its rear's rim down to 5 - 6.4 = -1.4 mm; both give
# or take the sags
HOLLOW_FLANGE = ["--flange", 2.0, -2.2, -1.6]


@pytest.fixture(params=slow_unless(lambda name: LENSES[name] is not HOLLOW, LENSES))
def given(request, tmp_path):
    """Return the native file of a lens and the options of its bodies."""
    write_lens(LENSES[request.param], tmp_path / "lens.json")
    hollow = LENSES[request.param] is HOLLOW
    return SimpleNamespace(
        file=tmp_path / "lens.json", options=BODIES | ({"flange": HOLLOW_FLANGE} if hollow else {})
    )


@pytest.fixture
def native(tmp_path):
    """Return the native file of the lens of equal sizes."""
    write_lens(EQUAL, tmp_path / "lens.json")
    return tmp_path / "lens.json"


def exported_twice(capsys, lens, out, *options):
    """Export a lens twice, which gives the same bytes, and return what was printed."""
    done = run(capsys, "export", lens, "--out", out, *options)
    assert (done.code, done.err) == (0, "")
    first = out.read_bytes()
    assert run(capsys, "export", lens, "--out", out, *options).code == 0
    assert out.read_bytes() == first
    return done.out


CASES = [(word, name) for word, name in product(BODIES, SOLIDS) if word != "patches" or name == "step"]


@pytest.mark.every(9)
@pytest.mark.parametrize(("word", "name"), CASES)
def test_every_body_passes_in_every_solid_format_and_repeats(capsys, given, tmp_path, word, name):
    out = tmp_path / f"body.{name}"
    assert "FAILED" not in exported_twice(capsys, given.file, out, *given.options[word])
    stored = json.loads((tmp_path / f"body.{name}.json").read_text())
    assert stored["ok"]
    assert all(
        "read back" in check["name"] or "text of the file" in check["name"] for check in stored["checks"]
    )
    assert any(check["name"].startswith("volume against the closed form") for check in stored["checks"])
    assert names(tmp_path) == sorted([out.name, f"{out.name}.json", "lens.json"])


@pytest.mark.every(2)
@pytest.mark.parametrize("name", ["stl", "3mf", "glb"])
@pytest.mark.parametrize("word", slow_unless(OFTEN.__contains__, WALLED))
def test_meshes_of_bodies_pass_and_repeat(capsys, native, tmp_path, word, name):
    said = exported_twice(capsys, native, tmp_path / f"body.{name}", *BODIES[word], "--chord", 0.02)
    assert "mesh not watertight" in said


@pytest.mark.every(3)
@pytest.mark.parametrize("name", DRAWINGS)
@pytest.mark.parametrize("word", slow_unless(OFTEN.__contains__, WALLED))
def test_drawings_of_bodies_pass_and_repeat(capsys, native, tmp_path, word, name):
    said = exported_twice(capsys, native, tmp_path / f"body.{name}", *BODIES[word], "--chord", 0.01)
    assert "rear beyond its outline" in said


@pytest.mark.parametrize("word", ["FROM -y", "SECTION x"])
def test_a_curve_of_a_drawn_body_that_moved_shows(tmp_path, word):
    body = Body(polygon=[(-4, -3), (4, -3), (0, 3)])
    sheet = lens_sheet(EQUAL, chord=0.01, polygon=body.polygon)
    path = tmp_path / "body.svg"
    path.write_bytes(drawing_bytes(sheet, "svg"))
    assert failing(drawing_checks(EQUAL, sheet, path, "svg", body)) == []
    views = [replace(one, view=moved(one.view)) if word in one.view.title else one for one in sheet.views]
    path.write_bytes(drawing_bytes(replace(sheet, views=tuple(views)), "svg"))
    failed = failing(drawing_checks(EQUAL, sheet, path, "svg", body))
    assert any(
        name.startswith("rear " + ("in sections" if "SECTION" in word else "beyond")) for name in failed
    )


def moved(view):
    """A view whose rear lies 0.02 mm lower in z."""
    shift = -0.02 * np.array([{"z": 1, "-z": -1}.get(axis, 0) for axis in view.axes])
    curves = [replace(c, points=c.points + shift) if c.name == "rear" else c for c in view.curves]
    return replace(view, curves=tuple(curves))


@pytest.mark.parametrize("name", ["flange front +x", "flange side -y", "edge +y rear"])
def test_a_wall_that_moved_shows(tmp_path, name):
    body = Body((4.5, 4.0), Flange(2.0, 0.5, 1.0))
    mesh = body.mesh(EQUAL, 0.02, single=False)
    vertices = mesh.vertices.copy()
    moved = np.unique(mesh.triangles[mesh.faces == mesh.names.index(name)])
    vertices[moved] *= [1.02, 1.02, 1.1]
    assert "edges against the exact surfaces" in ply_faults(
        tmp_path, EQUAL, mesh, 0.02, body, vertices=vertices
    )


def test_a_wall_of_a_polygon_that_moved_shows(tmp_path):
    body = Body(polygon=[(-4, -3), (4, -3), (0, 3)])
    mesh = body.mesh(EQUAL, 0.02, single=False)
    faults = ply_faults(tmp_path, EQUAL, mesh, 0.02, body, vertices=mesh.vertices * [1, 1.02, 1])
    assert "edges against the exact surfaces" in faults


def test_a_mesh_of_a_flange_on_slanted_edges_is_refused(capsys, tmp_path):
    write_lens(HOLLOW, tmp_path / "lens.json")
    said = refused(capsys, "export", tmp_path / "lens.json", "--out", tmp_path / "body.stl", *HOLLOW_FLANGE)
    assert "the edges of a flange are meshed where front and rear have one size" in said


@pytest.mark.every(3)
@pytest.mark.parametrize("word", BODIES)
def test_the_bare_step_file_of_every_body_is_sound(capsys, given, tmp_path, word):
    out = tmp_path / "body.step"
    assert run(capsys, "export", given.file, "--out", out, *given.options[word]).code == 0
    done = run(capsys, "verify", out)
    assert (done.code, done.err) == (0, "")
    assert "unit of length" not in done.out  # which is the millimetre


@pytest.mark.every(2)
@pytest.mark.parametrize("word", slow_unless(OFTEN.__contains__, BODIES))
def test_a_bare_file_cut_off_is_refused_and_another_unit_is_named(capsys, native, tmp_path, word):
    """Without a lens at hand nobody knows the right unit: the file is sound, ten times as large."""
    out = tmp_path / "body.step"
    assert run(capsys, "export", native, "--out", out, *BODIES[word]).code == 0
    text = out.read_text()
    out.write_text(text.replace("SI_UNIT(.MILLI.,.METRE.)", "SI_UNIT(.CENTI.,.METRE.)"))
    done = run(capsys, "verify", out)
    assert done.code == 0
    assert "body.step is the centi" in done.out + done.err
    out.write_text(text[: len(text) // 2])
    assert "is not a whole STEP file" in refused(capsys, "verify", out)


@pytest.mark.every(2)
@pytest.mark.parametrize("word", slow_unless(OFTEN.__contains__, [w for w in BODIES if w != "patches"]))
def test_a_face_missing_from_a_bare_file_is_caught(capsys, native, tmp_path, word):
    out = tmp_path / "body.step"
    assert run(capsys, "export", native, "--out", out, *BODIES[word]).code == 0
    text = out.read_text()
    shell = re.search(r"CLOSED_SHELL\('',\(([^)]*)\)", text)[1]
    out.write_text(text.replace(shell, ",".join(shell.split(",")[:-1])))
    done = run(capsys, "verify", out)
    assert done.code == 4
    assert "FAILED text of the file: edges that do not border two faces" in done.out


def test_bodies_have_different_volumes():
    """pi a b / 4 h k of the rectangle is cut away; the flange adds its ring between the planes, by both our
    own closed forms."""
    flange = Flange(2.0, 0.5, 1.0)
    assert Body().volume(EQUAL) == EQUAL.volume()
    # round the rectangle of half-width 10 mm
    assert Body(flange=flange).volume(EQUAL) == pytest.approx(
        EQUAL.volume() + 0.5 * (24**2 - 20**2), rel=1e-12
    )
    cut = Body(aperture=(4.5, 4.0))
    ring = np.pi * (6.5 * 6.0 - 4.5 * 4.0) * 0.5
    assert Body((4.5, 4.0), flange).volume(EQUAL) == pytest.approx(cut.volume(EQUAL) + ring, rel=1e-12)
    assert Body(patches=True).volume(EQUAL) == EQUAL.volume()


# Separate faces


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
@pytest.mark.parametrize("name", SOLIDS)
def test_separate_faces_read_back_bit_for_bit(tmp_path, name, lens):
    files, checks = export(lens, name, str(tmp_path / f"lens.{name}"), body=Body(separate=True))
    assert [file.name for file in files] == [f"lens_front.{name}", f"lens_rear.{name}"]
    assert names(tmp_path) == [file.name for file in files]
    assert all(c.ok for c in checks)
    for file, own in zip(files, placed_surfaces(lens)):
        (read,) = read_faces(file)
        for a, b in (
            (read.coefficients, own.coefficients),
            (read.kv_u.knots, own.kv_u.knots),
            (read.kv_v.knots, own.kv_v.knots),
        ):
            np.testing.assert_array_equal(a, b)
    first = [file.read_bytes() for file in files]
    assert [
        file.read_bytes()
        for file in export(lens, name, str(tmp_path / f"lens.{name}"), body=Body(separate=True))[0]
    ] == first


# Refusals


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--aperture", 10.1, 5.0], "semi_axes must be at most the front's half-widths"),
        (["--aperture", 5.0, 10.1], "semi_axes must be at most the front's half-widths"),
        (["--aperture", "nan", 5.0], "semi_axes must be two positive numbers"),
        (["--aperture", "inf", 5.0], "semi_axes must be"),
        (["--aperture", -5.0, 5.0], "semi_axes must be two positive numbers"),
        (["--aperture", 0.0, 5.0], "semi_axes must be two positive numbers"),
        (["--flange", "nan", 1.0, 2.0], "--flange: flange width must be"),
        (["--flange", -1.0, 1.0, 2.0], "--flange: flange width must be"),
        (["--flange", 1.0, 2.0, 1.0], "--flange: flange high must be at least 1e-06 mm above flange low"),
        (["--flange", 1.0, 1.0, "inf"], "--flange: flange high must be"),
        (
            ["--flange", 1.0, 0.0, 2.0],
            "flange low must lie above the front's rim, which reaches up to z = 0 mm, got 0 mm",
        ),
        (
            ["--flange", 1.0, 1.0, 9.0],
            "flange high must lie below the rear's rim, which reaches down to z = 7",
        ),
        (
            ["--flange", 1.0, 1.0, 7.0, "--aperture", 5.0, 5.0],
            "flange high must lie below the rear's rim, which reaches down to z = 6",
        ),
        (["--patches", "--aperture", 5.0, 5.0], "exclude each other"),
        (["--patches", "--flange", 1.0, 1.0, 2.0], "exclude each other"),
        (["--patches", "--separate"], "exclude each other"),
        (["--separate", "--polygon", 0.0, 0.0, 1.0, 0.0, 0.0, 1.0], "exclude each other"),
        (["--polygon", 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, "--flange", 1.0, 1.0, 2.0], "an outline by itself"),
        (["--polygon", 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, "--aperture", 1.0, 1.0], "an outline by itself"),
        (["--polygon", 0.0, 0.0, 1.0, 0.0, 0.0], "X and Y of every corner, got 5 numbers"),
        (["--polygon", 0.0, 0.0, 2.0, 2.0, 2.0, 0.0, 0.0, 2.0], "must not touch or cross itself"),
        (["--polygon", 0.0, 0.0, 1e200, 0.0, 0.0, 1e200], "finite numbers up to 1e+06 mm"),
        (["--mount", "mount.toml", "--polygon", 0.0, 0.0, 1.0, 0.0, 0.0, 1.0], "leave out --aperture"),
        (["--aperture", 1e-7, 5.0], "semi_axes must be at least 1e-06 mm"),
        (["--polygon", 0.0, 0.0, 99.0, 0.0, 0.0, 1.0], "must lie within the front's half-widths"),
        (["--separate", "--aperture", 5.0, 5.0], "exclude each other"),
        (["--separate", "--flange", 1.0, 1.0, 2.0], "exclude each other"),
    ],
    ids=str,
)
@pytest.mark.parametrize("name", ["step", "brep"])
def test_bodies_that_cannot_be_are_refused_and_leave_no_file(capsys, native, tmp_path, name, options, words):
    assert words in refused(capsys, "export", native, "--out", tmp_path / f"body.{name}", *options)
    assert names(tmp_path) == ["lens.json"]


ALLOWED = {  # the formats of a body
    "--patches": ([], ("step",)),
    "--separate": ([], SOLIDS),
    "--aperture": ([5, 5, "--chord", 0.02], (*SOLIDS, *MESHES, *DRAWINGS)),
    "--polygon": ([0, 0, 2, 0, 0, 2, "--chord", 0.02], (*SOLIDS, *MESHES, *DRAWINGS)),
}
FORMATS = "iges", "brep", "stl", "3mf", "obj", "ply", "dat", "xyz", "x3p", "npz", "svg", "dxf"


def _often(case):
    """Whether `make test` asks for a body in a format: where it is refused, and twice where it is written."""
    body, name = case
    return name not in ALLOWED[body][1] or case in (("--aperture", "obj"), ("--polygon", "ply"))


@pytest.mark.parametrize("case", slow_unless(_often, product(ALLOWED, FORMATS)), ids=" ".join)
def test_formats_without_the_body_are_refused(capsys, native, tmp_path, case):
    (body, name), (options, allowed) = case, ALLOWED[case[0]]
    words = ["export", native, "--out", tmp_path / f"body.{name}", body, *options]
    if name in allowed:
        assert run(capsys, *words).code == 0
        return
    assert f"{', '.join(allowed)}, got {name}" in refused(capsys, *words)
    assert names(tmp_path) == ["lens.json"]


# Paths


@pytest.mark.parametrize(("options", "name"), [(["--separate"], "step"), ([], "dat")])
def test_of_two_files_none_is_left_where_one_cannot_be_written(capsys, native, tmp_path, options, name):
    (tmp_path / f"body_rear.{name}").mkdir()
    said = refused(capsys, "export", native, "--out", tmp_path / f"body.{name}", *options)
    assert f"body_rear.{name}: it is a folder" in said
    assert names(tmp_path) == [f"body_rear.{name}", "lens.json"]


@pytest.mark.parametrize(
    "options", [["--format", "dat"], ["--format", "step", "--separate"], ["--format", "npz"]], ids=str
)
def test_a_full_disk_is_one_sentence_with_the_path_and_leaves_nothing(
    capsys, native, tmp_path, monkeypatch, options
):
    genuine, written = os.fsync, []

    def full(handle):
        if written or "npz" in options:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        written.append(handle)
        genuine(handle)

    monkeypatch.setattr(os, "fsync", full)
    said = refused(capsys, "export", native, "--out", tmp_path / "body", *options)
    assert f"cannot write {tmp_path / 'body'}: No space left on device" in said
    assert names(tmp_path) == ["lens.json"]


@pytest.mark.parametrize("text", ["{}", "[]", "3", "nothing", None])
def test_a_report_replaces_nothing_but_a_report(capsys, native, tmp_path, text):
    """`--out RESULT/lens` would put its report where the lens of the result folder lies."""
    if text is not None:
        native.rename(tmp_path / "given.json")
        native.write_text(text)
    before = native.read_bytes()
    source = native if text is None else tmp_path / "given.json"
    said = refused(capsys, "export", source, "--out", tmp_path / "lens", "--format", "npz")
    assert "lens.json would be replaced, but was not written by this program" in said
    assert native.read_bytes() == before
    assert not (tmp_path / "lens").exists()


def test_a_folder_with_the_name_of_the_report_is_refused(capsys, native, tmp_path):
    (tmp_path / "body.npz.json").mkdir()
    assert "it is a folder" in refused(capsys, "export", native, "--out", tmp_path / "body.npz")
    assert names(tmp_path) == ["body.npz.json", "lens.json"]
