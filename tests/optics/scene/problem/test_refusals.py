"""Bad problem files: every one is refused in one sentence."""

import datetime
import math
import re
from typing import get_args, get_origin

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.scene.keys import assignment, keys_of, problem_to_toml
from optics.scene.problem import Problem
from tests.optics.cases import SMALL, target_z, toml_text, toml_value
from tests.optics.scene.problem.cases import EXTENDED, REQUIRED, load_text, load_values, refusal


def refused(folder, values):
    """Return the sentence with which the small problem with these values is refused."""
    return refusal(load_values, folder, SMALL | values)


# ---- bad files ----


DATE = datetime.date(2000, 1, 1)
OF_OTHER_TYPES = {  # by the type of a key: what it must be, and what is something else
    str: ("a string|one of", (1, True, [], 1.5)),
    bool: ("true or false", (1, "true", [True])),
    float: ("a (finite )?number", ("6", True, math.nan, -math.inf, [1.0], {"a": 1}, DATE)),
    int: ("a whole number|larger than", (1.5, 2.0, "2", False, math.nan, [2], 10**30)),
    tuple[float, float]: (
        "a list of 2 numbers|a (finite )?number",
        (0.5, [], [0.5], [0.5] * 3, [0.5, "a"], [0.5, True], [math.nan, 0.5]),
    ),
    tuple[int, int]: (
        "a list of 2 numbers|a whole number",
        (4, [4], [4] * 3, [4, "a"], [4, True], [4.0] * 2),
    ),
}
# not of tables that may be absent, and of spectra, which have tests of their own
PLAIN = [
    key
    for key in keys_of(Problem)
    if not re.match(r"(element|path|stop|source\.others)\b|.*\b(array|body|zone|spectrum)\b", key.name)
]
HALF_WIDTHS = [f"{part}.half_width" for part in ("source", "lens.front", "lens.rear", "target")]
BAD = [
    *(
        (key.name, bad, words)
        for key in PLAIN
        for kind in (key.hint, *(get_args(key.hint)[:1] if get_origin(key.hint) is not tuple else ()))
        for words, values in (OF_OTHER_TYPES.get(kind, ("", ())),)
        for bad in values
        if bad != -math.inf or not key.name.endswith("radius")  # a plane
    ),
    *(
        (key.name, math.inf, "a finite number|at most")
        for key in PLAIN
        if float in (key.hint, *get_args(key.hint)[:1]) and get_origin(key.hint) is not tuple
        if not key.limits["infinite"]
    ),
    *((key.name, "other", "one of") for key in PLAIN if key.limits and key.limits["choices"]),
]
NAMES = "export.author", "export.organization", "export.product", "lens.material"
OUT_OF_RANGE = [
    *((key, bad) for key in NAMES for bad in ("two\nlines", " blank")),
    *((key, bad) for key in HALF_WIDTHS for bad in ([9.5, 0], [-1.0, 9.5])),
    *((f"lens.{face}.radius", bad) for face in ("front", "rear") for bad in (0, 0.0, -0.0, "plane")),
    *((f"lens.{face}.freeform.{key}", 0) for face in ("front", "rear") for key in ("degree", "z_freedom")),
    *((key, bad) for key in ("source.flux", "lens.thickness", "target.distance") for bad in (0.0, -1.0)),
    ("verify.volume", 0.0),
    ("lens.index", 1.0),
    ("lens.index", 0.5),
    ("source.half_angle", 0.0),
    ("source.image", "a\0b.png"),
    ("target.image", "a\0b.png"),
    ("lens.front.freeform", 3),
    ("lens.front.freeform", "rough"),
    ("lens.front.freeform.spans", [4, 0]),
    ("run.seed", -5),
    ("optimizer.iterations", []),
    ("optimizer.iterations", [5, 0]),
    ("optimizer.iterations", [5, "6"]),
    ("optimizer.lost_flux_weight", -0.5),
    ("refinement.alpha", [0.0, -0.1]),
    ("refinement.alpha", "0.3"),
]


def assert_refused(folder, key, bad, words="must|larger than|takes"):
    text = toml_text(SMALL | {key: "DATE" if bad is DATE else bad}).replace('"DATE"', "2000-01-01")
    message = refusal(load_text, folder, text)
    assert key in message, bad
    assert re.search(words, message), bad
    assert str(folder / "problem.toml") in message, bad


@pytest.mark.parametrize("key", sorted({key for key, *_ in BAD}))
def test_values_of_another_type_are_refused_by_name_with_what_is_wanted(tmp_path, key):
    for _, bad, words in (case for case in BAD if case[0] == key):
        assert_refused(tmp_path, key, bad, words)


@pytest.mark.parametrize("key", sorted({key for key, _ in OUT_OF_RANGE}))
def test_values_out_of_range_are_refused_by_name(tmp_path, key):
    for bad in (value for name, value in OUT_OF_RANGE if name == key):
        assert_refused(tmp_path, key, bad)


