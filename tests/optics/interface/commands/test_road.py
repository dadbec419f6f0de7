"""`thbcad road`: a luminaire file and a designed lens over a road, beside a class of EN 13201."""

import numpy as np
import pytest

from optics.interface.commands.cli import main
from optics.interface.commands.making_options import ROAD_CLASSES, ROAD_ROWS
from optics.light.roads import CLASSES, ROWS
from tests.cases import EXAMPLES
from tests.optics.cases import DOME
from tests.optics.interface.commands.cases import data_of, printed, refused

LAMP = str(EXAMPLES / "lamp.ies")
POLES = "--height", "8", "--spacing", "24"
GOLDEN = """\
lamps 8 m high, 24 m apart, rows: right; 2 lanes of 3.5 m, maintenance 0.8
99.9982 lm leave each lens or plate, 30 in a lamp
ok     mean illuminance: 6.03 lx (at least 5)
ok     mean illuminance, for uniformity: 6.03 lx (at most 7.5)
ok     least illuminance: 2.18 lx (at least 1)
uniformity U0 of the illuminance, least over mean: 0.36
class P4 of EN 13201-2:2015 is kept
"""


def test_the_parser_knows_the_classes_and_the_rows():
    assert tuple(CLASSES) == ROAD_CLASSES
    assert tuple(ROWS) == ROAD_ROWS


def test_a_luminaire_file_is_judged_as_before(capsys):
    said = printed(capsys, "road", LAMP, "--class", "P4", *POLES, "--overhang", "3.5", "--lenses", "30")
    assert said.endswith(GOLDEN)
    opposite = "--class", "P5", *POLES, "--rows", "opposite", "--lenses", "20"
    data = data_of(capsys, "road", LAMP, *opposite, code=1)  # too bright to be even
    assert [c["ok"] for c in data["checks"]] == [True, False, True]
    assert data["installation"]["rows"] == "opposite"
    assert data["flux_lm"] == pytest.approx(99.9982, rel=1e-6)
    mean, _, least = (c["value"] for c in data["checks"])
    assert data["uniformity"] == pytest.approx(least / mean)


def test_classes_m_are_judged_with_an_r_table(capsys, tmp_path):
    table = tmp_path / "road.txt"
    np.savetxt(table, np.full((29, 20), 300.0))
    command = ["road", LAMP, "--class", "M6", *POLES, "--lenses", "60", "--r-table", str(table)]
    assert main([*command, "--full"]) in (0, 1)
    out = capsys.readouterr().out
    assert f"{table}: specular factor S1 = 1\n" in out
    for name in ("mean luminance", "uniformity Uo", "uniformity Ul", "increment fTI", "ratio REI"):
        assert name in out


def test_a_lens_is_judged_in_lumens_with_errors(capsys, stored):
    folder = str(stored(DOME | {"source.unit": "lm", "source.flux": 400.0}, drop=("target.image",)))
    data = data_of(capsys, "road", folder, "--class", "P6", *POLES, "--rays", 4096, "--step", 10, code=1)
    assert 300 < data["flux_lm"] < 400
    assert 0 < data["noise"] < 0.5
    mean = data["checks"][0]
    assert 0 < mean["error"] < data["noise"] * mean["value"]  # a mean over many directions


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (
            "--class M4",
            "classes M are judged by the luminance of a road surface; give its r-table by --r-table",
        ),
        ("--class P4 --height 1", "--height must be from 2 to 100 m, got 1 m"),
        ("--class P4 --spacing nan", "--spacing must be from 1 to 1000 m, got nan m"),
        ("--class P4 --lanes 0", "--lanes must be from 1 to 20, got 0"),
        ("--class P4 --lane-width 0", "--lane-width must be from 0.5 to 50 m, got 0 m"),
        ("--class P4 --maintenance 1.2", "--maintenance must be from 0.01 to 1, got 1.2"),
        ("--class P4 --r-table none.txt", "cannot read none.txt: No such file"),
        ("--class P7", "invalid choice: 'P7'"),
    ],
)
def test_what_makes_no_road_is_refused(capsys, words, sentence):
    assert sentence in refused(capsys, "road", LAMP, *POLES, *words.split())


def test_watts_are_refused(capsys, stored):
    folder = stored(DOME, drop=("target.image",))
    command = "road", folder, "--class", "P4", *POLES, "--rays", "64", "--step", "30"
    assert "roads are judged in lumens, and the source of" in refused(capsys, *command)
