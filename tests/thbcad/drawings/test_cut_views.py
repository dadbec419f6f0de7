"""Views of lenses that are cut to an outline or have a flange: within their bound of brute force, and as
trimesh cuts the same body."""

import numpy as np
import pytest

from tests.thbcad.drawings.cases import BALL, PLAIN, WAVY, WIDER, assert_section_area, height_line
from thbcad import Product, body_mesh, to_trimesh
from thbcad.drawings import drawing_bytes, lens_sheet
from thbcad.drawings.curves import Style
from thbcad.drawings.cut_outlines import cut_lens, intervals
from thbcad.drawings.cut_views import cut_plan, cut_section, cut_side
from thbcad.lens import Flange

CHORD = 2e-3
SAMPLED = 1e-3  # mm: of points 0.025 mm apart where |z_uu| is below 10 / mm
FLANGE = Flange(2.0, 0.5, 1.0)
TURN = np.linspace(0, 2 * np.pi, 40, endpoint=False)
BODIES = {
    "round": {"aperture": (3.5, 3.5)},
    "wide": {"aperture": (4.9, 2.0)},
    "round with a flange": {"aperture": (3.5, 3.5), "flange": FLANGE},
    "flange": {"flange": FLANGE},
    "triangle": {"polygon": [(-3, -3), (3, -2.5), (0.5, 3)]},
    "U": {"polygon": [(-4, -3), (4, -3), (4, 3), (2, 3), (2, 0), (-2, 0), (-2, 3), (-4, 3)]},
    "star": {"polygon": np.c_[np.cos(TURN), np.sin(TURN)] * (2.5 + 1.2 * np.cos(10 * TURN)[:, None])},
    "beside the axis": {"polygon": [(1, 1), (4, 1), (2, 3)]},
}
CASES = [(WAVY, body) for body in BODIES.values()]
CASES += [(PLAIN, BODIES["flange"]), (WIDER, BODIES["wide"]), (WIDER, BODIES["U"]), (BALL, BODIES["star"])]

SLOW = pytest.mark.slow
TURNED = [  # every case in both directions, in one of them often
    pytest.param(*case, axis, marks=() if axis == k % 2 else SLOW)
    for k, case in enumerate(CASES)
    for axis in (0, 1)
]


def cut_of(lens, body):
    return cut_lens(lens, body.get("aperture"), body.get("flange"), body.get("polygon"))


def least_height(cut, face, along, v, sign):
    """The least sign z of a face on lines of sight at v, of 401 points in every interval."""
    surface, vertex = ((cut.lens.front, 0.0), (cut.lens.rear, cut.lens.thickness))[face]
    low, high = v.min(), v.max()
    least = []
    for position in np.clip(v, low + 1e-12, high - 1e-12).tolist():
        u = np.concatenate([np.linspace(a, b, 401) for a, b in intervals(cut.shape, 1 - along, position)])
        x, y = (u, np.full(len(u), position))[:: 1 if along == 0 else -1]
        x, y = (np.clip(p, -h, h) for p, h in zip((x, y), surface.half_width))
        least.append((sign * (vertex + surface(x, y))).min())
    return np.array(least)


