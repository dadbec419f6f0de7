"""What is said of how a lens is made: positions of extremes, rows, data."""

import json
from math import inf, isfinite

import numpy as np
import pytest

from optics.scene.limits import LitPart, as_data, manufacture_rows, position
from tests.optics.scene.problem.cases import DENSITY, FREE_FRONT, designed
from thbcad.certified import Enclosure
from thbcad.lens import manufacturability, radii_within


def test_positions_on_an_axis_are_zero_and_not_what_rounding_left():
    text = position(Enclosure(lower=1.0, upper=1.0, value=1.0, u=-3.55e-15, v=12.34567))
    assert text == "at x = 0, y = 12.35 mm"


def test_rows_name_every_figure_once(tmp_path):
    _, lens, found = designed(tmp_path, FREE_FRONT)
    rows = manufacture_rows(found, 550.0)
    names = [name for name, *_ in rows]
    assert len(set(names)) == len(names)
    by_name = {name: (value, unit, place) for name, value, unit, place in rows}
    assert by_name["volume"] == (lens.volume(), "mm^3", "")
    assert by_name["mass"] == (lens.volume() * DENSITY / 1000, "g", "")
    assert by_name["centre thickness"] == (found.centre_thickness.value, "mm", "at x = 0, y = 0 mm")
    assert by_name["smallest feature of the rear"] == (
        pytest.approx(15 / 550e-6),
        "wavelengths",
        "on level 0",
    )
    assert by_name["smallest feature of the front in y"] == (pytest.approx(15.0), "mm", "on level 0")
    assert by_name["smallest feature of the front in x"] == (pytest.approx(20.0), "mm", "on level 0")
    assert [name for name in names if name.endswith("of the front")] == [
        name.replace("rear", "front") for name in names if name.endswith("of the rear")
    ]
    assert "mass" not in [name for name, *_ in manufacture_rows(manufacturability(lens), 550.0)]


def test_radii_where_light_goes_are_told_apart_from_those_of_the_rim(tmp_path):
    _, lens, found = designed(tmp_path)
    lit = {"rear": LitPart((4.0, 3.0), *radii_within(lens, "rear", (4.0, 3.0)))}
    rows = {name: value for name, value, *_ in manufacture_rows(found, 550.0, lit=lit)}
    assert rows["least concave radius of the rear where light meets it"] == lit["rear"].concave.value
    assert rows["least concave radius of the rear"] <= lit["rear"].concave.value
    assert "least concave radius of the front where light meets it" not in rows
    data = as_data(found, lit)
    assert data["front"]["lit_part"] is None
    assert data["rear"]["lit_part"]["half_width_mm"] == [4.0, 3.0]
    assert data["rear"]["lit_part"]["concave_radius_mm"]["value"] == lit["rear"].concave.value


def test_a_plane_is_nowhere_concave(tmp_path):
    _, _, found = designed(tmp_path)
    rows = {name: (value, place) for name, value, _, place in manufacture_rows(found, 550.0)}
    assert rows["least concave radius of the front"] == (inf, "nowhere concave")
    assert "range of the sag of the front" not in rows


def test_the_data_are_plain_json(tmp_path):
    _, _, found = designed(tmp_path)
    data = as_data(found)
    assert json.loads(json.dumps(data, allow_nan=False)) == data
    assert data["front"]["convex_radius_mm"] == {
        "value": None,
        "lower": None,
        "upper": None,
        "x": None,
        "y": None,
    }
    assert data["front"]["sag_mm"] is data["front"]["feature"] is None
    assert data["rear"]["feature"] == {"level": 0, "span_mm": [5.0, 5.0], "size_mm": [15.0, 15.0]}
    assert data["mass_g"] == found.mass
    assert data["density_g_cm3"] == DENSITY
    for bound in (
        data["thickness_mm"],
        data["rear"]["slope_degrees"],
        data["rear"]["heights_mm"],
        data["rear"]["concave_radius_mm"],
    ):
        assert bound["lower"] <= bound["value"] <= bound["upper"]
        assert all(isfinite(number) for number in bound.values() if np.isscalar(number))
