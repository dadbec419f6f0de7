"""Sag tables and point clouds: order, units, numbers."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.thbcad.cases import surfaces
from thbcad import FreeformSurface, KnotVector, THBSpace
from thbcad.io.sag_table import cloud_text, sag_text, table_size
from thbcad.sags import Conic
from thbcad.surfaces import THBSurface

TILTED = FreeformSurface(
    (3.0, 2.0),
    Conic(),
    THBSurface(THBSpace(KnotVector.uniform(3, 1), KnotVector.uniform(3, 1)), np.arange(16.0)),
)


def rows(text):
    return [line.split() for line in text.decode("ascii").splitlines()]


def test_the_first_line_says_how_the_points_lie():
    head = rows(sag_text(TILTED, (7, 5)))[0]
    assert head == ["7", "5", "1", "1", "0", "0", "0"]


def test_the_table_begins_at_low_x_and_high_y_and_runs_along_x():
    table = np.array(rows(sag_text(TILTED, (7, 5)))[1:], dtype=float)
    assert table.shape == (35, 5)
    z = table[:, 0].reshape(5, 7)
    for row, y in enumerate((2.0, 1.0, 0.0, -1.0, -2.0)):
        x = np.arange(-3.0, 4.0)
        assert z[row] == pytest.approx(TILTED(x, np.full(7, y)), abs=1e-14)
    assert (table[:, 4] == 0).all()


@given(surfaces(), st.integers(5, 9), st.integers(5, 9))
def test_derivatives_are_those_of_the_surface(surface, nx, ny):
    z, zx, zy, zxy = np.array(rows(sag_text(surface, (nx, ny)))[1:], dtype=float).T[:4]
    x, y = (np.linspace(-h, h, n) for h, n in zip(surface.half_width, (nx, ny)))
    x, y = np.tile(x, ny), np.repeat(y[::-1], nx)
    for column, order in ((z, (0, 0)), (zx, (1, 0)), (zy, (0, 1)), (zxy, (1, 1))):
        # scattered and grid evaluation differ by rounding only
        wanted = surface(x, y, order)
        assert column == pytest.approx(wanted, abs=1e-12 * (1 + np.abs(wanted).max()))


@given(surfaces(), st.booleans())
def test_clouds_hold_points_and_unit_normals(surface, upwards):
    x, y, z, *normal = np.array(rows(cloud_text(surface, 7.0, upwards, (6, 5))), dtype=float).T
    assert z == pytest.approx(7.0 + surface(x, y), abs=1e-12)
    assert np.linalg.norm(normal, axis=0) == pytest.approx(1.0, abs=1e-15)
    assert (np.sign(normal[2]) == (1 if upwards else -1)).all()
    # perpendicular to both tangents
    for tangent in ((1.0, 0.0, surface(x, y, (1, 0))), (0.0, 1.0, surface(x, y, (0, 1)))):
        across = sum(n * t for n, t in zip(normal, tangent))
        assert np.abs(across).max() <= 1e-13 * (1 + np.abs(tangent[2]).max())


def test_numbers_read_back_bit_for_bit():
    table = np.array(rows(sag_text(TILTED, (7, 5)))[1:], dtype=float)
    x, y = np.linspace(-3, 3, 7), np.linspace(-2, 2, 5)
    assert np.array_equal(table[:, 0], TILTED.grid(x, y[::-1]).T.ravel())


def test_the_size_follows_the_least_span():
    space = THBSpace(KnotVector.uniform(3, 8), KnotVector.uniform(3, 2)).refine({0: [(0, 0)]})
    surface = FreeformSurface((4.0, 2.0), Conic(), THBSurface(space, np.ones(space.dim)))
    assert table_size(surface) == (17, 5)
    assert table_size(FreeformSurface((4.0, 2.0))) == (5, 5)


def test_refusals():
    with pytest.raises(ValueError, match="nx must be an integer of at least 5, got 4"):
        sag_text(TILTED, (4, 5))
    with pytest.raises(ValueError, match="ny must be an integer of at least 5, got 2"):
        cloud_text(TILTED, 0.0, True, (5, 2))
    with pytest.raises(ValueError, match="surface must be a FreeformSurface"):
        table_size("plane")
    narrow = KnotVector(3, [0, 0, 0, 0, 1e-9, 1, 1, 1, 1])
    space = THBSpace(narrow, narrow)
    with pytest.raises(ValueError, match="more than 10,000,000"):
        table_size(FreeformSurface((1.0, 1.0), Conic(), THBSurface(space, np.zeros(space.dim))))
