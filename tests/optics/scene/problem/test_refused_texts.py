"""Problem files of any bytes and values: each gives a problem, or is refused in one sentence."""

import pytest
from hypothesis import HealthCheck, given, strategies as st

from optics.scene.problem import Problem
from tests.cases import examples
from tests.optics.cases import SMALL, toml_text
from tests.optics.scene.problem.cases import EXTENDED, load_text, read_or_refused, refusal


def test_the_mark_that_editors_of_windows_put_before_the_text_is_read_over(tmp_path):
    text = toml_text(SMALL)
    assert load_text(tmp_path, b"\xef\xbb\xbf" + text.encode()) == load_text(tmp_path, text)


def test_line_ends_of_windows_are_read(tmp_path):
    text = toml_text(SMALL)
    assert load_text(tmp_path, text.replace("\n", "\r\n")) == load_text(tmp_path, text)


@pytest.mark.parametrize("digits", [400, 5000])
@pytest.mark.parametrize("key", ["lens.thickness", "lens.rear.freeform.degree"])
def test_endless_whole_numbers_are_refused(tmp_path, key, digits):
    text = toml_text(SMALL | {key: 123456789}).replace("123456789", "1" + "0" * digits)
    assert refusal(load_text, tmp_path, text)


def is_read_or_refused_in_a_line(folder, text):
    """Return whether a text gives a Problem or one line of reason; any other exception passes through."""
    read = read_or_refused(folder, text)
    return isinstance(read, Problem) or "\n" not in read


VALUES = st.recursive(
    st.one_of(
        st.booleans(),
        st.integers(),
        st.sampled_from([10**308, 10**309, -(10**400)]),
        st.floats(),
        st.text(max_size=20),
        st.sampled_from(
            [
                "srgb",
                "linear",
                "image",
                "crop",
                "bspline",
                "single",
                "collimated",
                "lambertian",
                "point",
                "gaussian",
            ]
        ),
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=8), inner, max_size=3)
    ),
    max_leaves=6,
)
KEYS = st.one_of(
    st.sampled_from(
        [*EXTENDED, "run.seed", "optimizer.sigma", "refinement.alpha", "verify.surface", "lens.front.radius"]
    )
)


@examples(400, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(changes=st.dictionaries(KEYS, VALUES, max_size=4), dropped=st.sets(KEYS, max_size=1))
def test_random_values_give_a_problem_or_a_user_error(tmp_path, changes, dropped):
    text = toml_text({k: v for k, v in (SMALL | changes).items() if k not in dropped})
    assert is_read_or_refused_in_a_line(tmp_path, text)


@examples(200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(at=st.integers(0, 700), length=st.integers(0, 40), new=st.binary(max_size=12))
def test_damaged_bytes_give_a_problem_or_a_user_error(tmp_path, at, length, new):
    text = toml_text(SMALL).encode()
    assert is_read_or_refused_in_a_line(tmp_path, text[:at] + new + text[at + length :])
