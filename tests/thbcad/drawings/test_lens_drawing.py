"""Sheets: SVG and DXF in mm with bound, dimensions, panels, and views in third-angle projection."""

import os
import subprocess
import sys
from dataclasses import replace
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pytest

from tests.cases import ROOT
from tests.thbcad.drawings.cases import BALL, LENSES, PLAIN, WAVY, WIDER
from thbcad import Product, write_drawing
from thbcad.drawings import Grid, Panel, drawing_bytes, lens_sheet, section_view
from thbcad.drawings.annotations import hatching, rounded_up
from thbcad.drawings.curves import Style
from thbcad.lens import Flange
from thbcad.outlines import Outline


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
    assert {"16", "14", "10", "8", f"{edge:.4f}".rstrip("0")} <= set(said)
    # the distance of the vertices of the base surfaces is none of the part, where a sag moves them
    assert said.count(f"{middle:.4f}".rstrip("0")) == 1
    assert not any("apart" in text for text in said)
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


X = np.linspace(-1, 1, 5)


def panel(rows, clear):
    grid = Grid("sag, mm", X, 2 * X, np.outer(X, X) - 4e-5)
    return Panel("Indications", rows, (grid, grid), ("nothing is claimed",), clear)


@pytest.mark.parametrize("count", [3, 40])
def test_a_panel_stands_right_of_the_drawing_and_leaves_it_as_it_is(count):
    round_ = Outline.ellipse((2.0, 1.5))
    rows = tuple((f"name.{k}", "a text that is longer than one line " * 4, "open") for k in range(count))
    plain, wide = lens_sheet(PLAIN), lens_sheet(PLAIN, panel=panel(rows, (round_, round_)))
    assert wide.size == (594.0, 297.0)
    assert wide.scale == plain.scale
    own = {label for label in wide.labels if label.position[0] > 410}
    assert {label.text for label in wide.labels if label not in own} == {
        label.text.replace("A3", "A3.2") for label in plain.labels
    }
    assert all(10 < label.position[1] < 287 for label in own)
    for label in own:
        ends = label.position[0] + label.length * np.array([0, 1] if label.anchor == "start" else [-1, 0])
        assert (ends > 410).all()
        assert (ends < 584).all()
    names = sorted(label.position[1] for label in own if label.text.startswith("name."))
    assert len(names) == count
    assert np.diff(names).min() > 1.5 * next(iter(own)).height or count == 3
    assert {label.text for label in own} >= {"open", "1.0000", "0.2500", "0.0000", "nothing is claimed"}


def test_heights_have_no_negative_zero():
    outline = Outline((1.0, 1.0))
    texts = [label.text for label in lens_sheet(PLAIN, panel=panel((), (outline, outline))).labels]
    assert "-0.0000" not in texts
    assert texts.count("0.0000") == 18


def test_clear_apertures_stand_in_the_plans():
    front, rear = Outline((2.0, 1.0), (0.5, 0.5)), Outline.ellipse((3.0, 3.0))
    sheet, plain = lens_sheet(BALL, panel=panel((), (front, rear))), lens_sheet(BALL)
    old = {stroke.points.tobytes() for stroke in plain.strokes}
    rings = [s.points for s in sheet.strokes if s.style is Style.CENTRE and s.points.tobytes() not in old]
    for ring, one, outline in zip(rings, (sheet.views[0], sheet.views[3]), (front, rear), strict=True):
        points = (ring - one.origin) / sheet.scale
        np.testing.assert_allclose(outline.gauge(*points.T), 1, atol=1e-9)
        np.testing.assert_allclose(np.ptp(points, axis=0), 2 * np.array(outline.half_width), atol=2e-3)


POLYGON = [(-4, -3), (4, -2.5), (3, 3), (-3.5, 2)]  # no corner is the image of another one
# where each view is looked from, the one that it is projected from, and on which side of that it stands
SIGHTS = {
    "SEEN FROM THE FRONT": ((0, 0, 1), None, None),
    "SEEN FROM -x": ((1, 0, 0), "SEEN FROM THE FRONT", (1, 0)),
    "SEEN FROM -y": ((0, 1, 0), "SEEN FROM THE FRONT", (0, -1)),
    "SEEN FROM THE REAR": ((0, 0, -1), None, None),
    "SECTION x": ((1, 0, 0), "SEEN FROM THE REAR", (-1, 0)),
    "SECTION y": ((0, 1, 0), "SEEN FROM THE REAR", (0, -1)),
}
AXIS = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}


