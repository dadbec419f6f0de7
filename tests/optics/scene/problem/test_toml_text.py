"""Problems written as text and read back."""

import math
import tomllib
from dataclasses import fields, is_dataclass, replace
from typing import get_args, get_type_hints

import pytest
from hypothesis import HealthCheck, given, strategies as st

from optics.base.runtime import UserError
from optics.scene.keys import problem_to_toml
from optics.scene.problem import Export, Freeform, Optimizer, Refinement, Run, Verify
from tests.cases import examples
from tests.optics.cases import SMALL
from tests.optics.scene.problem.cases import EXTENDED, MINIMAL, load_text, load_values, read_or_refused


@pytest.mark.parametrize("values", [MINIMAL, SMALL, EXTENDED], ids=["minimal", "small", "extended"])
def test_problem_survives_the_trip_through_toml(tmp_path, values):
    problem = load_values(tmp_path, values)
    assert load_text(tmp_path, problem_to_toml(problem)) == problem


@pytest.mark.parametrize("values", [MINIMAL, EXTENDED], ids=["minimal", "extended"])
def test_the_written_file_holds_every_key(tmp_path, values):
    problem = load_values(tmp_path, values)

    def compare(record, table):
        lists = ("stop", "element", "path", "others", "zone")
        written = [f for f in fields(record) if getattr(record, f.name) is not None and f.name not in lists]
        assert {f.name for f in written} == set(table)
        for f in written:
            if is_dataclass(getattr(record, f.name)):
                compare(getattr(record, f.name), table[f.name])

    compare(problem, tomllib.loads(problem_to_toml(problem)))
    assert (problem.lens.front.freeform is None) == (values is MINIMAL)


@examples(100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    title=st.text(),
    image=st.text(
        st.characters(exclude_characters="\0/", exclude_categories=("Cs",)), min_size=1, max_size=30
    ).filter(lambda s: s not in (".", "..")),
    number=st.floats(min_value=1e-12, max_value=1e12),
    radius=st.sampled_from([math.inf, -math.inf]) | st.floats(1e-3, 1e12) | st.floats(-1e12, -1e-3),
    seed=st.integers(0, 2**63 - 1),
)
def test_any_text_and_number_survives_the_trip(tmp_path, title, image, number, radius, seed):
    base = load_values(tmp_path, SMALL)
    problem = replace(
        base,
        title=title,
        source=replace(base.source, flux=number),
        lens=replace(base.lens, front=replace(base.lens.front, radius=radius)),
        target=replace(base.target, image=str(tmp_path / image)),
        run=replace(base.run, seed=seed),
    )
    assert load_text(tmp_path, problem_to_toml(problem)) == problem


@pytest.mark.parametrize(
    "title",
    [
        "a\x00b",
        'quote " and \\ backslash',
        "tab\tline\nfeed\r",
        "\x7f\u2028",
        "\U0001f52d",
        "tag \U000e0041 tag",
    ],
)
def test_odd_titles_survive_the_trip(tmp_path, title):
    problem = replace(load_values(tmp_path, SMALL), title=title)
    assert load_text(tmp_path, problem_to_toml(problem)).title == title


# ---- every key within its limits, and texts that are cut ----


def value_within(limits, hint):
    """A strategy for the values that a key takes."""
    if get_args(hint) and limits["auto"]:
        return st.just("auto") | value_within({**limits, "auto": False}, get_args(hint)[0])
    if get_args(hint):
        kinds = get_args(hint)
        value = value_within(limits, kinds[0])
        if kinds[-1] is Ellipsis:
            return st.lists(value, min_size=1, max_size=4).map(tuple)
        return st.tuples(*[value] * len(kinds))
    if limits["choices"]:
        return st.sampled_from(limits["choices"])
    if hint is bool:
        return st.booleans()
    if hint is str:
        return st.text(st.characters(categories=("L", "N", "Zs", "S", "P")), max_size=40).map(str.strip)
    low, high = limits["above"] if limits["low"] is None else limits["low"], limits["high"]
    if hint is int:
        return st.integers(low, 2**63 - 1 if high is None else high)
    return st.floats(
        low, high, exclude_min=limits["above"] is not None, allow_nan=False, allow_infinity=False
    )


def record_within(kind):
    """A strategy for the records of a table, every key within its limits."""
    hints = get_type_hints(kind)
    return st.builds(kind, **{f.name: value_within(f.metadata, hints[f.name]) for f in fields(kind)})


def acting(record):
    """Return a record with the defaults of keys that its other keys leave without effect."""
    decided = {f: f.metadata["only"].items() for f in fields(record)}
    found = vars(record) | {"target.kind": "image"}
    idle = [f for f, others in decided.items() if any(found[o] not in v for o, v in others)]
    return replace(record, **{f.name: f.default for f in idle})


@examples(40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    front=st.none() | record_within(Freeform),
    rear=record_within(Freeform),
    optimizer=record_within(Optimizer)
    .map(acting)
    .map(lambda o: replace(o, merge=1)),  # few pixels refuse more
    refinement=record_within(Refinement),
    verify=record_within(Verify)
    .map(acting)
    .map(
        lambda v: replace(v, beam_angle=Verify().beam_angle, field_angle=Verify().field_angle)
    ),  # limits of light in the far field
    export=record_within(Export),
    run=record_within(Run),
)
def test_every_record_within_its_limits_survives_the_trip(tmp_path, front, rear, **tables):
    base = load_values(tmp_path, SMALL)
    lens = replace(
        base.lens, front=replace(base.lens.front, freeform=front), rear=replace(base.lens.rear, freeform=rear)
    )
    problem = replace(base, lens=lens, **tables)
    assert load_text(tmp_path, problem_to_toml(problem)) == problem


@examples(100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0, 1, exclude_max=True), values=st.sampled_from([MINIMAL, SMALL, EXTENDED]))
def test_a_text_cut_before_its_last_required_key_is_refused(tmp_path, share, values):
    """The last key without a default is target.half_width."""
    text = problem_to_toml(load_values(tmp_path, values))
    start = text.index("half_width", text.index("[target]"))
    end = text.index("]", start)
    with pytest.raises(UserError, match=r"problem\.toml.* (add it|mend it there|must be)"):
        load_text(tmp_path, text[: int(share * end)])


@pytest.mark.every(3)
@pytest.mark.parametrize("values", [MINIMAL, SMALL, EXTENDED], ids=["minimal", "small", "extended"])
def test_a_line_that_is_lost_is_refused_or_leaves_the_default_of_its_key(tmp_path, values):
    problem = load_values(tmp_path, values)
    lines = problem_to_toml(problem).splitlines()
    for k, line in enumerate(lines):
        if " = " not in line:
            continue
        key, read = line.split(" = ")[0], read_or_refused(tmp_path, "\n".join(lines[:k] + lines[k + 1 :]))
        if isinstance(read, str):
            assert key in read
        else:
            changed = set(lines) ^ set(problem_to_toml(read).splitlines())
            assert {row.split(" = ")[0] for row in changed} <= {key}
