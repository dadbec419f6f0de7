"""Tables of standards: where they come from, and what they hold."""

import pytest

from optics.scene.photometry import REGULATIONS, regulation
from optics.scene.problem import Target


@pytest.mark.parametrize("name", REGULATIONS)
def test_a_table_names_its_text_its_edition_and_who_compared_it(name):
    table = regulation(name)
    assert all(len(words) > 20 for words in (table.text, table.edition, table.compared))
    assert table.unit == "cd"


@pytest.mark.parametrize("name", REGULATIONS)
def test_a_table_is_its_own_mirror_image_so_that_no_side_of_the_road_is_meant(name):
    """One that is not would need `target.seen_from`: H counts to the right of a driver."""
    points = {
        (h, v, z.get("least", 0), z.get("greatest"))
        for z in regulation(name).zone
        for h, v in z.get("points", ())
    }
    assert {(-h, *rest) for h, *rest in points} == points


def test_ub2_has_19_points_and_what_class_b_asks_of_its_greatest_intensity():
    target = {"kind": "zones", "distance": float("inf"), "half_width": (16.0, 8.0)}
    zones = Target(regulation="FMVSS 108 UB2", **target).zones
    assert sum(len(zone.points) for _, zone in zones) == 19
    at = {point: (zone.least, zone.greatest) for _, zone in zones for point in zone.points}
    assert at[0, 0] == (40000, 75000)
    assert at[-9, -1.5] == (2000, float("inf"))
    assert at[0, -4] == (0, 12000)
    (name, peak), (_, middle), *_ = Target(regulation="UN R149 class B driving", **target).zones
    assert name == "UN R149 class B driving Imax"
    assert (peak.peak, peak.least, peak.greatest, middle.least_of_peak) == (True, 40500, 215000, 0.8)
    assert "nobody has compared it with the text of R149" in regulation("UN R149 class B driving").compared
