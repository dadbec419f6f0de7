"""What is no problem file at all: text, bytes, folders, and what has no end."""

import os

import pytest
from hypothesis import HealthCheck, given, strategies as st

from optics.base.runtime import UserError
from optics.scene.problem import Problem
from optics.scene.problem.problem_record import MAX_FILE_BYTES, load_problem
from tests.cases import examples
from tests.optics.cases import SMALL, toml_text
from tests.optics.scene.problem.cases import EXTENDED, load_text, one_sentence


@pytest.mark.parametrize(
    "text",
    [
        "title = ",
        "[source",
        "= 3",
        "a = 1\na = 2",
        "\x00",
        "title = 'x",
    ],
    ids=repr,
)
def test_text_that_is_not_toml_is_refused(tmp_path, text):
    with pytest.raises(UserError, match=r"cannot be read as TOML") as caught:
        load_text(tmp_path, text)
    assert one_sentence(str(caught.value))


@pytest.mark.parametrize("data", [b"\xff\xfe\x00", b"\x89PNG\r\n\x1a\n", "title = 'ü'".encode("latin-1")])
def test_text_that_is_not_utf_8_is_refused(tmp_path, data):
    with pytest.raises(UserError, match=r"is no UTF-8 text from byte \d+ on; save it as UTF-8"):
        load_text(tmp_path, data)


def test_the_mark_that_editors_of_windows_put_before_the_text_is_read_over(tmp_path):
    text = toml_text(SMALL)
    assert load_text(tmp_path, b"\xef\xbb\xbf" + text.encode()) == load_text(tmp_path, text)


def test_line_ends_of_windows_are_read(tmp_path):
    text = toml_text(SMALL)
    assert load_text(tmp_path, text.replace("\n", "\r\n")) == load_text(tmp_path, text)


def test_an_empty_file_names_the_first_missing_key(tmp_path):
    with pytest.raises(UserError, match=r"the key source is missing"):
        load_text(tmp_path, "")


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"cannot read .*none\.toml: No such file"):
        load_problem(tmp_path / "none.toml")


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"cannot read .*: it is a folder; give the path of a file"):
        load_problem(tmp_path)


@pytest.mark.parametrize("name", ["pipe", "/dev/zero"])
def test_what_has_no_end_is_refused(tmp_path, name):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(UserError, match=r"cannot read .*: it is a pipe or a device"):
        load_problem(tmp_path / name)


def test_a_huge_file_is_refused_before_it_is_read(tmp_path):
    with pytest.raises(UserError, match=rf"larger than the {MAX_FILE_BYTES} bytes allowed"):
        load_text(tmp_path, b"#" * (MAX_FILE_BYTES + 1))


@pytest.mark.parametrize("digits", [400, 5000])
@pytest.mark.parametrize("key", ["lens.thickness", "lens.rear.freeform.degree"])
def test_endless_whole_numbers_are_refused(tmp_path, key, digits):
    with pytest.raises(UserError) as caught:
        load_text(tmp_path, toml_text(SMALL | {key: 123456789}).replace("123456789", "1" + "0" * digits))
    assert one_sentence(str(caught.value))


def test_deep_nesting_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"values are nested more than 16 deep \(at line 1\)"):
        load_text(tmp_path, "x = " + "[" * 50_000)


def message_of(folder, text):
    """Return the reason for which a text is refused, "" if it gives a Problem; any other exception passes
    through."""
    try:
        assert isinstance(load_text(folder, text), Problem)
    except UserError as error:
        return str(error)
    return ""


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
    assert "\n" not in message_of(tmp_path, text)


@examples(200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(at=st.integers(0, 700), length=st.integers(0, 40), new=st.binary(max_size=12))
def test_damaged_bytes_give_a_problem_or_a_user_error(tmp_path, at, length, new):
    text = toml_text(SMALL).encode()
    assert "\n" not in message_of(tmp_path, text[:at] + new + text[at + length :])
