"""Sheets: SVG and DXF in mm with the bound and the dimensions of the lens, the same bytes every time."""

import os
import subprocess
import sys
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pytest

from tests.cases import ROOT
from tests.thbcad.drawings.cases import LENSES, PLAIN, WAVY, WIDER
from thbcad import Product, write_drawing
from thbcad.drawings import Style, drawing_bytes, lens_sheet, section_view
from thbcad.drawings.annotations import hatching, rounded_up


def texts(sheet):
    return [label.text for label in sheet.labels]


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_everything_stands_on_the_paper(lens):
    sheet = lens_sheet(lens)
    marks = [stroke.points for stroke in sheet.strokes]
    marks += [one.origin + sheet.scale * one.view.box() for one in sheet.views]
    marks += [np.array([label.position]) for label in sheet.labels]
    points = np.concatenate(marks)
    assert (points >= [20, 10]).all()
    assert (points <= [410, 287]).all()
    frames = [one.origin + sheet.scale * one.view.box() for one in sheet.views]
    for k, (low, high) in enumerate(frames):
        assert not any((low < b).all() and (a < high).all() for a, b in frames[k + 1 :])


def test_the_sheet_says_what_the_lens_measures():
    sheet = lens_sheet(WIDER, Product("lamp lens", author="A. Abbe", material="PMMA", density=1.19))
    said = texts(sheet)
    middle = 5.0 + WIDER.rear(0, 0) - WIDER.front(0, 0)
    edge = 5.0 + WIDER.rear(0, 7) - WIDER.front(0, 4)
    assert {"16", "14", "10", "8", f"{middle:.4f}".rstrip("0"), f"{edge:.4f}".rstrip("0")} <= set(said)
    x, y = (np.linspace(-h, h, 401) for h in WIDER.rear.half_width)
    low = WIDER.front.grid(x[abs(x) <= 5], y[abs(y) <= 4]).min()
    assert float(said[-1]) == pytest.approx(5.0 + WIDER.rear.grid(x, y).max() - low, abs=2e-4)
    assert {"lamp lens", "PMMA", "n = 1.5", "density 1.19 g/cm3", "A. Abbe"} <= set(said)
    assert {"base R 30 mm, K -1", "base R -40 mm, K -1", "size 16 x 14 mm"} <= set(said)
    assert f"curves within {rounded_up(sheet.bound)} mm of the lens" in said
    assert float(rounded_up(sheet.bound)) >= sheet.bound
    assert sheet.scale == 5
    assert "scale 5:1    lengths in mm    A3" in said


def test_an_svg_is_in_millimetres_and_a_dxf_passes_the_audit_at_true_size(tmp_path):
    for name in ("svg", "dxf"):
        write_drawing(WAVY, tmp_path / f"lens.{name}")
    root = ElementTree.parse(tmp_path / "lens.svg").getroot()
    assert (root.attrib["width"], root.attrib["viewBox"]) == ("420mm", "0 0 420 297")
    document = ezdxf.readfile(tmp_path / "lens.dxf")
    audit = document.audit()
    assert (audit.errors, audit.fixes, document.units) == ([], [], ezdxf.units.MM)
    assert {style.value for style in Style} <= {layer.dxf.name for layer in document.layers}
    (section,) = (
        e
        for e in document.modelspace().query("LWPOLYLINE")
        if e.has_xdata("THBCAD") and [t.value for t in e.get_xdata("THBCAD")][:2] == ["SECTION x = 0", "rear"]
    )
    points = np.array(section.get_points("xy"))
    (exact,) = (c.points for c in section_view(WAVY, "x").curves if c.name == "rear")
    assert np.ptp(points, axis=0) == pytest.approx(np.ptp(exact, axis=0), abs=1e-12)


@pytest.mark.parametrize("name", ["svg", "dxf"])
def test_the_same_lens_gives_the_same_bytes(name):
    assert drawing_bytes(lens_sheet(PLAIN), name) == drawing_bytes(lens_sheet(PLAIN), name)


@pytest.mark.slow
def test_another_process_gives_the_same_dxf():
    """Whatever the order of its sets: of the seeds 0 and 4, ezdxf makes two orders of classes."""
    program = (
        "import sys; from thbcad.drawings import drawing_bytes, lens_sheet; "
        "from tests.thbcad.drawings.cases import PLAIN; "
        "sys.stdout.buffer.write(drawing_bytes(lens_sheet(PLAIN), 'dxf'))"
    )
    first, second = (
        subprocess.run(
            [sys.executable, "-c", program],
            cwd=ROOT,
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            check=True,
        ).stdout
        for seed in ("0", "4")
    )
    assert first == second != b""


def test_names_are_text_and_not_markup(tmp_path):
    write_drawing(PLAIN, tmp_path / "lens.svg", Product('a < b & "c"'))
    assert ElementTree.parse(tmp_path / "lens.svg").getroot()[0].text == 'a < b & "c"'


def test_hatching_lies_inside_a_polygon_that_is_not_convex():
    """The lines of a U, 10 wide, 8 high, with a slot of 4 x 6: their length is area over spacing."""
    u = np.array([(0, 0), (10, 0), (10, 8), (7, 8), (7, 2), (3, 2), (3, 8), (0, 8)], dtype=float) * 20
    lines = [stroke.points for stroke in hatching(u)]
    length = sum(np.linalg.norm(line[1] - line[0]) for line in lines)
    assert length == pytest.approx((80 - 24) * 400 / 3.0, rel=0.02)
    middles = np.array([line.mean(axis=0) for line in lines])
    slot = (middles > [60, 40]).all(axis=1) & (middles < [140, 160]).all(axis=1)
    assert not slot.any()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: write_drawing(PLAIN, "lens.pdf"), "lens.pdf must end in .svg or .dxf"),
        (lambda: lens_sheet("lens"), "lens must be a Lens, got str"),
        (lambda: lens_sheet(PLAIN, "name"), "product must be a Product, got str"),
        (lambda: drawing_bytes(lens_sheet(PLAIN), "pdf"), "a drawing is an svg or a dxf file, got 'pdf'"),
    ],
)
def test_refusals(call, words):
    with pytest.raises(ValueError, match=words):
        call()
