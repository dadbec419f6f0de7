"""Sources anywhere, arrays and lists: rotations by scipy, sums of single sources."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import optics
from optics.base.runtime import UserError, load_backend
from optics.light.analysis import measure
from optics.scene.luminaires import write_ies
from optics.scene.problem import OneSource, SourceArray, load_problem
from optics.scene.sources import LightSource, PlacedSource
from optics.scene.system import solvable_system, source_of
from tests.optics.scene.luminaires.cases import asymmetric

SIDES = {"front": {"half_width": (12, 12)}, "rear": {"half_width": (12, 12), "freeform": {"spans": (4, 4)}}}
POINT = {"kind": "point", "half_angle": 20.0}


def problem(source, **target):
    return optics.Problem(
        source=source,
        lens={"index": 1.5, "thickness": 6, **SIDES},
        target={"kind": "tophat", "distance": 60, "half_width": (30, 30), "pixels": (12, 12), **target},
    )


def placed(x, **changes):
    return POINT | {"position": (x, 0.0, -30.0)} | changes


@pytest.mark.parametrize(
    "keys", [{"kind": "lambertian", "half_width": (1, 2), "half_angle": 30.0}, POINT], ids=["area", "point"]
)
def test_a_tilted_source_is_the_plain_one_turned_about_its_middle(keys):
    place, tilt = np.array([3.0, -2.0, -25.0]), (10.0, -20.0, 30.0)
    plain = source_of(problem(keys)).rays((8, 8))
    there = source_of(problem(keys | {"position": tuple(place), "tilt": tilt})).rays((8, 8))
    turn = Rotation.from_euler("XYZ", tilt, degrees=True)
    middle = np.array([0.0, 0.0, -2.0])
    np.testing.assert_allclose(there.origin.T, turn.apply(plain.origin.T - middle) + place, atol=1e-13)
    np.testing.assert_allclose(there.direction.T, turn.apply(plain.direction.T), atol=1e-14)
    np.testing.assert_array_equal(there.flux, plain.flux)


def test_a_source_that_is_placed_where_it_stands_makes_the_same_cells():
    places = {}, {"position": (0, 0, -2)}
    plain, there = (source_of(problem(POINT | k)).cells((6, 6)).rays() for k in places)
    np.testing.assert_allclose(there.origin, plain.origin, atol=1e-15)
    np.testing.assert_array_equal(there.direction, plain.direction)


@pytest.mark.slow
def test_the_light_of_a_list_is_the_sum_of_the_light_of_each():
    backend = load_backend("double", 1)
    lists = [placed(-3, flux=2.0), placed(4, weight=0.5)], [placed(-3, flux=2.0)], [placed(4, weight=0.5)]
    both, *alone = (solvable_system(problem(sources)) for sources in lists)
    light = [measure(system, backend) for system in (both, *alone)]
    assert both.problem.flux == 2.5
    total = light[1].irradiance + light[2].irradiance
    off, error = np.linalg.norm(light[0].irradiance - total), light[0].metrics["rel_l2_floor"]
    assert off < 4 * error * np.linalg.norm(light[0].target)  # rays, and cells of each alone
    flux = sum(one.metrics["efficiency"] * system.problem.flux for one, system in zip(light[1:], alone))
    assert light[0].metrics["efficiency"] * 2.5 == pytest.approx(flux, rel=1e-3)


def test_an_array_is_a_list_of_its_sources():
    x = [-2.0, 2.0]
    array = source_of(problem(placed(0, array=SourceArray(columns=2, rows=1, pitch=(4, 4)))))
    listed = source_of(problem([placed(-2), placed(2)]))
    np.testing.assert_array_equal(array.rays((8, 8)).origin, listed.rays((8, 8)).origin)
    assert sorted({float(a) for a in array.starts()[0]}) == x
    assert array.flux == listed.flux == 2.0


def test_a_list_of_a_file_is_read_and_one_key_of_it_changes(tmp_path):
    path, listed = tmp_path / "two.toml", problem([placed(-3), placed(4, name="B")])
    text = listed.to_toml().replace("[source]", "[[source]]").replace("[[source.others]]", "[[source]]")
    path.write_text(text)
    read = load_problem(path, {"source.others.B.weight": 0.25})
    assert [one.weight for one in read.source.each] == [1.0, 0.25]
    assert load_problem(path) == listed


@pytest.mark.parametrize(
    ("sources", "words"),
    [
        ([placed(0), placed(1, unit="lm")], "source.unit must be that of the first source"),
        ([placed(0, weight=0.0)], "source.weight is 0 of every source"),
        ([placed(0, weight=1e-300)], "must be 0 or at least 1e-12"),
        ([placed(0), placed(1, file="x.ray")], "source[1].file has no effect with"),
        (
            {"kind": "collimated", "half_width": (9, 9), "tilt": (5, 0, 0), "divergence": 1.0},
            "along the axis only",
        ),
        ([placed(0), placed(1, kind="lambertian")], "source 2 of the list: source.half_width"),
        (POINT | {"turn": (5, 0, 0)}, "set source.tilt, or set source.kind"),
        (
            [placed(0, name="A"), placed(1), placed(2, name="C", array={"columns": 0})],
            "columns must be at least 1",
        ),
        ([placed(0), placed(20.0, position=(0, 0, 3.0))], "behind the front"),
    ],
)
def test_sources_that_cannot_be_added_are_refused_in_a_sentence(sources, words):
    with pytest.raises(UserError, match=re.escape(words)):
        solvable_system(problem(sources))


def test_a_source_is_placed_by_position_tilt_or_array():
    assert not OneSource(**POINT).placed
    assert OneSource(**POINT, tilt=(1, 0, 0)).placed


def test_a_start_is_refused_where_the_brightest_source_sends_no_light_to_the_lens():
    """Another source lights it, so that nothing else tells."""
    away = problem([placed(-3, flux=2.0, tilt=(180, 0, 0)), placed(4)])
    system = optics.System(away)
    with pytest.raises(UserError, match="of several the brightest, sends no light"):
        system.transport_start(system.space())


@pytest.mark.parametrize(
    ("own", "words"), [("sun", "an object of a class"), (2.0, "must be that of the problem")]
)
def test_a_source_of_a_script_is_a_light_source_of_the_flux_of_the_problem(own, words):
    """Else shares of light are counted by another flux: an efficiency of 184 %."""
    plain = problem(POINT | {"distance": 20.0})
    source = source_of(plain)
    optics.System(plain, source=source)
    with pytest.raises(UserError, match=words):
        optics.System(plain, source=own if isinstance(own, str) else replace(source, flux=own))


@pytest.mark.parametrize(
    "keys",
    [
        {
            "kind": "lambertian",
            "half_width": (1, 2),
            "half_angle": 30.0,
            "profile": "gaussian",
            "sigma": (1, 1),
        },
        {"kind": "collimated", "half_width": (4, 4), "profile": "round"},
        POINT,
    ],
    ids=["lambertian", "beam", "point"],
)
def test_a_placed_source_says_of_its_light_what_the_plain_one_says(keys):
    """A property that it forgot would be that of light of a known intensity on the axis."""
    plain, there = (source_of(problem(keys | place)) for place in ({}, {"tilt": (0.0, 0.0, 1e-3)}))
    same = (
        "spread",
        "extended",
        "etendue",
        "cone",
        "assumed",
        "beam",
        "by_rays",
        "scalable",
        "emitter",
        "told",
    )
    for name in same:
        assert getattr(there, name) == getattr(plain, name), name
    at, sizes = np.linspace(-1, 1, 7), (there.image[1], plain.image[1])
    assert sizes[0] == sizes[1]
    for mine, own in ((there.profile, plain.profile), (there.image[0], plain.image[0])):
        np.testing.assert_array_equal(mine(at, at), own(at, at))


def test_nothing_that_is_known_of_light_is_forgotten_where_it_is_placed():
    """What a PlacedSource neither passes on nor says itself would be that of no light in particular."""
    own = {"from_afar", "axial", "several", "each", "collimated", "diverging", "lone"}
    known = {n for n, v in vars(LightSource).items() if isinstance(v, property | bool)}
    assert known - own <= set(vars(PlacedSource))


def test_a_placed_luminaire_has_the_opening_of_its_file(tmp_path):
    write_ies(asymmetric(), tmp_path / "lamp.ies")
    lamp = {"kind": "luminaire", "file": str(tmp_path / "lamp.ies"), "flux": 100.0, "half_width": (0, 0)}
    plain, there = (
        solvable_system(problem(lamp | place)) for place in ({"distance": 25}, {"position": (0, 0, -25)})
    )
    assert there.problem.source.half_width == plain.problem.source.half_width
    assert any(there.problem.source.half_width)
