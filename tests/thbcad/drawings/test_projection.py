"""Third-angle projection (ISO 5456-2): every view lies on the side of its neighbour from which it is seen,
turned as the faces of an unfolded glass box are."""

import numpy as np
import pytest

from tests.thbcad.drawings.cases import BALL, LENSES, PLAIN, WIDER
from thbcad.drawings import lens_sheet

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


def test_the_sheet_states_one_thickness_on_the_axis():
    """The distance of the vertices of the base surfaces is none of the part, where a sag moves them."""
    thickness = WIDER.thickness + WIDER.rear(0, 0) - WIDER.front(0, 0)
    said = [label.text for label in lens_sheet(WIDER).labels]
    assert said.count(f"{thickness:.4f}".rstrip("0")) == 1
    assert not any("apart" in text for text in said)
