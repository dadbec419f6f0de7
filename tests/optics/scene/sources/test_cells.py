"""Cells of beams and of cones: what light they carry, and where the rays at their corners go."""

from itertools import pairwise
from math import cos, erf, exp, pi, radians, sin, sqrt

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays
from scipy.integrate import quad
from scipy.stats import truncnorm

from optics.scene.sources import Profile, beam_cells, collimated_beam, cone_cells, corner_flux, point_rays

LIGHT = np.array([[1.0, 0.0, 2.0], [0.5, 3.0, 1.5]])  # row 0 at +y
PROFILES = {
    "uniform": Profile(),
    "round": Profile("round"),
    "gaussian": Profile("gaussian", (0.4, 0.7)),
    "round gaussian": Profile("round_gaussian", (0.4, 0.7)),
    "image": Profile("image", light=LIGHT),
}
every_profile = pytest.mark.parametrize("profile", PROFILES.values(), ids=PROFILES.keys())


def borders(count, seed):
    return np.sort(np.concatenate([[-1.0, 1.0], np.random.default_rng(seed).uniform(-1, 1, count - 1)]))


def part_of_a_chord(s, low, high):
    """Return the length of the unit disk's chord at s that lies between two heights."""
    reach = sqrt(max(0.0, 1 - s * s))
    return max(0.0, min(high, reach) - max(low, -reach))


@every_profile
def test_the_shares_of_all_cells_are_the_whole(profile):
    """Sums of 30 differences of numbers up to 1, each rounded to 1e-16."""
    shares = profile.shares(borders(5, 0), borders(6, 1))
    assert shares.shape == (5, 6)
    assert shares.min() >= 0
    assert shares.sum() == pytest.approx(1, abs=1e-14)


@every_profile
def test_halves_of_cells_make_them_up(profile):
    s, t = borders(5, 2), borders(6, 3)
    fine = profile.shares(*(np.sort(np.append(r, (r[1:] + r[:-1]) / 2)) for r in (s, t)))
    summed = fine.reshape(5, 2, 6, 2).sum(axis=(1, 3))
    np.testing.assert_allclose(summed, profile.shares(s, t), rtol=0, atol=1e-15)


@every_profile
def test_the_share_of_a_small_cell_is_the_density_in_its_middle(profile):
    """Relative to the mean over the area 4: the midpoint rule errs by the square of the size, 1e-6, with
    second derivatives of the Gaussian below 1 / 0.4^2."""
    s, t = np.random.default_rng(4).uniform(-0.95, 0.95, (2, 200))
    h = 1e-3
    away = np.abs(np.hypot(s, t) - 1) > 0.01
    away &= np.abs(np.abs(s) - 1 / 3) > 0.01  # the image's pixels
    away &= np.abs(t) > 0.01
    for a, b in zip(s[away], t[away]):
        (share,) = profile.shares(np.array([a - h, a + h]), np.array([b - h, b + h])).ravel()
        density = profile(np.array(a), np.array(b))
        assert share / h**2 == pytest.approx(density, abs=1e-5)  # 1e-16 / h^2 of rounding, too


def test_cells_beside_a_disk_are_dark():
    """Without roundings, in which light would be looked for."""
    r = np.linspace(-1, 1, 514)
    nearest = np.minimum(np.abs(r[1:]), np.abs(r[:-1]))
    for kind in ("round", "round_gaussian"):
        shares = Profile(kind).shares(r, r)
        assert np.array_equal(shares > 0, np.add.outer(nearest**2, nearest**2) < 1)
        assert shares.sum() == pytest.approx(1, rel=1e-12)


def test_the_shares_of_a_disk_are_its_areas():
    """Chords summed by adaptive quadrature, split where they meet the cell's corners."""
    s, t = borders(6, 5), borders(7, 6)
    shares = Profile("round").shares(s, t)
    assert (shares == 0).any()  # cells in the corners
    for (i, j), share in np.ndenumerate(shares):
        kinks = [sign * sqrt(1 - h * h) for h in t[j : j + 2] for sign in (-1, 1)]
        inside = [k for k in kinks if s[i] < k < s[i + 1]]
        area, _ = quad(
            part_of_a_chord, s[i], s[i + 1], (t[j], t[j + 1]), points=inside or None, epsabs=1e-13, limit=200
        )
        assert share == pytest.approx(area / pi, abs=1e-10)


