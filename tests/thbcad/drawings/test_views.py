"""Views and sections: chords within their bound of the exact lens, outlines of what numpy samples, hidden
lines."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial import cKDTree

from tests.cases import examples
from tests.thbcad.cases import random_knot_vector, seeds
from tests.thbcad.drawings.cases import LENSES, PLAIN, WAVY, WIDER, assert_section_area, height_line, outlined
from thbcad import body_mesh, to_trimesh
from thbcad.drawings import lens_sheet, plan_view, section_view, side_view
from thbcad.drawings.curves import Style
from thbcad.drawings.envelopes import lowest_outline
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic
from thbcad.splines import BSplineSurface

CHORD = 1e-3
LINES = 4001


def random_graph(rng, degree):
    kv_u, kv_v = (random_knot_vector(rng, degree, 5) for _ in range(2))
    return BSplineSurface(kv_u, kv_v, rng.uniform(-1, 1, (kv_u.dim, kv_v.dim)))


@examples(40)
@given(seeds(), st.integers(2, 5), st.sampled_from([1e-1, 1e-2, 1e-3]))
def test_an_outline_lies_within_its_bound_of_the_least_height(rng, degree, chord):
    """On a dense grid the least height is too great by at most what the slope makes of half a step."""
    graph = random_graph(rng, degree)
    *outline, bound = lowest_outline(graph, chord)
    u, v = (np.linspace(kv.start, kv.stop, 1201) for kv in (graph.kv_u, graph.kv_v))
    least = graph.grid(u, v).min(axis=0)
    missed = np.abs(np.diff(graph.grid(u, v), axis=0)).max()
    chords = np.interp(v, *outline)
    assert bound <= chord
    assert (chords - least).max() <= bound + 1e-12
    assert (least - chords).max() <= bound + missed


def test_an_outline_keeps_its_bound_where_its_lowest_point_jumps():
    """min(g(0, v), g(1, v)) with g bilinear in v: a kink between two lines."""
    graph = random_graph(np.random.default_rng(0), 1)
    ramps = np.linspace(0, 1, graph.kv_u.dim)[:, None] - 0.3
    tilted = BSplineSurface(graph.kv_u, graph.kv_v, ramps * graph.kv_v.greville())
    *outline, _ = lowest_outline(tilted, 1e-6)
    v = np.linspace(graph.kv_v.start, graph.kv_v.stop, LINES)
    assert np.abs(np.interp(v, *outline) - np.minimum(-0.3 * v, 0.7 * v)).max() <= 1e-6


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
@pytest.mark.parametrize(("axis", "at"), [("x", 0.0), ("x", -1.7), ("y", 0.0), ("y", 2.3)])
def test_a_section_lies_on_both_surfaces(lens, axis, at):
    view = section_view(lens, axis, at, CHORD)
    assert view.bound <= CHORD
    for name, surface, vertex in (("front", lens.front, 0.0), ("rear", lens.rear, lens.thickness)):
        (curve,) = (c for c in view.curves if c.name == name)
        across, z = height_line(view, curve.points).T
        half = surface.half_width[1 if axis == "x" else 0]
        assert (across[0], across[-1]) == (-half, half)
        fine = np.linspace(-half, half, LINES)
        fixed = np.full(LINES, at)
        exact = vertex + (surface(fixed, fine) if axis == "x" else surface(fine, fixed))
        assert np.abs(np.interp(fine, across, z) - exact).max() <= view.bound


def test_a_section_beside_the_middle_cuts_slanted_edges_along_a_curve():
    """Points of the edge are those of the ruling: (1 - w) F + w R at equal relative positions."""
    view = section_view(WIDER, "x", 3.0, CHORD)
    edge = [c for c in view.curves if c.name == "edge"][1]
    w = np.linspace(0, 1, LINES)
    (fx, fy), (rx, ry) = WIDER.front.half_width, WIDER.rear.half_width
    s = 3.0 / ((1 - w) * fx + w * rx)
    front = WIDER.front(s * fx, np.full(LINES, fy))
    rear = WIDER.thickness + WIDER.rear(s * rx, np.full(LINES, ry))
    y = (1 - w) * fy + w * ry
    z = (1 - w) * front + w * rear
    drawn = np.interp(y, edge.points[:, 1], edge.points[:, 0])
    assert len(edge.points) > 2
    assert np.abs(drawn - z).max() <= view.bound


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
@pytest.mark.parametrize("axis", ["x", "y"])
def test_no_point_of_the_surfaces_lies_beyond_the_outline_of_a_side(lens, axis):
    view = side_view(lens, axis, CHORD)
    k = "xy".index(axis)
    for name, surface, vertex, sign in (
        ("front", lens.front, 0.0, -1),
        ("rear", lens.rear, lens.thickness, 1),
    ):
        curve = next(c for c in view.curves if c.name == name and c.style is Style.OUTLINE)
        across, z = height_line(view, curve.points).T
        grid = surface.grid(*(np.linspace(-h, h, 601) for h in surface.half_width))
        extreme = vertex + sign * (sign * grid).max(axis=k)
        half = surface.half_width[1 - k]
        drawn = np.interp(np.linspace(-half, half, 601), across, z)
        assert (sign * (extreme - drawn)).max() <= view.bound
        assert (sign * (drawn - extreme)).max() <= view.bound + 2e-3  # what the 601 lines miss


def test_the_far_rim_is_hidden_and_left_out_where_the_near_one_covers_it():
    def hidden(lens):
        return [c.name for c in side_view(lens, "x", CHORD).curves if c.style is Style.HIDDEN]

    assert hidden(PLAIN) == ["rear"]  # the crest of the rear behind its outline
    assert hidden(WAVY).count("rear") == 2  # and its far rim, which differs from the near one


def test_rims_of_another_size_are_hidden_behind_the_larger_surface():
    front, rear = (plan_view(WIDER, word) for word in ("front", "rear"))
    assert {c.style for c in front.curves} == {Style.OUTLINE}
    assert [c.style for c in rear.curves] == [Style.OUTLINE] + [Style.HIDDEN] * 8
    assert len(plan_view(WAVY, "rear").curves) == 1
    assert front.box().tolist() == [[-8, -7], [8, 7]]
    assert (front.axes, rear.axes) == (("-x", "y"), ("x", "y"))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: section_view(PLAIN, "z"), "axis must be 'x' or 'y', got 'z'"),
        (
            lambda: section_view(PLAIN, "x", 5.0),
            "the plane x = 5 mm must cut front and rear: choose x between",
        ),
        (lambda: section_view(PLAIN, "x", np.nan), "at must be a finite number, got nan"),
        (lambda: side_view(PLAIN, "x", 0.0), "chord must be a finite number of at least 1e-08, got 0"),
        (
            lambda: lowest_outline(WAVY.graphs()[1], 1e-12),
            "a chord error of 1e-12 mm needs more than 200,000 lines of an outline",
        ),
        (lambda: plan_view(PLAIN, "left"), "seen_from must be 'front' or 'rear', got 'left'"),
        (lambda: plan_view("lens", "front"), "lens must be a Lens, got str"),
    ],
)
def test_refusals(call, words):
    with pytest.raises(ValueError, match=words):
        call()


OUTLINES = {
    "ellipse": outlined(WAVY, (1, 1)),
    "rounded": outlined(WAVY, (0.3, 0.5)),
    "round dome": outlined(WIDER, (1, 1)),
    "rounded dome": outlined(WIDER, (0.3, 0.5)),
    "wider and lower": outlined(WAVY, (1, 1), (0.6, 1.0)),
}


@pytest.mark.parametrize("lens", OUTLINES.values(), ids=OUTLINES)
def test_a_plan_of_a_lens_with_an_outline_shows_its_rims(lens):
    """Points and middles of chords have a gauge of 1; what lies beside the near rim is seen."""
    for seen, near, far in (("front", lens.front, lens.rear), ("rear", lens.rear, lens.front)):
        view = plan_view(lens, seen)
        assert view.bound <= CHORD
        names = {curve.name for curve in view.curves}
        assert names == ({"front", "rear"} if near.half_width != far.half_width else {seen})
        for curve in view.curves:
            points = np.concatenate([curve.points, (curve.points[:-1] + curve.points[1:]) / 2])
            own = near if curve.name == seen else far
            off = np.abs(own.outline.gauge(*points.T) - 1) * max(own.half_width)
            assert off.max() <= 2 * view.bound  # along a ray, of ellipses at most 1.5 times as wide as high
            if curve.name != seen:
                beside = near.outline.gauge(*points.T).max() > 1 + 1e-3
                assert (curve.style is Style.OUTLINE) == beside


@pytest.mark.every(3)
@pytest.mark.parametrize("lens", OUTLINES.values(), ids=OUTLINES)
@pytest.mark.parametrize(("axis", "at"), [("x", 0.0), ("x", -2.3), ("y", 3.1)])
def test_a_section_of_a_lens_with_an_outline_has_the_area_that_trimesh_cuts(lens, axis, at):
    view, across = section_view(lens, axis, at, CHORD), "xy".index(axis)
    assert view.bound <= CHORD
    front, rear, start, stop = (height_line(view, curve.points) for curve in view.curves)
    line = np.concatenate([front, stop, rear[::-1], start[::-1]])
    assert_section_area([line], to_trimesh(body_mesh(lens, 4 * CHORD)), across, at, 5 * CHORD)


@pytest.mark.parametrize("lens", OUTLINES.values(), ids=OUTLINES)
@pytest.mark.parametrize(("axis", "at"), [("x", -2.3), ("y", 3.1)])
def test_the_wall_of_an_outline_is_cut_where_its_rulings_pass(lens, axis, at):
    """Points of the wall at the relative positions (s, Y(s)) of both rims, s = at / h(w)."""
    view, k = section_view(lens, axis, at, CHORD), "xy".index(axis)
    stop = height_line(view, view.curves[3].points)
    pairs = np.array([lens.front.half_width, lens.rear.half_width])
    c, d = (lens.rear.outline.corners / pairs[1])[[k, 1 - k]]
    w = np.linspace(0, 1, 20001)
    s = at / ((1 - w) * pairs[0, k] + w * pairs[1, k])
    y = 1 - d + d * np.sqrt(1 - (np.maximum(abs(s) - (1 - c), 0) / c) ** 2)
    spots = [(s * half[k], y * half[1 - k]) for half in pairs]
    z = [
        vertex + surface(*spot[:: 1 - 2 * k])
        for surface, vertex, spot in zip((lens.front, lens.rear), (0.0, lens.thickness), spots)
    ]
    exact = np.column_stack([(1 - w) * low + w * high for low, high in ((spots[0][1], spots[1][1]), z)])
    step = np.hypot(*np.diff(exact, axis=0).T).max()
    off, _ = cKDTree(exact).query(np.concatenate([stop, (stop[:-1] + stop[1:]) / 2]))
    assert off.max() <= view.bound + step / 2


@pytest.mark.every(2)
@pytest.mark.parametrize("lens", OUTLINES.values(), ids=OUTLINES)
@pytest.mark.parametrize("axis", ["x", "y"])
def test_a_side_of_a_lens_with_an_outline_is_as_large_as_its_mesh(lens, axis):
    low, high = to_trimesh(body_mesh(lens, 4 * CHORD)).bounds
    view = side_view(lens, axis, CHORD)
    assert view.bound <= CHORD
    box = np.sort(height_line(view, view.box()), axis=0)
    assert box == pytest.approx(np.array([low, high])[:, [1 - "xy".index(axis), 2]], abs=5 * CHORD)
    for name, surface, vertex, sign in (
        ("front", lens.front, 0.0, -1),
        ("rear", lens.rear, lens.thickness, 1),
    ):
        grid = np.stack(np.meshgrid(*(np.linspace(-h, h, 201) for h in surface.half_width), indexing="ij"))
        points = grid[:, surface.outline.contains(*grid)]
        heights = sign * (vertex + surface(*points))
        lines = [height_line(view, c.points) for c in view.curves if c.name == name]
        shifts = (-view.bound, 0.0, view.bound)
        at = points[1 - "xy".index(axis)]
        drawn = np.max(
            [
                np.interp(at + d, p[:, 0], sign * p[:, 1], left=-np.inf, right=-np.inf)
                for p in lines
                if p[0, 0] < p[-1, 0]
                for d in shifts
            ],
            axis=0,
        )
        assert (heights - drawn).max() <= view.bound


def test_the_sheet_of_a_dome_has_both_diameters():
    dome = Lens(
        FreeformSurface((10.0, 10.0), Conic(-18.0, -1.0), None, (10.0, 10.0)),
        FreeformSurface((24.0, 24.0), Conic(-60.0, -1.0), None, (24.0, 24.0)),
        16.0,
        1.5,
    )
    said = [label.text for label in lens_sheet(dome).labels]
    assert {"\u00d8 20", "\u00d8 48", "diameter 20 mm", "diameter 48 mm"} <= set(said)
