"""Problems written as text and read back."""

from __future__ import annotations

import math
import tomllib
from dataclasses import fields, is_dataclass, replace

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from optics.problem.toml_text import problem_to_toml
from tests.optics.cases import SMALL
from tests.optics.problem.cases import EXTENDED, MINIMAL, load_text, load_values


@pytest.mark.parametrize("values", [MINIMAL, SMALL, EXTENDED], ids=["minimal", "small", "extended"])
def test_problem_survives_the_trip_through_toml(tmp_path, values):
    problem = load_values(tmp_path, values)
    assert load_text(tmp_path, problem_to_toml(problem)) == problem


@pytest.mark.parametrize("values", [MINIMAL, EXTENDED], ids=["minimal", "extended"])
def test_the_written_file_holds_every_key(tmp_path, values):
    problem = load_values(tmp_path, values)

    def compare(record, table):
        written = [f for f in fields(record) if getattr(record, f.name) is not None]
        assert {f.name for f in written} == set(table)
        for f in written:
            if is_dataclass(getattr(record, f.name)):
                compare(getattr(record, f.name), table[f.name])

    compare(problem, tomllib.loads(problem_to_toml(problem)))
    assert (problem.lens.front.freeform is None) == (values is MINIMAL)


@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
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