@pytest.mark.parametrize("sigma", [(0.95, 0.95), (0.3, 2.0), (0.02, 0.005)], ids=str)
def test_the_shares_of_a_round_gaussian_are_its_integrals(sigma):
    """Chords weighted by the error function, summed by adaptive quadrature between their kinks."""
    s, t = borders(5, 5), borders(6, 6)
    root = [sqrt(2) * w for w in sigma]

    def of_chord(at, low, high):
        reach = sqrt(max(0.0, 1 - at * at))
        ends = min(max(low, -reach), reach), min(max(high, -reach), reach)
        return exp(-((at / root[0]) ** 2)) * (erf(ends[1] / root[1]) - erf(ends[0] / root[1]))

    def integral(a, b, low, high):
        kinks = [sign * sqrt(1 - h * h) for h in (low, high) for sign in (-1, 1)]
        kinks += [k * sigma[0] for k in range(-8, 9)]
        points = [k for k in kinks if a < k < b]
        return quad(of_chord, a, b, (low, high), points=points or None, epsabs=1e-15, limit=400)[0]

    whole = integral(-1.0, 1.0, -1.0, 1.0)
    for (i, j), share in np.ndenumerate(Profile("round_gaussian", sigma).shares(s, t)):
        assert share == pytest.approx(integral(s[i], s[i + 1], t[j], t[j + 1]) / whole, abs=1e-10)


def test_a_round_gaussian_of_equal_widths_has_its_closed_form():
    """Of exp(-r^2 / 2 w^2) in the disk: 2 pi w^2 (1 - exp(-1 / 2 w^2)), over the area 4 of the square."""
    for width in (0.1, 0.945, 5.0):
        light = 2 * pi * width**2 * (1 - exp(-0.5 / width**2)) / 4
        middle = Profile("round_gaussian", (width, width))(np.zeros(1), np.zeros(1))
        assert middle[0] == pytest.approx(1 / light, rel=1e-13)


def test_the_shares_of_a_gaussian_are_those_of_a_cut_normal_distribution():
    s, t = borders(5, 7), borders(4, 8)
    by_s, by_t = (
        np.diff(truncnorm(-1 / w, 1 / w, scale=w).cdf(r)) for r, w in zip((s, t), PROFILES["gaussian"].sigma)
    )
    np.testing.assert_allclose(PROFILES["gaussian"].shares(s, t), np.outer(by_s, by_t), rtol=0, atol=1e-14)


@given(light=arrays(float, st.tuples(st.integers(1, 5), st.integers(1, 5)), elements=st.integers(0, 9)))
def test_the_shares_of_a_picture_are_its_pixels(light):
    """On its own pixels, row 0 at +y, and on cells that cut them into 2 x 3."""
    light[0, 0] += 1
    rows, columns = light.shape
    profile = Profile("image", light=light)
    s, t = (np.linspace(-1, 1, n + 1) for n in (columns, rows))
    expected = light[::-1].T / light.sum()
    np.testing.assert_allclose(profile.shares(s, t), expected, rtol=0, atol=1e-15)
    s, t = np.linspace(-1, 1, 2 * columns + 1), np.linspace(-1, 1, 3 * rows + 1)
    cut = np.kron(expected, np.full((2, 3), 1 / 6))
    np.testing.assert_allclose(profile.shares(s, t), cut, rtol=0, atol=1e-15)


# Beams


