"""Height fields as samples: where each height lies, and which are left out."""

import numpy as np
import pytest

from thbcad.fitting.least_squares_fit import Samples, height_field_samples, least_squares
from thbcad.hierarchy import THBSpace
from thbcad.splines import KnotVector

HX, HY = 3.0, 2.0  # half-widths of an image of 4 rows and 6 columns
X = -HX + (np.arange(6) + 0.5) * 2 * HX / 6
Y = HY - (np.arange(4) + 0.5) * 2 * HY / 4
HEIGHTS = 10 * Y[:, None] + X


def test_row_0_of_an_image_is_at_the_greatest_y():
    samples = height_field_samples(HEIGHTS, X, Y)
    assert len(samples) == 24
    assert np.array_equal(samples.values, 10 * samples.v + samples.u)
    space = THBSpace(KnotVector.uniform(1, 1, -HX, HX), KnotVector.uniform(1, 1, -HY, HY))
    surface = least_squares(space, samples)
    assert surface([-3, 3, -3], [2, 2, -2]) == pytest.approx([17, 23, -23], abs=1e-12)


def test_rows_may_rise_too():
    rising = height_field_samples(HEIGHTS[::-1], X, Y[::-1])
    assert np.array_equal(rising.values, 10 * rising.v + rising.u)
    grid = Samples.grid(X, Y[::-1], HEIGHTS[::-1].T)
    assert sorted(zip(grid.u, grid.v, grid.values)) == sorted(zip(rising.u, rising.v, rising.values))


def test_heights_that_are_missing_are_left_out():
    holes = HEIGHTS.copy()
    holes[0, 1] = np.nan
    holes[2, 3] = -9999
    for samples in (
        height_field_samples(np.ma.masked_equal(holes, -9999), X, Y),
        height_field_samples(holes, X, Y, missing=holes == -9999),
        height_field_samples(holes.tolist(), X, Y, missing=(holes == -9999).tolist()),
    ):
        assert len(samples) == 22
        assert np.array_equal(samples.values, 10 * samples.v + samples.u)
        left = set(zip(X.repeat(4), np.tile(Y, 6))) - set(zip(samples.u, samples.v))
        assert left == {(X[1], Y[0]), (X[3], Y[2])}


def test_pictures_of_whole_numbers_are_height_fields():
    samples = height_field_samples(np.arange(24, dtype=np.uint16).reshape(4, 6), X, Y)
    assert samples.values.tolist() == list(range(24))


@pytest.mark.parametrize(
    ("heights", "x", "y", "missing", "message"),
    [
        (HEIGHTS.T, X, Y, None, r"4 rows y and 6 columns x needs heights \(4, 6\), got shape \(6, 4\)"),
        (HEIGHTS, X[[0, 1, 1, 2, 3, 4]], Y, None, "x must be a row of finite numbers that strictly rises or"),
        (HEIGHTS, X, Y[[0, 2, 1, 3]], None, "y must be a row"),
        (HEIGHTS, X, np.r_[Y[:3], np.nan], None, "y must be a row"),
        (HEIGHTS, X, [[1.0]], None, "y must be a row"),
        (HEIGHTS, X, Y, np.zeros((4, 6)), r"missing must be bool of shape \(4, 6\), got float64"),
        (HEIGHTS, X, Y, np.zeros((6, 4), bool), r"got bool of shape \(6, 4\)"),
        (HEIGHTS, X, Y, np.ones((4, 6), bool), "none of the 24 heights is left"),
        (HEIGHTS * np.inf, X, Y, None, r"values\[0\] is not finite"),
        (HEIGHTS * 1j, X, Y, None, "numbers must be real"),
    ],
)
def test_bad_height_fields_are_refused(heights, x, y, missing, message):
    with pytest.raises(ValueError, match=message):
        height_field_samples(heights, x, y, missing)
