"""Combinations of values: all of them, and what is refused before anything runs."""

from dataclasses import asdict
from fractions import Fraction

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.exchange.results import fingerprint
from optics.interface.sweeps.variants import all_variants, checked_ranges
from tests.optics.interface.sweeps.cases import problem


def variants(given, **ranges):
    return all_variants(given, checked_ranges(ranges))


def test_every_combination_is_a_variant_with_its_own_identity():
    given = problem()
    found = variants(given, **{"target.distance": [200, 300], "lens.thickness": (10, 20, 30)})
    assert [v.values for v in found] == [(d, t) for d in (200, 300) for t in (10, 20, 30)]
    assert len({v.identity for v in found}) == 6
    assert found[1].identity == fingerprint(given.with_(**{"target.distance": 200, "lens.thickness": 20}))


def test_numbers_of_numpy_are_values():
    found = variants(problem(), **{"target.distance": np.linspace(200, 400, 3)})
    assert [v.values for v in found] == [(200.0,), (300.0,), (400.0,)]
    assert type(found[0].values[0]) is float


def test_values_are_what_json_holds(tmp_path):
    free = problem().lens.rear.freeform
    values = [np.int64(2), [np.int64(2)], (1, 2), tmp_path / "a.png", free, {"image": tmp_path}]
    assert checked_ranges({"x": values})["x"] == [
        2,
        [2],
        [1, 2],
        str(tmp_path / "a.png"),
        asdict(free) | {"spans": list(free.spans)},
        {"image": str(tmp_path)},
    ]


@pytest.mark.parametrize("value", [b"a.png", 1j, {5, 6}, object, object(), Fraction(1, 2)])
def test_what_json_cannot_hold_is_refused_before_anything_is_designed(value):
    with pytest.raises(UserError, match="x must be varied over numbers, texts, paths, lists or tables, got "):
        checked_ranges({"x": [value]})


@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("target.distance", [200, -5]),
        ("target.distence", [200]),
        ("target.pixels", [160]),
        ("lens.index", [1.5, "glass"]),
        ("source.kind", ["collimated", "laser"]),
    ],
)
def test_a_value_that_no_variant_can_have_ends_the_sweep_as_with_does(key, values):
    given = problem()
    with pytest.raises(UserError) as wanted:
        given.with_(**{key: values[-1]})
    with pytest.raises(UserError) as refused:
        variants(given, **{key: values, "lens.thickness": [10, 20]})
    assert str(refused.value) == str(wanted.value)


def test_an_impossible_combination_is_a_variant_with_its_sentence():
    ranges = {"limits.thickness": [10, 35], "lens.thickness": [20, 40]}
    found = variants(problem(), **ranges)
    assert [bool(v.refusal) for v in found] == [False, False, True, False]
    assert "limits.thickness must be at most 28 mm" in found[2].refusal
    assert not found[2].identity


def test_a_missing_picture_is_named(tmp_path):
    given = problem(**{"target.kind": "image", "target.image": str(tmp_path / "none.png")})
    with pytest.raises(UserError, match=r"cannot read .*none\.png: No such file"):
        variants(given, **{"lens.thickness": [10]})


@pytest.mark.parametrize(
    ("ranges", "sentence"),
    [
        ({}, "varies at least one key"),
        ({"target.distance": []}, "at least one value"),
        ({"target.distance": 5}, "a list of values, got 5"),
        ({"target.distance": "abc"}, "a list of values"),
        ({5: [1]}, "dotted keys"),
        ({"target.distance": range(2000), "lens.thickness": range(2000)}, "at most 1000000 variants"),
    ],
)
def test_what_is_no_set_of_ranges_is_refused(ranges, sentence):
    with pytest.raises(UserError, match=sentence):
        checked_ranges(ranges)