@every_profile
@pytest.mark.parametrize("half_width", [(9.5, 8.0), (14.0, 8.0), (14.0, 12.0)])
def test_a_beam_carries_its_flux_or_passes_beside_the_lens(profile, half_width):
    cells = beam_cells(half_width, 3.0, (10.0, 10.0), (24, 15), profile)
    assert cells.emitted.sum() + cells.missed == pytest.approx(3.0, rel=1e-14)
    lit = [min(h, 10.0) / h for h in half_width]
    if lit == [1, 1]:
        assert cells.missed == 0
    (within,) = profile.shares(*(np.array([-a, a]) for a in lit)).ravel()
    assert cells.emitted.sum() == pytest.approx(3 * within, rel=1e-13)
    for border, h in ((cells.s, half_width[0]), (cells.t, half_width[1])):
        assert [border[0], border[-1]] == [-min(h, 10.0), min(h, 10.0)]


@every_profile
def test_the_cells_of_a_beam_surround_its_rays(profile):
    """The rays of `collimated_beam` go through their middles, x first, and carry as much where the light is
    even over a cell."""
    cells = beam_cells((9.5, 8.0), 3.0, (10.0, 6.0), (24, 16), profile)
    rays = collimated_beam((9.5, 8.0), 3.0, (10.0, 6.0), (24, 16), profile=profile)
    for border, middle in ((cells.s, rays.x), (cells.t, rays.y)):
        np.testing.assert_allclose((border[1:] + border[:-1]) / 2, middle, rtol=0, atol=1e-14)
    if profile.kind in ("uniform", "image"):  # every pixel holds whole cells
        np.testing.assert_allclose(cells.emitted, rays.flux, rtol=1e-13)
    corners = cells.rays()
    assert cells.parallel
    np.testing.assert_array_equal(corners.x, cells.s)
    np.testing.assert_array_equal(corners.y, cells.t)
    np.testing.assert_array_equal(corners.flux, corner_flux(cells.emitted))
    assert corners.missed == cells.missed


def test_single_rays_of_a_beam_are_those_of_the_grid():
    cells = beam_cells((9.5, 8.0), 3.0, (10.0, 10.0), (4, 3))
    whole = cells.rays().rays(-200.0)
    single = cells.at(whole.origin[0], whole.origin[1], whole.flux)
    np.testing.assert_array_equal(single.origin, whole.origin)
    np.testing.assert_array_equal(single.direction, whole.direction)
    np.testing.assert_array_equal(single.flux, whole.flux)


# Cones


def relative_flux(depth, exponent):
    """Return the flux of directions with 1 - cos(theta) <= depth, up to a constant."""
    return 1 - (1 - depth) ** (exponent + 1)


@pytest.mark.parametrize("exponent", [0.0, 1.0, 2.5])
@pytest.mark.parametrize("half_angle", [20.0, 75.0])
@pytest.mark.parametrize("counts", [(16, 16), (32, 48)])
def test_squares_of_cells_are_cones_with_a_power_of_the_cosine(exponent, half_angle, counts):
    """Gauss's rule is exact to 1e-7."""
    cells = cone_cells(2.0, 3.0, half_angle, exponent, counts)
    assert cells.emitted.sum() == pytest.approx(3.0, rel=1e-14)
    deepest, counts = 1 - cos(radians(half_angle)), cells.emitted.shape
    for part in (0.25, 0.5, 0.75):
        inner = [slice(round(n * (1 - part) / 2), round(n * (1 + part) / 2)) for n in counts]
        expected = 3 * relative_flux(deepest * part**2, exponent) / relative_flux(deepest, exponent)
        assert cells.emitted[inner[0], inner[1]].sum() == pytest.approx(expected, abs=3e-7)


def test_cells_of_even_light_are_all_alike():
    emitted = cone_cells(2.0, 3.0, 60.0, 0.0, (8, 12)).emitted
    np.testing.assert_allclose(emitted, 3 / 100, rtol=1e-14)


