"""The smoothest light of a table: it keeps table and flux, and no other light that does bends less."""

import numpy as np
import pytest

from optics.scene.receivers import FarField, Screen, smoothest_light, zone_places, zone_rows

SCREEN = Screen((10.0, 8.0), (60, 48), receiver=FarField())
TABLE = (([[0, 0]], 8.0, 12.0), ([[5, 0]], 1.0, np.inf), ([[-5, 1]], 2.0, np.inf), ([[0, -5]], 0.0, 0.5))
KEPT = 1e-3  # the weights of rows leave them so much
FLUX = 250.0


def rows(margin):
    found = []
    for points, least, greatest in TABLE:
        at = zone_places("points", points, SCREEN)
        found += zone_rows("", at, SCREEN, (least, greatest, 0.0), margin)
    return found


def bending(light):
    """Return int f_xx^2 + 2 f_xy^2 + f_yy^2 by differences, dark around the screen."""
    f, (px, py) = np.pad(light, 3), SCREEN.pitch
    xx, yy = np.diff(f, 2, axis=1) / px**2, np.diff(f, 2, axis=0) / py**2
    xy = np.diff(np.diff(f, axis=0), axis=1) / (px * py)
    return sum(np.square(d).sum() * w for d, w in ((xx, 1), (xy, 2), (yy, 1)))


@pytest.fixture(scope="module")
def light():
    return smoothest_light(SCREEN, rows(0.2), FLUX)


def test_it_keeps_every_row_by_its_margin_and_has_the_flux_that_there_is(light):
    margins = [row.reading(light[None]).margin for row in rows(0.2)]
    assert min(margins) > 0.2 - KEPT * 2
    assert (light * SCREEN.projection()).sum() * SCREEN.pixel_area == pytest.approx(FLUX, rel=2 * KEPT)
    assert light.min() >= 0


@pytest.mark.parametrize("other", [0.3, 0.5])
def test_light_that_keeps_more_bends_more_and_so_does_what_lies_between(light, other):
    """It keeps the table too, so that the least must lie below; bending is convex."""
    more = smoothest_light(SCREEN, rows(other), FLUX)
    assert bending(light) < bending((light + more) / 2) < bending(more)


def test_rows_that_want_more_than_the_flux_are_missed_and_seen_as_such():
    dim = smoothest_light(SCREEN, rows(0.2), 10.0)
    assert min(row.reading(dim[None]).margin for row in rows(0.2)) < -0.1
    assert (dim * SCREEN.projection()).sum() * SCREEN.pixel_area < 60.0


@pytest.mark.parametrize(
    ("limits", "peak"), [((20.0, 40.0, 0.0), True), ((0.0, np.inf, 0.8), False)], ids=["peak", "share"]
)
def test_a_table_of_the_peak_alone_starts_from_even_light(limits, peak):
    table = zone_rows("alone", np.array([[1.0, 0.0]]), SCREEN, limits, 0.1, peak=peak)
    found = smoothest_light(SCREEN, table, FLUX)
    assert (found * SCREEN.projection()).sum() * SCREEN.pixel_area == pytest.approx(FLUX, rel=2 * KEPT)
    assert [row.reading(found[None]).margin >= 0 for row in table] == [True]
    assert [row.reading(0 * found[None]).margin for row in table] == [-1.0]


def test_limits_that_follow_the_peak_are_kept_where_it_comes_to_lie():
    at = zone_places("whole", (), SCREEN)
    table = [
        *zone_rows("peak", at, SCREEN, (20.0, 40.0, 0.0), 0.1, peak=True),
        *zone_rows("share", np.array([[1.0, 0.0]]), SCREEN, (0.0, np.inf, 0.8), 0.1),
        *zone_rows("aside", np.array([[4.0, 0.0]]), SCREEN, (9.0, np.inf, 0.0), 0.1),
    ]
    found = smoothest_light(SCREEN, table, FLUX)
    assert [row.reading(found[None]).margin >= 0 for row in table] == [True] * 3
