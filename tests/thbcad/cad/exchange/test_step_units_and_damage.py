"""STEP files in other units, damaged files, and writes that fail."""

import re

import build123d
import numpy as np
import pytest
from OCP.Interface import Interface_Static

from tests.thbcad.cases import LENSES
from thbcad.cad.exchange.step import read_step, write_step
from thbcad.lens import optical_forms

# ---- units and damaged files ----


def test_lengths_are_converted_to_millimetres(text, tmp_path):
    path = tmp_path / "metres.step"
    metres = text.replace("SI_UNIT(.MILLI.,.METRE.)", "SI_UNIT($,.METRE.)")
    assert metres != text
    path.write_text(metres)
    read = read_step(path)
    front, rear = optical_forms(LENSES["table63"])
    assert np.allclose(read.front.coefficients, 1000 * front.coefficients, rtol=1e-15, atol=0)
    assert np.allclose(read.rear.coefficients, 1000 * rear.coefficients, rtol=1e-15, atol=0)
    assert read.volume == pytest.approx(1e9 * LENSES["table63"].volume(), rel=1e-6)


def test_settings_of_other_programs_do_not_change_what_is_read(text, tmp_path, occt_settings):
    path = tmp_path / "lens.step"
    path.write_text(text)
    Interface_Static.SetCVal_s("xstep.cascade.unit", "M")
    assert read_step(path).volume == pytest.approx(LENSES["table63"].volume(), rel=1e-6)


@pytest.mark.parametrize("share", [0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.999])
def test_truncated_files_are_refused(text, tmp_path, share):
    path = tmp_path / "short.step"
    path.write_text(text[: int(share * len(text))])
    with pytest.raises(ValueError, match=re.escape(f"{path} is not a readable STEP file")):
        read_step(path)


@pytest.mark.parametrize(
    "data", [b"", b"hello\n", b"\x00\xff" * 500, b"ISO-10303-21;\n", b'{"schema": "thbcad-lens"}']
)
def test_files_that_are_no_step_are_refused(data, tmp_path):
    path = tmp_path / "other.step"
    path.write_bytes(data)
    with pytest.raises(ValueError, match="is not a readable STEP file"):
        read_step(path)


def test_missing_files_are_os_errors(tmp_path):
    for path in (tmp_path / "none.step", tmp_path):
        with pytest.raises(OSError, match=re.escape(str(path))):
            read_step(path)


def without_face(text, number):
    """Return the file with one face taken out of the shell: 0 front, 1 rear, 2 to 5 the edges."""
    shell = re.search(r"CLOSED_SHELL\('',\(([^)]*)\)", text)
    faces = shell.group(1).split(",")
    assert len(faces) == 6
    return text.replace(shell.group(1), ",".join(faces[:number] + faces[number + 1 :]))


@pytest.mark.parametrize("number", [0, 1])
def test_a_missing_optical_face_is_refused(text, tmp_path, number):
    path = tmp_path / "open.step"
    path.write_text(without_face(text, number))
    with pytest.raises(ValueError, match="holds 1 optical faces where a lens has 2"):
        read_step(path)


@pytest.mark.parametrize("number", [2, 3, 4, 5])
def test_a_missing_edge_face_is_reported(text, tmp_path, number):
    """OCCT calls the open shell valid: the counts tell."""
    path = tmp_path / "open.step"
    path.write_text(without_face(text, number))
    read = read_step(path)
    assert (read.faces, read.free_edges, read.closed, read.solids) == (5, 4, False, 0)


def test_other_solids_are_refused(tmp_path):
    path = tmp_path / "ring.step"
    build123d.export_step(build123d.Torus(3, 1), path)
    with pytest.raises(ValueError, match="holds 0 optical faces where a lens has 2"):
        read_step(path)


# ---- writing ----


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "lens.step"
    path.write_text("old")

    def fail(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", fail)
    with pytest.raises(OSError, match="No space left"):
        write_step(LENSES["plano"], path)
    monkeypatch.undo()
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("lens.step", "old")]


def test_a_missing_folder_is_an_os_error(tmp_path):
    with pytest.raises(FileNotFoundError):
        write_step(LENSES["plano"], tmp_path / "nowhere" / "lens.step")
