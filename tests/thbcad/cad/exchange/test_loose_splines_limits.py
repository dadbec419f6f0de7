"""Loose faces that are refused, and faces at the ends of their range."""

import re

import numpy as np
import pytest

from tests.thbcad.cad.exchange.cases import CUBIC, SURFACES, WAVE, assert_same
from thbcad.cad.exchange.loose_splines import read_faces, write_faces
from thbcad.splines import BSplineSurface, KnotVector, NURBSSurface

# ---- refused ----


@pytest.mark.parametrize("share", [0, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.999])
def test_truncated_files_are_refused(kind, share, tmp_path):
    path = tmp_path / f"short{kind}"
    write_faces([WAVE, SURFACES["torus"]], path)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(
        ValueError,
        match=re.escape(f"{path} is not a readable {kind[1:].upper().replace('IGS', 'IGES')} file"),
    ):
        read_faces(path)


@pytest.mark.parametrize("cut", [2, 3, 4, 5, 6, 8])
def test_a_brep_without_its_last_reference_is_refused(cut, tmp_path):
    """The last line names the shape that the file is about; the table above it is whole."""
    path = tmp_path / "short.brep"
    write_faces([WAVE], path)
    path.write_bytes(path.read_bytes().rstrip()[:-cut])
    with pytest.raises(ValueError, match=re.escape(f"{path} is not a readable BREP file")):
        read_faces(path)


@pytest.mark.parametrize(
    "data", [b"", b"hello\n", b"\x00\xff" * 500, b"ISO-10303-21;\n", b"CASCADE Topology V1\nTShapes 0\n"]
)
def test_other_files_are_refused(kind, data, tmp_path):
    path = tmp_path / f"other{kind}"
    path.write_bytes(data)
    with pytest.raises(ValueError, match="is not a readable"):
        read_faces(path)


def test_missing_files_are_os_errors(kind, tmp_path):
    with pytest.raises(FileNotFoundError):
        read_faces(tmp_path / f"none{kind}")
    with pytest.raises(FileNotFoundError):
        write_faces([WAVE], tmp_path / "nowhere" / f"a{kind}")


@pytest.mark.parametrize("call", [read_faces, lambda path: write_faces([WAVE], path)])
def test_other_suffixes_are_refused(call, tmp_path):
    path = tmp_path / "a.stl"
    with pytest.raises(ValueError, match=re.escape(f"{path} must end in .step, .stp, .iges, .igs or .brep")):
        call(path)


def test_surfaces_are_refused(tmp_path):
    with pytest.raises(ValueError, match="at least one surface"):
        write_faces([], tmp_path / "a.step")
    plane = NURBSSurface(CUBIC, CUBIC, WAVE.coefficients[..., :2])
    with pytest.raises(
        ValueError, match=r"surfaces\[1\] must have points \(x, y, z\), got a net of shape \(6, 6, 2\)"
    ):
        write_faces([WAVE, plane], tmp_path / "a.step")
    small = NURBSSurface(CUBIC, CUBIC, WAVE.coefficients, np.where(np.arange(36).reshape(6, 6), 1.0, 1e-10))
    with pytest.raises(
        ValueError, match=r"surfaces\[0\] must have weights of at least 1e-09 in IGES, got 1e-10"
    ):
        write_faces([small], tmp_path / "a.igs")
    write_faces([small], tmp_path / "a.step")
    assert_same(read_faces(tmp_path / "a.step"), [small])


def test_knots_too_near_for_occt_are_refused(kind, tmp_path):
    near = KnotVector(1, [0.0, 0.0, 1.0, np.nextafter(1.0, 2.0), 2.0, 2.0])
    with pytest.raises(RuntimeError, match=r"OCCT could not make a face of surfaces\[1\]: .*[Kk]nots"):
        write_faces(
            [WAVE, BSplineSurface(near, near, np.arange(48.0).reshape(4, 4, 3))], tmp_path / f"a{kind}"
        )
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_the_old_file(kind, tmp_path, monkeypatch):
    path = tmp_path / f"a{kind}"
    path.write_text("old")

    def fail(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", fail)
    with pytest.raises(OSError, match="No space left"):
        write_faces([WAVE], path)
    monkeypatch.undo()
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [(path.name, "old")]


# ---- short spans, small faces, damaged shapes ----


def flat(kv_u, kv_v, size_u=1.0, size_v=1.0):
    i, j = np.indices((kv_u.dim, kv_v.dim))
    return BSplineSurface(kv_u, kv_v, np.stack([size_u * i, size_v * j, 0 * i], axis=-1))


@pytest.mark.parametrize("length", [1e-9, 1e-10, 1e-13])
def test_short_spans_read_back(kind, length, tmp_path):
    surface = flat(KnotVector(3, [0] * 4 + [length] + [1] * 4), CUBIC)
    write_faces([surface], tmp_path / f"short{kind}")
    assert_same(read_faces(tmp_path / f"short{kind}"), [surface])


@pytest.mark.parametrize("size", [1.0, 0.1])
def test_small_faces_are_kept_or_refused(kind, size, tmp_path):
    """The diagonal of the box is sqrt(2) and sqrt(0.02) times 1e-6 mm."""
    surface, path = flat(CUBIC, CUBIC, size * 2e-7, size * 2e-7), tmp_path / f"small{kind}"
    if size == 1 or kind == ".brep":
        write_faces([surface], path)
        assert_same(read_faces(path), [surface])
    else:
        with pytest.raises(
            ValueError, match=r"surfaces\[1\] is 1.4e-07 mm large, below the 1e-06 mm that STEP and IGES keep"
        ):
            write_faces([WAVE, surface], path)
        assert not path.exists()


def test_a_brep_of_shapes_that_do_not_fit_is_refused(tmp_path):
    """A wire made a shell: OCCT cannot put edges into it."""
    path = tmp_path / "wave.brep"
    write_faces([WAVE], path)
    path.write_bytes(path.read_bytes().replace(b"\nWi\n", b"\nSh\n"))
    with pytest.raises(ValueError, match=r"wave.brep is not readable: TopoDS_Builder::Add"):
        read_faces(path)


@pytest.mark.parametrize(
    ("surfaces", "message"),
    [
        (None, r"surfaces\[0\] must be a THBSurface or BSplineSurface or NURBSSurface, got NoneType"),
        ([WAVE, 5], r"surfaces\[1\] must be a THBSurface or BSplineSurface or NURBSSurface, got int"),
    ],
)
def test_what_is_no_surface_is_refused(surfaces, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        write_faces(surfaces, tmp_path / "a.step")