@pytest.mark.every(3)
@pytest.mark.parametrize(("lens", "body", "along"), TURNED)
def test_silhouettes_lie_within_their_bound_of_brute_force(lens, body, along):
    """A chord may be beside the silhouette by the bound in any direction, where it is steep."""
    cut = cut_of(lens, body)
    view = cut_side(cut, along, CHORD)
    assert view.bound <= CHORD
    for face, name in enumerate(("front", "rear")):
        sign = (1, -1)[face]
        lines = [height_line(view, c.points) for c in view.curves if c.name == name]
        v = np.unique(np.concatenate([line[:, 0] for line in lines]))
        v = v[:: max(1, len(v) // 25)]
        v = np.sort(np.concatenate([v, v[:-1] + np.diff(v) * 0.4]))
        reached = [np.interp(v, p[:, 0], sign * p[:, 1], left=np.inf, right=np.inf) for p in lines]
        drawn = np.min(reached, axis=0)
        ends = v[0] + view.bound, v[-1] - view.bound
        shifted = [np.clip(v + d, *ends) for d in (-view.bound, 0.0, view.bound)]
        exact = [least_height(cut, face, along, each, sign) for each in shifted]
        inner = (v > ends[0]) & (v < ends[1])
        assert (drawn >= np.min(exact, axis=0) - view.bound - SAMPLED)[inner].all()
        assert (drawn <= np.max(exact, axis=0) + view.bound)[inner].all()


@pytest.mark.every(3)
@pytest.mark.parametrize(("lens", "body", "across"), TURNED)
def test_a_section_has_the_area_that_trimesh_cuts(lens, body, across):
    cut = cut_of(lens, body)
    view = cut_section(cut, across, cut.planes[across], CHORD)
    assert view.bound <= CHORD
    lines = []
    for k in range(0, len(view.curves), 4):
        front, rear, start, stop = (curve.points for curve in view.curves[k : k + 4])
        assert (front[[0, -1]] == [start[0], stop[0]]).all()
        assert (rear[[0, -1]] == [start[-1], stop[-1]]).all()
        lines.append(np.concatenate([front, stop, rear[::-1], start[::-1]]))
    mesh = to_trimesh(body_mesh(lens, CHORD, **body))
    assert_section_area(lines, mesh, across, cut.planes[across], 2 * CHORD)


@pytest.mark.every(4)
@pytest.mark.parametrize(("lens", "body"), CASES)
def test_a_side_view_is_as_large_as_the_mesh(lens, body):
    low, high = to_trimesh(body_mesh(lens, CHORD, **body)).bounds
    for along in (0, 1):
        view = cut_side(cut_of(lens, body), along, CHORD)
        box = np.sort(height_line(view, view.box()), axis=0)
        assert box == pytest.approx(np.array([low, high])[:, [1 - along, 2]], abs=2 * CHORD)


def test_a_plan_shows_the_outline_and_the_flange_mirrored_from_the_front():
    cut = cut_of(WAVY, BODIES["triangle"])
    front, rear = (cut_plan(cut, name, CHORD).curves[0].points for name in ("front", "rear"))
    assert (front == rear * [-1, 1]).all()
    assert rear[:-1].tolist() == [[-3, -3], [3, -2.5], [0.5, 3]]
    names = [curve.name for curve in cut_plan(cut_of(WAVY, BODIES["flange"]), "rear", CHORD).curves]
    assert names == ["rear", "flange"]
    view = cut_plan(cut_of(WAVY, BODIES["wide"]), "rear", CHORD)
    points = (view.curves[0].points[:-1] + view.curves[0].points[1:]) / 2
    assert 0 < 2 * (1 - np.hypot(*(points / [4.9, 2.0]).T)).max() <= view.bound <= CHORD


def test_corners_behind_glass_are_hidden():
    view = cut_side(cut_of(WAVY, BODIES["U"]), 1, CHORD)
    lines = [c for c in view.curves if c.name == "edge"]
    styles = {float(height_line(view, c.points)[0, 0]): c.style for c in lines}
    hidden = Style.HIDDEN
    assert styles == {-4: Style.OUTLINE, -2: hidden, 2: hidden, 4: Style.OUTLINE}


@pytest.mark.every(3)
@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_everything_stands_on_the_paper_twice_the_same(body):
    sheet = lens_sheet(PLAIN, **body)
    points = np.concatenate([one.origin + sheet.scale * one.view.box() for one in sheet.views])
    points = np.concatenate([points, *(stroke.points for stroke in sheet.strokes)])
    assert ((points >= [20, 10]) & (points <= [410, 287])).all()
    again = lens_sheet(PLAIN, **body)
    for name in ("svg", "dxf"):
        assert drawing_bytes(sheet, name) == drawing_bytes(again, name)


def test_the_sheet_says_what_the_body_measures():
    said = [label.text for label in lens_sheet(WAVY, Product(), **BODIES["round with a flange"]).labels]
    assert {"\u00d8 7", "\u00d8 11", "0.5", "diameter 7 mm"} <= set(said)
    edge = 3 + WAVY.rear(0, 3.5)
    assert f"{edge:.4f}".rstrip("0") in said
    said = [label.text for label in lens_sheet(WAVY, **BODIES["beside the axis"]).labels]
    assert {"A-A   x = 2.5", "B-B   y = 2", "3", "2", "polygon of 3 corners within 3 x 2 mm"} <= set(said)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ({"polygon": [(0, 0), (1, 0), (0, 1)], "flange": FLANGE}, "an outline by itself"),
        ({"aperture": (6, 4)}, "semi_axes must be at most the front's half-widths"),
        ({"flange": Flange(2, -1, 1)}, "flange low must lie above the front's rim"),
        ({"aperture": (3, 3), "chord": 0.0}, "chord must be a finite number of at least 1e-08"),
        ({"aperture": (3, 3), "chord": 1e-8}, "needs more than 20,000,000 heights"),
    ],
)
def test_refusals(body, words):
    with pytest.raises(ValueError, match=words):
        lens_sheet(WAVY, **body)


def test_a_flange_on_slanted_edges_is_refused():
    with pytest.raises(ValueError, match="a flange is drawn where front and rear have one size"):
        lens_sheet(WIDER, flange=Flange(2.0, 1.0, 2.0))
