"""Variants: values of a command line, their combinations, a real design of one, and the table of all."""

from dataclasses import asdict
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st
from PIL import Image

import optics
from optics.base.runtime import UserError
from optics.exchange.results import fingerprint
from optics.interface.sweeps.sweep_rows import Sweep, SweepRow
from optics.interface.sweeps.variant_work import Shared, Work, designed
from optics.interface.sweeps.variants import all_variants, checked_ranges, value_list
from tests.optics.interface.sweeps.cases import PICTURE, problem


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
    given = problem(**PICTURE, **{"target.image": str(tmp_path / "none.png")})
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


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("target.distance=200:400:5", [200, 250, 300, 350, 400]),
        ("target.distance = 0.1:0.3:3", [0.1, 0.2, 0.3]),
        ("target.distance=3:1:3", [3, 2, 1]),
        ("target.distance=1e2:1e2:1", [100]),
        ("lens.rear.freeform.max_level=1:3:3", [1, 2, 3]),
        ("lens.rear.half_width=[[30,30],[40,40]]", [[30, 30], [40, 40]]),
        ("target.distance=300", [300]),
        ('optimizer.engine=["exact", "camera"]', ["exact", "camera"]),
        ("target.image=['a.png', '/b.png']", ["/x/a.png", "/b.png"]),
        ("title=a:b:c", ["a:b:c"]),
        ("title='[a, b]'", ["[a, b]"]),
    ],
)
def test_values_of_a_key(text, values):
    key, found = value_list(text, Path("/x"))
    assert key == text.partition("=")[0].strip()
    assert found == values
    assert list(map(type, found)) == list(map(type, values))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("target.distance", "sets no key"),
        ("target.distence=1:2:3", r"unknown key target.distence \(did you mean target.distance"),
        ("target.distance=1:2", "must be a number"),
        ("target.distance=1:2:0", "count of a range must be from 1 to 100000, got 0"),
        ("target.distance=1:2:2.5", "count of a range"),
        ("target.distance=1:2:nan", "count of a range"),
        ("target.distance=1:2:1e9", "count of a range"),
        ("target.distance=1:inf:3", "both ends of a range must be finite"),
        ("target.distance=1:2:snan", "count of a range"),
        ("target.distance=snan:2:3", "both ends of a range must be finite"),
        ("target.distance=1e99999:1e99999:1", "both ends of a range must be finite"),
        ("target.distance=1:2:1", "one value must begin and end with it"),
        ("target.distance=[1, 2", "must be a number"),
        ("target.distance=50,60", r"write several values in brackets, target.distance=\[50,60\], got 50,60"),
        ("target.distence=50,60", r"unknown key target.distence"),
        ("title=[a, b]", r'\[a, b\] is no list for title: put texts in quotes, such as title=\["a", "b"\]'),
        ("target.image=[F.png, wide.png]", "put texts in quotes, such as target.image="),
        ("optimizer.engine=[exact, camera]", "put texts in quotes"),
        ("target.image=['a.png'", "put texts in quotes"),
    ],
)
def test_what_gives_no_values_is_refused(text, sentence):
    with pytest.raises(UserError, match=sentence):
        value_list(text, Path("/x"))


@given(st.integers(-999, 999), st.integers(-999, 999), st.integers(2, 50))
def test_both_ends_belong_to_a_range_and_steps_are_even(start, stop, count):
    _, found = value_list(f"target.distance={start}:{stop}:{count}", Path("/x"))
    assert (found[0], found[-1], len(found)) == (start, stop, count)
    steps = [b - a for a, b in pairwise(found)]
    assert max(steps) - min(steps) < 1e-9


class Counted(dict):
    """Metrics that count how often their names are listed."""

    listed = 0

    def __iter__(self):
        self.listed += 1
        return super().__iter__()


def test_names_of_metrics_are_collected_once_however_many_rows_there_are():
    metrics = [Counted(rel_l2=0.1 * k) for k in range(20)]
    found = Sweep(Path("out"), ("x",), [SweepRow((k,), "done", metrics=m) for k, m in enumerate(metrics)])
    assert [line["rel_l2"] for line in found.table()] == [0.1 * k for k in range(20)]
    assert {m.listed for m in metrics} == {1}


def test_a_row_without_a_metric_has_none_in_its_column():
    rows = [SweepRow((1,), "done", metrics={"dof": 9}), SweepRow((2,), "failed", "why")]
    assert [line["dof"] for line in Sweep(Path("out"), ("x",), rows).table()] == [9, None]


SMALL = {
    "target.pixels": [24, 24],
    "lens.rear.freeform.max_level": 0,
    "optimizer.iterations": 1,
    "optimizer.start": "flat",
}


@pytest.fixture
def picture(tmp_path):
    path = tmp_path / "light.png"
    Image.fromarray(np.linspace(0, 255, 24 * 24).reshape(24, 24).astype(np.uint8)).save(path)
    return path


def test_a_variant_is_that_design_and_its_picture_travels_by_content(picture):
    given = problem(**SMALL, **PICTURE, **{"target.image": str(picture)})
    wanted = optics.design(given.with_(**{"target.distance": 250, "run.threads": 1}))
    shared = Shared(given, {str(picture): picture.read_bytes()})
    picture.unlink()
    found = designed(shared, Work({"target.distance": 250}, keep_lens=True))
    assert found.metrics["rel_l2"] == wanted.metrics["rel_l2"]
    assert found.metrics["fates_w.on_target"] == wanted.metrics["fates_w"]["on_target"]
    assert found.picture.startswith(b"\x89PNG")
    assert '"thbcad-lens"' in found.lens


@pytest.mark.slow
def test_pictures_can_be_varied(picture, tmp_path):
    other = tmp_path / "other.png"
    Image.open(picture).transpose(Image.Transpose.FLIP_LEFT_RIGHT).save(other)
    given = problem(**SMALL, **PICTURE, **{"target.image": str(picture)})
    ranges = {"target.image": [str(picture), str(other)]}
    found = optics.sweep(given, ranges, tmp_path / "out", workers=2)
    assert found.counts()["done"] == 2
    assert found.rows[0].metrics["rel_l2"] != found.rows[1].metrics["rel_l2"]
    assert fingerprint(given) != fingerprint(given.with_(**{"target.image": str(other)}))


def test_paths_within_tables_start_from_the_problems_folder_too(tmp_path):
    _, values = value_list('target=[{kind="image", image="a.png"}, {kind="image", image=""}]', tmp_path)
    assert [value["image"] for value in values] == [str(tmp_path / "a.png"), ""]