@pytest.mark.parametrize("counts", [(1, 1), (5, 5), (8, 8), (7, 12), (64, 9)])
def test_cells_of_a_cone_are_an_even_number_and_as_many_in_both_directions(counts):
    """About as many as are asked for, so that kinks of the map on |s| = |t| are diagonals of cells: of those
    turned where s and t have other signs."""
    cells = cone_cells(2.0, 1.0, 60.0, 1.0, counts)
    side = len(cells.s) - 1
    assert side % 2 == 0
    assert cells.emitted.shape == (side, side)
    assert counts[0] * counts[1] <= side**2 <= (sqrt(counts[0] * counts[1]) + 2) ** 2
    np.testing.assert_array_equal(cells.s, cells.t)
    assert cells.s[side // 2] == 0
    expected = np.kron([[False, True], [True, False]], np.ones((side // 2, side // 2), dtype=bool))
    np.testing.assert_array_equal(cells.turned, expected)
    assert not cells.half((0, 1)).turned.any()
    assert beam_cells((1.0, 1.0), 1.0, (1.0, 1.0), counts).turned is None


def test_the_cells_around_the_middle_have_the_flux_of_their_straight_edges():
    """The inner four make an octagon; the next on the axis is (1, 0), (2, 0), (2, 22.5 degrees) and
    (1, 45 degrees).  What sixteen rings have together stays, and so have all others what they had."""
    emitted = cone_cells(2.0, 1.0, 60.0, 0.0, (200, 200)).emitted
    inner = emitted[84:116, 84:116]
    assert inner.sum() == pytest.approx(32**2 / 200**2, rel=1e-12)
    half, x, y = sqrt(0.5), 2 * cos(pi / 8) - 1, 2 * sin(pi / 8)
    assert inner[16, 16] / inner.sum() == pytest.approx(half / (4 * 16**3 * sin(pi / 64)), rel=1e-12)
    area = (x * half + y * (2 - half)) / 2  # by the diagonals
    assert inner[17, 16] / inner[16, 16] == pytest.approx(area / half, rel=1e-12)
    np.testing.assert_allclose(emitted[:84], 1 / 200**2, rtol=1e-12)


@pytest.mark.parametrize("counts", [(8, 8), (5, 8)])
def test_cells_have_equal_solid_angles(counts):
    """Spherical polygons of the rays along a cell's border: Girard's sum by the signed angles of triangles
    with the first ray; 400 rays a side leave (size / 400)^2."""
    cells = cone_cells(2.0, 1.0, 60.0, 1.0, counts)
    whole, counts = 2 * pi * (1 - cos(radians(60.0))), cells.emitted.shape
    for i, j in ((0, 0), (1, 2), (counts[0] // 2, counts[1] // 2), (counts[0] - 1, 1)):
        s0, s1, t0, t1 = cells.s[i], cells.s[i + 1], cells.t[j], cells.t[j + 1]
        u = np.linspace(0, 1, 401)[:-1]
        s = np.concatenate([s0 + u * (s1 - s0), s1 + 0 * u, s1 - u * (s1 - s0), s0 + 0 * u])
        t = np.concatenate([t0 + 0 * u, t0 + u * (t1 - t0), t1 + 0 * u, t1 - u * (t1 - t0)])
        d = cells.at(s, t, np.ones(s.size)).direction
        a, b, c = d[:, :1], d[:, 1:-1], d[:, 2:]
        triple = np.sum(a * np.cross(b, c, axis=0), axis=0)
        turn = 1 + np.sum(a * b, axis=0) + np.sum(b * c, axis=0) + np.sum(a * c, axis=0)
        angle = 2 * np.arctan2(triple, turn).sum()
        assert angle == pytest.approx(whole / cells.emitted.size, rel=1e-5)


@pytest.mark.parametrize("exponent", [1.0, 2.5])
def test_the_light_of_a_cell_is_its_integral(exponent):
    """Against sums over 200 x 200 points: 1e-5 of second derivatives."""
    cells = cone_cells(2.0, 1.0, 60.0, exponent, (8, 8))
    deepest = 0.5
    whole = 4 * relative_flux(deepest, exponent) / (exponent + 1) / deepest
    u = (np.arange(200) + 0.5) / 200
    for (i, j), emitted in np.ndenumerate(cells.emitted):
        s, t = cells.s[i] + u * (cells.s[1] - cells.s[0]), cells.t[j] + u * (cells.t[1] - cells.t[0])
        radius = np.maximum(np.abs(s)[:, None], np.abs(t)[None, :])
        part = ((1 - deepest * radius**2) ** exponent).mean() * 4 / 64 / whole
        assert emitted == pytest.approx(part, rel=2e-5)


def test_rays_at_the_middles_of_cells_are_those_of_a_point():
    """In their order, and with the flux of the cells where it is even."""
    cells, rays = cone_cells(2.0, 3.0, 60.0, 0.0, (8, 8)), point_rays(2.0, 3.0, 60.0, 0.0, (8, 8), (0, 0))
    s, t = np.meshgrid(*((r[1:] + r[:-1]) / 2 for r in (cells.s, cells.t)), indexing="ij")
    found = cells.at(s.ravel(), t.ravel(), cells.emitted.ravel())
    np.testing.assert_array_equal(found.origin, rays.origin)
    np.testing.assert_allclose(found.direction, rays.direction, rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.flux, rays.flux, rtol=1e-14)
    corners = cells.rays()
    assert corners.direction[2].min() == pytest.approx(cos(radians(60.0)), abs=1e-15)
    np.testing.assert_allclose(np.linalg.norm(corners.direction, axis=0), 1, rtol=0, atol=4e-16)
    first, last = corners.direction[:2, 0], corners.direction[:2, -1]
    assert (first < 0).all()
    assert (last > 0).all()
    # t runs first
    assert corners.direction[1, 1] > corners.direction[1, 0]
    np.testing.assert_array_equal(corners.flux, corner_flux(cells.emitted).ravel())


# All of them


def test_the_flux_of_corners_is_that_of_the_cells_around():
    emitted = np.arange(1.0, 7.0).reshape(2, 3)
    found = 4 * corner_flux(emitted)
    np.testing.assert_array_equal(found, [[1, 3, 5, 3], [5, 12, 16, 9], [4, 9, 11, 6]])


@pytest.mark.parametrize("most", [1, 20, 33, 1000])
@pytest.mark.parametrize(
    "cells",
    [beam_cells((14.0, 8.0), 3.0, (10.0, 10.0), (13, 7)), cone_cells(2.0, 3.0, 60.0, 1.0, (13, 7))],
    ids=["beam", "cone"],
)
def test_slices_make_up_the_whole(cells, most):
    """Strips share the corners on their borders, and no light."""
    strips = list(cells.slices(most))
    rows = len(cells.emitted)
    assert len(strips) == {1: rows, 20: rows, 33: 5, 1000: 1}[most]
    np.testing.assert_array_equal(np.concatenate([strip.emitted for strip in strips]), cells.emitted)
    np.testing.assert_array_equal(np.concatenate([cells.s[:1], *(strip.s[1:] for strip in strips)]), cells.s)
    assert all(a.s[-1] == b.s[0] for a, b in pairwise(strips))
    assert sum(strip.missed for strip in strips) == cells.missed
    flux = sum(strip.rays().flux.sum() for strip in strips)
    assert flux == pytest.approx(cells.rays().flux.sum(), rel=1e-14)


@pytest.mark.parametrize(
    "cells",
    [
        beam_cells((3.0, 4.0), 2.0, (5.0, 3.0), (101, 103), PROFILES["gaussian"]),
        beam_cells((3.0, 4.0), 2.0, (5.0, 3.0), (102, 104), PROFILES["uniform"]),
        cone_cells(2.0, 3.0, 40.0, 4.0, (101, 103)),
    ],
    ids=["gaussian", "uniform", "cone"],
)
def test_the_density_is_that_of_the_cells_flux(cells):
    """The midpoint rule: second derivatives of at most 20 times the density, over 1 / 50 of the half-width.

    A cone's density has a kink on the diagonals, and its cells have straight edges around the middle: they
    are left out."""
    s, t = np.meshgrid(*((r[1:] + r[:-1]) / 2 for r in (cells.s, cells.t)), indexing="ij")
    ratio = cells.emitted / cells.density(s.ravel(), t.ravel()).reshape(s.shape)
    ratio = ratio[
        cells.parallel | (np.abs(np.abs(s) - np.abs(t)) > 0.02) & (np.maximum(abs(s), abs(t)) > 0.3)
    ]
    assert np.ptp(ratio) < 2 * 20 / 24 * 0.02**2 * ratio.mean()
