"""The light of a lens from cells: its order, its budget, and rays that land in the same pixels."""

from functools import cache
from math import atan, cos, erf, hypot, pi, prod, sqrt

import numpy as np
import pytest

from optics.light.analysis import light_of_cells, sequential
from tests.cases import slow_unless
from tests.optics.light.analysis.cases import POINT, WHOLE, Made

RIMS = 6.3456, 7.9, 8.0, 9.4999, 9.5 * (1 - 4 / 61)  # mm, across and along borders of 61 cells
PLATE = {"lens.rear.radius": np.inf, "lens.rear.conic": 0.0}
STRAIGHT_ON = PLATE | {
    "source.kind": "point",
    "source.half_angle": 30.0,
    "source.distance": 2.0,
    "lens.thickness": 5.0,
    "lens.front.half_width": [1.2, 1.2],
    "lens.front.radius": -2.0,
}
CUT = {
    "small rear": {
        "source.half_width": [14.0, 11.0],
        "lens.rear.half_width": [8.1, 7.3],
        "lens.front.radius": 60.0,
    },
    "wide cone": POINT | {"source.half_angle": 80.0},
    "total reflection": {
        "source.half_width": [6.8, 6.8],
        "lens.front.half_width": [7.0, 7.0],
        "lens.rear.half_width": [7.0, 7.0],
        "lens.rear.radius": -12.0,
        "lens.rear.conic": 0.0,
        "lens.thickness": 15.0,
    },
}


@pytest.fixture(scope="module")
def made(tmp_path_factory, backend):
    """Return a function that gives a problem by its name, made once."""
    return cache(lambda name: Made(tmp_path_factory.mktemp("cells"), (WHOLE | CUT)[name], backend))


@pytest.fixture(params=WHOLE)
def whole(request, made):
    return made(request.param)


@pytest.fixture(params=CUT)
def cut(request, made):
    return made(request.param)


@pytest.mark.every(3)
def test_the_error_falls_with_the_square_of_the_cells_size(whole):
    """Over a factor of 4 in size: 16, within the factor of 1.6 that pixels as large as few cells leave.

    Cells that the edge of a round beam cuts are lit in part and spread it: their share of the cells times
    their size is of second order, too."""
    reference, _ = whole.light(809, 811)
    errors = [np.linalg.norm(whole.light(n, n + 2)[0] - reference) for n in (53, 211)]
    assert 10 < errors[0] / errors[1] < 30
    assert errors[1] < 3e-3 * np.linalg.norm(reference)


def test_whole_cells_keep_all_flux(whole):
    """Sums of 1e4 numbers; what a cell's corners carry is what the cell carries."""
    image, fates = whole.light(97, 101)
    flux = whole.system.problem.source.flux
    assert fates.total == pytest.approx(flux, rel=1e-12)
    assert min(fates.flux.values()) > -1e-12 * flux
    assert whole.flux(image) == pytest.approx(fates.on_target, rel=1e-12)
    assert fates.on_target + fates.off_target == pytest.approx(fates.transmitted, rel=1e-15)
    assert fates.transmitted > 0.5 * flux


@pytest.mark.every(3)
def test_a_rim_keeps_all_flux(cut):
    """Cells that it cuts are split, and at last cut along it: none is lost, none counted twice."""
    image, fates = cut.light(61, 67)
    flux = cut.system.problem.source.flux
    assert fates.total == pytest.approx(flux, rel=1e-12)
    assert fates.missed_rear + fates.by_name["total_internal"] > 1e-3 * flux
    assert fates.on_target + fates.off_target == pytest.approx(fates.transmitted, rel=1e-15)
    assert cut.flux(image) == pytest.approx(fates.on_target, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [None, 0.4])
@pytest.mark.parametrize("half_width", RIMS)
def test_what_passes_a_straight_rim_is_known(tmp_path, backend, half_width, sigma):
    """A beam through a plate: 0.96^2 of what lies before the rear, however its rim lies to the cells.

    Straight rims are cut exactly but at their four corners, within (1 / BORDER_CELLS)^2 each.
    """
    rear = half_width, 7.0
    root = (sigma or 1.0) * sqrt(2)
    profile = {} if sigma is None else {"source.profile": "gaussian", "source.sigma": [sigma, sigma]}
    made = Made(tmp_path, PLATE | profile | {"lens.rear.half_width": list(rear)}, backend, 0.0)
    _, fates = made.light(61, 67)
    within = [h / 9.5 if sigma is None else erf(h / 9.5 / root) / erf(1 / root) for h in rear]
    assert fates.transmitted == pytest.approx(0.96**2 * prod(within), rel=1e-6)
    assert fates.missed_rear == pytest.approx(0.96 * (1 - prod(within)), rel=1e-6)