def placed_views(sheet):
    return {one.view.title.partition(" =")[0]: one for one in sheet.views}


def directions(one):
    """Return which way a view has to its right and upwards, (2, 3)."""
    return np.array([np.multiply(AXIS[a[-1]], -1 if a[0] == "-" else 1) for a in one.view.axes])


@pytest.mark.every(3)
@pytest.mark.parametrize(
    "body", [{}, {"polygon": POLYGON}, {"aperture": (3, 2)}], ids=["whole", "cut", "round"]
)
@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_views_are_those_of_an_unfolded_glass_box(lens, body):
    """Right x up is towards the viewer; the paper's way from a view to its neighbour is, in the view, away
    from where the neighbour's viewer stands, and the directions along the fold agree."""
    views = placed_views(lens_sheet(lens, **body))
    assert views.keys() == SIGHTS.keys()
    for title, (sight, other, way) in SIGHTS.items():
        right, up = directions(views[title])
        np.testing.assert_array_equal(np.cross(right, up), np.negative(sight))
        if other is None:
            continue
        fold = views[other]
        # the neighbour shows the viewer's side nearest to this view
        np.testing.assert_array_equal(np.array(way) @ directions(fold), np.negative(sight))
        # and this view shows the neighbour's viewer's side nearest to the neighbour
        np.testing.assert_array_equal(
            np.negative(way) @ directions(views[title]), np.negative(SIGHTS[other][0])
        )
        along = 0 if way[0] == 0 else 1
        np.testing.assert_array_equal(directions(fold)[along], directions(views[title])[along])
        assert fold.origin[along] == views[title].origin[along]
        step = views[title].origin[1 - along] - fold.origin[1 - along]
        assert np.sign(step) == way[1 - along]


@pytest.mark.parametrize("lens", [PLAIN, WIDER, BALL])
def test_every_corner_lies_in_each_view_where_its_projection_is(lens):
    """A corner (x, y) of the front view lies at the page offset -x in it and below it, at y in it and beside
    it; the edge there runs from front to rear: below downwards, beside to the right."""
    sheet = lens_sheet(lens, polygon=POLYGON)
    views = placed_views(sheet)
    front, beside, below = (views[k] for k in ("SEEN FROM THE FRONT", "SEEN FROM -x", "SEEN FROM -y"))
    (outline,) = (c.points for c in front.view.curves)
    corners = np.array(POLYGON, dtype=float)
    on_page = front.origin + sheet.scale * corners * [-1, 1]
    drawn = front.origin + sheet.scale * outline[:-1]
    assert sorted(map(tuple, drawn.tolist())) == sorted(map(tuple, on_page.tolist()))
    for one, axis, ends in ((below, 0, (1, -1)), (beside, 1, (0, 1))):
        level, sign = ends
        edges = [one.origin + sheet.scale * c.points for c in one.view.curves if c.name == "edge"]
        assert len(edges) == len(corners)
        for (x, y), place in zip(POLYGON, on_page):
            (edge,) = (e for e in edges if abs(e[0, axis] - place[axis]) < 1e-9)
            z = [float(lens.front(x, y)), lens.thickness + float(lens.rear(x, y))]
            wanted = one.origin[level] + sign * sheet.scale * np.array(z)
            np.testing.assert_allclose(np.sort(edge[:, level]), np.sort(wanted), atol=1e-9)


@pytest.mark.parametrize("flange", [None, Flange(2.0, 0.5, 1.0)], ids=["bare", "with a flange"])
@pytest.mark.parametrize("lens", [PLAIN, WAVY, WIDER])
def test_a_cut_lens_has_its_thickness_over_all(lens, flange):
    """In the view from the side, against points all over it."""
    sheet = lens_sheet(lens, aperture=(3.5, 3.0), flange=flange)
    rho, turn = np.meshgrid(np.linspace(0, 1, 101), np.linspace(0, 2 * np.pi, 721))
    x, y = 3.5 * rho * np.cos(turn), 3.0 * rho * np.sin(turn)
    wanted = lens.thickness + lens.rear(x, y).max() - lens.front(x, y).min()
    numbers = [float(text) for text in texts(sheet) if text.replace(".", "").isdigit()]
    assert min(abs(n - wanted) for n in numbers) <= sheet.bound + 1e-4


def test_the_blank_of_a_mirror_has_no_index():
    assert not [text for text in texts(lens_sheet(replace(PLAIN, index=1.0))) if text.startswith("n =")]