LIMITS = {
    "source.distance": (0.0, None),
    "source.half_angle": (None, 90.0),
    "source.exponent": (0.0, 1000.0),
    "lens.front.freeform.degree": (2, 10),
    "lens.front.freeform.max_level": (0, 12),
    "lens.rear.freeform.degree": (2, 10),
    "lens.rear.freeform.max_level": (0, 12),
    "target.pixels": ([2, 2], [4096, 4096]),
    "lens.rear.freeform.spans": ([1, 1], [1000, 1000]),
    "optimizer.iterations": ([1], [100_000]),
    "optimizer.memory": (1, 100),
    "optimizer.sigma": (0.3, 2.5),
    "optimizer.rays_per_pixel": (0.5, 16.0),
    "verify.rays": (8, 2049),
    "run.threads": (0, 1024),
}


ACTING = {  # what gives a key of LIMITS an effect
    "source.half_angle": {"source.kind": "point"},
    "source.exponent": {"source.kind": "point"},
    "optimizer.sigma": {"optimizer.window": "gaussian"},
}


def beyond(limit, direction):
    if isinstance(limit, list):
        return [beyond(limit[0], direction), *limit[1:]]
    return limit + direction if isinstance(limit, int) else math.nextafter(limit, direction * math.inf)


@pytest.mark.parametrize("key", LIMITS)
def test_limits_belong_to_what_is_allowed_and_nothing_beyond(tmp_path, key):
    for limit, direction in zip(LIMITS[key], (-1, 1)):
        if limit is not None:
            load_values(tmp_path, SMALL | ACTING.get(key, {}) | {key: limit})
            number, word = np.ravel(limit)[0], "least" if direction < 0 else "most"
            told = refused(tmp_path, {key: beyond(limit, direction)})
            assert re.search(rf"{key}.* must be at {word} {number:g}\b", told)


@pytest.mark.parametrize("key", REQUIRED)
def test_a_missing_key_is_named(tmp_path, key):
    values = SMALL | {"lens.front.conic": 0.0}  # so that no table is left empty
    with pytest.raises(UserError, match=rf"the key {key} is missing.*add it"):
        load_values(tmp_path, {k: v for k, v in values.items() if k != key})


@pytest.mark.parametrize("table", ["source", "lens", "target", "lens.front", "lens.rear"])
def test_a_missing_table_is_named(tmp_path, table):
    with pytest.raises(UserError, match=rf"the key {table}\b.*missing"):
        load_values(tmp_path, {k: v for k, v in SMALL.items() if not k.startswith(table + ".")})


FAR = {"target.distance": math.inf}
PARTNERS = [
    ({"source.profile": "image"}, "the key source.image is missing"),
    ({"source.profile": "round_gaussian", "source.sigma": [1e-3, 1.0]}, "source.sigma must be at least"),
    ({"source.profile": "image", "source.image": ""}, "the key source.image is missing"),
    ({"target.image": ""}, "the key target.image is missing"),
    (
        {"source.kind": "point", "source.half_width": [0, 0], "source.distance": 0},
        "source.distance must be at least 1e-06 for a point, which would lie in the lens, got 0.0",
    ),
    *(
        (
            {"source.kind": kind, "source.half_width": pair},
            f"source.half_width must be at least 1e-06 for a {kind} source, got {shown}",
        )
        for kind in ("collimated", "lambertian")
        for pair, shown in (([0, 0], "[0.0, 0.0]"), ([3.0, 0.0], "[3.0, 0.0]"), ([0.0, 2.0], "[0.0, 2.0]"))
    ),
    *(
        (
            FAR | {"target.half_width": pair},
            "target.half_width must be less than 90 degrees in the far field, got ",
        )
        for pair in ([90.0, 20.0], [20.0, 90.5], [1000.0, 1000.0])
    ),
]


@pytest.mark.parametrize(("changes", "sentence"), PARTNERS, ids=str)
def test_keys_that_do_not_go_together_are_refused(tmp_path, changes, sentence):
    message = refused(tmp_path, changes)
    assert sentence in message
    assert message.startswith(f"{tmp_path / 'problem.toml'}: ")


@pytest.mark.parametrize("kind", ["collimated", "lambertian"])
def test_a_source_without_a_size_is_refused_by_name(tmp_path, kind):
    values = {k: v for k, v in SMALL.items() if k != "source.half_width"} | {"source.kind": kind}
    with pytest.raises(UserError, match=r"source\.half_width"):
        load_values(tmp_path, values)


FINE = [
    {"source.kind": "point", "source.half_width": [0, 0], "source.distance": 1e-3},
    {"source.kind": "lambertian", "source.distance": 0},
    FAR | {"target.half_width": [89.9, 1e-3]},
    {"target.half_width": [1000.0, 90.0]},
    {"source.profile": "round", "source.image": ""},
]


@pytest.mark.parametrize("changes", FINE, ids=str)
def test_limits_hold_only_where_they_matter(tmp_path, changes):
    problem = load_values(tmp_path, SMALL | changes)
    assert load_text(tmp_path, problem_to_toml(problem)) == problem