@pytest.mark.every(2)
@pytest.mark.parametrize("rear", [(2.9, 2.6), (3.0, 2.0)])
def test_what_passes_a_bent_rim_is_known(tmp_path, backend, rear):
    """A point in the middle of a spherical front: its rays go straight on to a plane rear 7 mm away, whose
    rim is bent in the source's parameters.  What it lets through is its solid angle.

    A corner of the rim between two corners of a cell is not seen: less than a quarter of a cell for each of
    the four, together 1 / 389^2 = 7e-6 of the light.
    """
    made = Made(tmp_path, STRAIGHT_ON | {"lens.rear.half_width": list(rear)}, backend, 0.0)
    _, fates = made.light(389, 397)
    seen = 4 * atan(prod(rear) / (7 * hypot(*rear, 7))) / (2 * pi * (1 - cos(pi / 6)))
    assert fates.missed_rear == pytest.approx(0.96 * (1 - seen), abs=389**-2)


@pytest.mark.every(2)
@pytest.mark.parametrize(("outline", "radius"), [("round", 0.0), ("rounded", 3.0)])
def test_what_passes_an_outline_is_known(tmp_path, backend, outline, radius):
    """A beam through a plate: 0.96^2 of what lies before the outline.  Chords of the cells' pieces miss up to
    1 / (6 BORDER_CELLS^2) of it."""
    sides = {f"lens.{name}.half_width": [9.3, 9.3] for name in ("front", "rear")}
    wide = {"source.half_width": [14.0, 14.0], "lens.outline": outline, "lens.corner_radius": radius}
    made = Made(tmp_path, PLATE | sides | wide, backend, 0.0)
    _, fates = made.light(61, 67)
    assert fates.transmitted == pytest.approx(0.96**2 * made.lens.rear.outline.area / 28**2, rel=5e-8)
    assert fates.total == pytest.approx(1.0, rel=1e-12)


def test_a_rim_beside_a_round_beam_cuts_nothing(tmp_path, backend, monkeypatch):
    """Rounding leaves its cells up to 1e-17 of the light where it is dark."""
    sides = {f"lens.{name}.half_width": [9.8, 9.8] for name in ("front", "rear")}
    made = Made(tmp_path, PLATE | sides | {"lens.outline": "round", "source.profile": "round"}, backend, 0.0)
    monkeypatch.setattr(light_of_cells, "_split", None)  # a call fails
    assert made.light(201, 199)[1].transmitted == pytest.approx(0.96**2, rel=1e-14)


@pytest.mark.every(2)
@pytest.mark.parametrize("radius", [1.9, 2.6])
def test_what_passes_a_round_rear_is_its_cone(tmp_path, backend, radius):
    """As above, a point in the middle of a spherical front: rays go straight on to the rim of a cone."""
    sides = {f"lens.{name}.half_width": [r, r] for name, r in (("front", 1.2), ("rear", radius))}
    made = Made(tmp_path, STRAIGHT_ON | sides | {"lens.outline": "round"}, backend, 0.0)
    _, fates = made.light(101, 99)
    missed = (cos(atan(radius / 7)) - cos(pi / 6)) / (1 - cos(pi / 6))
    assert fates.missed_rear == pytest.approx(0.96 * missed, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "order", "scale"),
    [("small rear", 2, 1.0), ("wide cone", 2, 1.0), ("total reflection", 1.5, 2.0)],
)
def test_what_arrives_does_not_depend_on_the_cells(made, name, order, scale):
    """Cells interpolate what passes, and err by the square of their size; so do split ones at a rim.

    At total reflection it falls as the root of the distance: the cells there, n^-1 of all, err by n^-1/2.
    """
    case = made(name)
    few, many = (case.light(n, n + 4)[1].transmitted for n in (37, 101))
    assert few == pytest.approx(many, abs=scale * 37**-order * case.system.problem.source.flux)
    assert few != many


@pytest.mark.slow
@pytest.mark.parametrize("name", ["point", "small rear", "total reflection", "far field"])
def test_rays_land_where_the_light_of_cells_is(made, name):
    """Rays on a grid of n^2 in a pixel: sqrt(4 n) or so count for the wrong side of its borders."""
    case = made(name)
    expected, fates = case.light(131, 137)
    rays = 1001
    image, by_rays, _ = sequential(case.system.with_lens(case.lens), case.backend, rays)
    per_pixel = rays**2 / expected.size * min(1.0, (expected > 0).mean())
    error = np.linalg.norm(image - expected) / np.linalg.norm(expected)
    assert error < 2 * np.sqrt(4 * np.sqrt(per_pixel)) / per_pixel
    assert fates.flux == pytest.approx(by_rays.flux, abs=4 / rays * case.system.problem.source.flux)


@pytest.mark.every(3)
@pytest.mark.parametrize(
    "name", slow_unless("wide cone".__ne__, ["beam", "point", "wide cone", "small rear"])
)
def test_strips_of_cells_make_up_the_image(made, monkeypatch, name):
    case = made(name)
    image, fates = case.light(41, 43)
    monkeypatch.setattr(light_of_cells, "CORNERS_AT_ONCE", 200)  # strips of three or four rows of cells
    strips, by_strips = case.light(41, 43)
    np.testing.assert_allclose(strips, image, rtol=0, atol=1e-12 * image.max())
    assert by_strips.flux == pytest.approx(fates.flux, abs=1e-12)
