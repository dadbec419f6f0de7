"""More than 100 bad problem files and 30 bad pictures.

Each ends with exit code 2 and one sentence that names the file, the key and a remedy; there is no traceback
and no warning.
"""

import pytest

from optics.base.runtime import LONGEST
from tests.optics.cases import SMALL, toml_text, write_problem
from tests.optics.interface.commands.bad_pictures import BAD_PICTURES, PNG
from tests.optics.interface.commands.bad_problems import BAD_PROBLEMS
from tests.optics.interface.commands.cases import refused

TRACES = ("Traceback", "Warning", "Error", ".py", "nan or inf", "NoneType", "numpy")


def assert_a_sentence(line, *words):
    """A line that names every word and shows nothing of the program's inside."""
    assert [word for word in words if word not in line] == []
    assert [trace for trace in TRACES if trace in line] == []
    assert len(line) <= LONGEST + len("thbcad: ")
    assert line.isprintable()


def changed_text(change):
    """Return the text of the small problem with a change, as a case gives it."""
    if callable(change):
        return change(toml_text(SMALL))
    values = (
        SMALL | change if isinstance(change, dict) else {k: v for k, v in SMALL.items() if k not in change}
    )
    return toml_text(values)


def test_there_are_a_hundred_and_thirty():
    assert len({name for name, *_ in BAD_PROBLEMS}) == len(BAD_PROBLEMS) >= 100
    assert len(BAD_PICTURES) >= 30


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("name", "change", "key", "remedy"), BAD_PROBLEMS, ids=[n for n, *_ in BAD_PROBLEMS])
def test_bad_problems_are_refused_with_file_key_and_remedy(tmp_path, capsys, name, change, key, remedy):
    (tmp_path / "picture.png").write_bytes(PNG)
    path, text = tmp_path / "problem.toml", changed_text(change)
    path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8"))
    assert_a_sentence(refused(capsys, "check", path), f"thbcad: {path}", key, remedy)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", BAD_PICTURES)
def test_bad_pictures_are_refused_with_file_key_and_remedy(tmp_path, capsys, name):
    make, remedy = BAD_PICTURES[name]
    problem = write_problem(tmp_path)
    (tmp_path / "picture.png").unlink()
    make(tmp_path / "picture.png")
    line = refused(capsys, "check", problem)
    assert_a_sentence(line, f"thbcad: {problem}: target.image: ", "picture.png", remedy)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", ["missing", "a text", "half a PNG", "black", "NaN"])
def test_bad_pictures_of_sources_are_refused_too(tmp_path, capsys, name):
    make, remedy = BAD_PICTURES[name]
    problem = write_problem(tmp_path, {"source.profile": "image", "source.image": "glow.png"})
    make(tmp_path / "glow.png")
    line = refused(capsys, "check", problem)
    assert_a_sentence(line, f"thbcad: {problem}: source.image: ", "glow.png", remedy)


@pytest.mark.parametrize("kind", ["missing", "a folder", "a pipe", "a device"])
def test_problems_that_are_no_files_are_refused(tmp_path, capsys, kind):
    make, remedy = BAD_PICTURES[kind]
    make(tmp_path / "problem.toml")
    assert_a_sentence(
        refused(capsys, "check", tmp_path / "problem.toml"), str(tmp_path / "problem.toml"), remedy
    )


def test_a_path_of_5000_characters_is_cut_and_the_reason_is_not(tmp_path, capsys):
    problem = write_problem(tmp_path, {"target.image": "x" * 5000 + ".png"})
    assert_a_sentence(
        refused(capsys, "check", problem), f"thbcad: {problem}: target.image: ", "File name too long", "check"
    )