def test_a_point_needs_no_size(tmp_path):
    values = {k: v for k, v in SMALL.items() if k != "source.half_width"} | {"source.kind": "point"}
    assert load_values(tmp_path, values).source.half_width == (0.0, 0.0)


def test_the_far_field_is_at_infinity(tmp_path):
    problem = load_values(tmp_path, EXTENDED)
    assert target_z(problem) == math.inf
    assert "distance = inf" in problem_to_toml(problem)


def test_a_free_front_takes_the_defaults_of_a_free_surface(tmp_path):
    text = toml_text(SMALL) + "[lens.front.freeform]\n"
    front = load_text(tmp_path, text).lens.front.freeform
    assert vars(front) == {"degree": 3, "spans": (7, 7), "max_level": 5, "z_freedom": 5.0}


@pytest.mark.parametrize(
    "key",
    [
        "colour",
        "source.colour",
        "lens.front.freeform.colour",
        "lens.rear.freeform.colour",
        "run.colour",
        "sources.kind",
    ],
)
def test_an_unknown_key_is_named_with_those_that_exist(tmp_path, key):
    message = refused(tmp_path, {key: 1})
    assert f"unknown key {key.split('.')[0] if key.startswith('sources') else key}" in message
    assert ("title" if "." not in key or key.startswith("sources") else "takes") in message


def test_a_value_in_the_place_of_a_table_is_refused(tmp_path):
    text = toml_text({k: v for k, v in SMALL.items() if not k.startswith("source.")}).replace(
        'title = "small"', 'title = "small"\nsource = 3'
    )
    with pytest.raises(UserError, match=r"source must be a table, got 3"):
        load_text(tmp_path, text)


@pytest.mark.parametrize("name", ["line\nbreak", "bell\x07", "esc\x1b[31m"])
def test_messages_stay_on_one_line_whatever_the_key(tmp_path, name):
    told = refusal(load_text, tmp_path, f"{toml_value(name)} = 1\n" + toml_text(SMALL))
    assert "unknown key" in told
    assert told.isprintable()


@pytest.mark.parametrize("key", ["title", "lens.material", "target.image"])
def test_half_a_letter_is_refused(tmp_path, key):
    """A name of bytes that are no UTF-8 text comes as lone surrogates; no file could hold it."""
    problem = load_values(tmp_path, SMALL)
    with pytest.raises(UserError, match=rf"{re.escape(key)} must be text that UTF-8 can hold"):
        problem.with_(**{key: "Gr\udcc3"})


def test_a_picture_in_a_folder_whose_name_is_no_text_is_refused(tmp_path):
    (tmp_path / "folder\udcff").mkdir()
    with pytest.raises(UserError, match=r"target\.image must be text that UTF-8 can hold, got .*; rename"):
        load_values(tmp_path / "folder\udcff", SMALL)


def test_messages_stay_short_whatever_the_value(tmp_path):
    assert refused(tmp_path, {"lens.thickness": "x" * 100_000})


def test_a_change_of_a_key_of_many_parts_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"the key a\.a.* has more than 16 parts"):
        load_values(tmp_path, SMALL).with_(**{"a" + ".a" * 100_000: 1})


@pytest.mark.parametrize(
    "value", ["{a" + ".a" * 30_000 + "=1}", "[" * 100_000, "1\n[a" + ".a" * 30_000 + "]"]
)
def test_an_assignment_of_many_parts_is_refused(value):
    assert "lens must be a table" in refusal(assignment, f"lens={value}", Problem)


@pytest.mark.parametrize("table", ["target", "lens.rear"])
def test_several_of_a_table_are_refused_with_the_table_to_write(tmp_path, table):
    text = toml_text(SMALL).replace(f"[{table}]", f"[[{table}]]", 1)
    with pytest.raises(UserError, match=rf"{table} must be a table, \[{table}\], and there is one; got \["):
        load_text(tmp_path, text)


@pytest.mark.parametrize("key", ["beam_angle", "field_angle"])
def test_the_angles_of_a_beam_are_a_range_in_the_far_field(tmp_path, key):
    far = {"target.distance": math.inf, "target.half_width": [30.0, 30.0]}
    assert f"verify.{key} limits a beam in the far field" in refused(tmp_path, {f"verify.{key}": [9.0, 11.0]})
    turned = refused(tmp_path, far | {f"verify.{key}": [11.0, 9.0]})
    named = f"{tmp_path / 'problem.toml'}: verify.{key}"
    allowed = f"{named} must be [least, greatest] in degrees with greatest > 0, such as [9, 11]"
    assert turned == f"{allowed}, got [11.0, 9.0]"
    nothing = refused(tmp_path, far | {f"verify.{key}": [0.0, 0.0]})
    assert nothing == f"{allowed}, got [0.0, 0.0]"
    problem = load_values(tmp_path, SMALL | far | {f"verify.{key}": [9.0, math.inf]})
    assert getattr(problem.verify, key) == (9.0, math.inf)
