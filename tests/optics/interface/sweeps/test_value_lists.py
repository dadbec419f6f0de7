"""KEY=VALUES of a command line: ranges, lists, and what is neither."""

from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from optics.base.runtime import UserError
from optics.interface.sweeps.variants import value_list


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
