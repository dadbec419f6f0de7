"""STEP files in other units, damaged files, and writes that fail."""

import re

import build123d
import numpy as np
import pytest
from OCP.Interface import Interface_Static

from tests.cases import DATA, python
from tests.thbcad.cases import LENSES
from thbcad import write_step
from thbcad.cad.exchange.step import read_step
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


READ = """
import sys
from thbcad.cad import read_faces, read_lens_solid, read_step
for path in sys.argv[1:]:
    for read in (read_step, read_faces, read_lens_solid):
        try:
            read(path)
        except ValueError as error:
            assert path in str(error), error
        else:
            print(read.__name__)
"""


@pytest.mark.slow
def test_values_that_are_missing_or_huge_are_refused(text, tmp_path):
    """OCCT ends the process over every one of these, so that another one reads them."""
    edits = [
        (r"(LENGTH_UNIT\(\) NAMED_UNIT\(\*\)) SI_UNIT\([^)]*\)", r"CONVERSION_BASED_UNIT() \g<1>"),
        (r"VECTOR\('',#\d+,", "VECTOR('',$,"),
        (r"VECTOR\([^)]*\)", "VECTOR()"),
        (r"(ADVANCED_FACE\('[^']*',\(#\d+\),)#\d+", r"\g<1>#1"),
        (r"(DIRECTION\('',)\([^)]*\)", r"\g<1>( )"),
        (r"(B_SPLINE_CURVE_WITH_KNOTS[^;]*),\s*\([^()]*\),\s*(\.\w+\.)\s*\)", r"\g<1>,(\n),\g<2>)"),
        (r"(DEFINITIONAL_REPRESENTATION\('',\()#\d+", r"\g<1>$"),
        (r"((?:SURFACE|SEAM)_CURVE\('',#\d+,)\([^)]*\)", r"\g<1>()"),
    ]
    texts = [(text, *edit) for edit in edits]
    texts.append(
        ((DATA / "freecad_spheres.step").read_text(), r"(CIRCLE\('',#\d+,)[\d.]+\)", r"\g<1>1.E308)")
    )
    paths = []
    for number, (whole, before, after) in enumerate(texts):
        damaged, count = re.subn(before, after, whole, count=1)
        assert count == 1, before
        paths.append(tmp_path / f"{number}.step")
        paths[-1].write_text(damaged)
    done = python(READ, *paths)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_an_exception_of_occt_is_a_value_error(text, tmp_path):
    path = tmp_path / "colour.step"
    path.write_text(re.sub(r"(COLOUR_RGB\('',)[\d.]+", r"\g<1>-1.", text))
    with pytest.raises(ValueError, match=r"is not a readable STEP file: Color"):
        read_step(path)


def test_names_that_are_missing_are_no_damage(text, tmp_path):
    path = tmp_path / "lens.step"
    nameless = re.sub(r"(VECTOR|EDGE_CURVE|ADVANCED_FACE)\('[^']*'", r"\g<1>($", text)
    path.write_text(re.sub(r"\bPRODUCT\('[^']*'", "PRODUCT('B_SPLINE_,(),1.E308'", nameless))
    assert "$" in path.read_text()
    assert "'B_SPLINE_,()" in path.read_text()
    assert read_step(path).volume == pytest.approx(LENSES["table63"].volume(), rel=1e-6)


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
