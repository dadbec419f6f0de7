"""Rectangles that a border cuts: the triangles that make them up, and the flux of these."""

import numpy as np
import pytest

from optics.light.analysis.border_triangles import border_triangles, shared_flux

SIDE = 40


def squares():
    """Return SIDE^2 squares that tile [-1, 1]^2, with the flux of their area."""
    ends = np.linspace(-1, 1, SIDE + 1)
    s, t = (a.ravel() for a in np.meshgrid(ends[:-1], ends[:-1], indexing="ij"))
    return np.stack([s, s + 2 / SIDE, t, t + 2 / SIDE, np.full(s.size, 4 / SIDE**2)])


def areas(corners):
    (ps, pt), (qs, qt), (rs, rt) = corners
    return np.abs((qs - ps) * (rt - pt) - (rs - ps) * (qt - pt)) / 2


def even(s, t):
    return np.ones_like(s)


BORDERS = {
    "line": lambda s, t: 0.3 * s + t < 0.217,
    "disk": lambda s, t: s * s + t * t < 0.64,
    "hole": lambda s, t: s * s + t * t > 0.64,
}


@pytest.mark.parametrize("bisections", [8, 20])
@pytest.mark.parametrize("arrive", BORDERS.values(), ids=BORDERS.keys())
def test_no_triangle_is_cut_and_all_flux_is_there(arrive, bisections):
    """Flux is that of the area but for the gaps along the border, 2^-bisections of an edge wide."""
    corners, flux = border_triangles(squares(), arrive, even, bisections)
    inside = np.stack([arrive(s, t) for s, t in corners])
    assert (inside.all(axis=0) | ~inside.any(axis=0)).all()
    assert flux.min() >= 0
    assert flux.sum() == pytest.approx(4, rel=1e-13)
    np.testing.assert_allclose(areas(corners), flux, rtol=0, atol=2**-bisections * (2 / SIDE) ** 2)


@pytest.mark.parametrize(
    ("name", "exact", "within"),
    [("line", 2.434, 2**-19), ("disk", 0.64 * np.pi, 2e-3), ("hole", 4 - 0.64 * np.pi, 2e-3)],
)
def test_what_arrives_is_the_area_inside(name, exact, within):
    """A straight border is exact but for the bisection, 2^-20 of an edge of 1 / 20.  Of a disk of radius r
    chords of length l leave l^2 / (12 r) along 2 pi r: below pi (2 / 40)^2 2 / 6 = 2.6e-3, less where a
    triangle's diagonal shortens them."""
    corners, flux = border_triangles(squares(), BORDERS[name], even, 20)
    inside = BORDERS[name](*corners.mean(axis=0))
    assert flux[inside].sum() == pytest.approx(exact, abs=within)


def test_medians_feet_lie_on_the_squares_triangles():
    """The edge from the second corner to the third: along s, along t, or along the diagonal."""
    _, (qs, qt), (rs, rt) = border_triangles(squares(), BORDERS["disk"], even, 20)[0]
    along = np.minimum(np.abs(qs - rs), np.abs(qt - rt)), np.abs((qs - rs) - (qt - rt))
    assert np.minimum(*along).max() < 1e-15


def test_rectangles_beside_the_border_stay_whole():
    corners, flux = border_triangles(squares(), lambda s, t: s > 7, even, 20)
    assert corners.shape == (3, 2, 2 * SIDE**2)
    np.testing.assert_allclose(flux, areas(corners), rtol=1e-12)


def test_flux_is_shared_by_area_and_density():
    middles = np.array([[[1.0, 0.0], [3.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]]])
    found = shared_flux(np.array([8.0, 5.0]), np.array([[1.0, 1.0], [1.0, 4.0]]), middles, lambda s, t: s)
    np.testing.assert_allclose(found, [[2.0, 1.0], [6.0, 4.0]], rtol=1e-15)
