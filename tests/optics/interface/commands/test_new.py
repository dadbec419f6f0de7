"""The commented problem file that `thbcad new` prints."""

import io
import re
import sys
from dataclasses import fields, is_dataclass

import pytest
from PIL import Image

from optics.interface.commands.cli import main
from optics.scene.keys import keys_of, problem_to_toml
from optics.scene.problem import (
    ASKED_LIGHT,
    ASKED_SOURCES,
    STARTS,
    Problem,
    answered_problem,
    commented_problem,
    load_problem,
)
from tests.cases import EXAMPLES, ROOT
from tests.optics.interface.commands.cases import printed


def keys(record, prefix=""):
    """Return the dotted names of all keys but those of tables that are left out, and of lists of tables."""
    found = []
    for f in fields(record):
        value = getattr(record, f.name)
        if (value is None and f.name not in ("position", "reflectance")) or f.name in (
            "stop",
            "element",
            "path",
            "zone",
            "others",
        ):
            continue
        found += keys(value, f"{prefix}{f.name}.") if is_dataclass(value) else [prefix + f.name]
    return found


def test_the_page_of_keys_has_what_new_prints():
    assert (ROOT / "docs" / "every_key.toml").read_text("utf-8") == commented_problem()


def test_every_key_is_there_and_explained(tmp_path):
    lines = commented_problem().splitlines()
    values = [line for line in lines if "=" in line and line[:2] != "# "]
    (tmp_path / "my.toml").write_text("\n".join(lines))
    problem = load_problem(tmp_path / "my.toml")
    assert len(values) == len(keys(problem))
    assert [line for line in values if "#" not in line] == []
    assert all("#" not in line for line in problem_to_toml(problem).splitlines())


@pytest.mark.parametrize("table", ["[source.array]", "[lens.array]", "[lens.body]", "[[stop]]"])
def test_the_keys_of_tables_that_are_left_out_are_there_as_comments(table):
    part = commented_problem().partition(f"\n# {table} ")[2].partition("\n\n")[0]
    own = table.strip("[]") + "."
    wanted = [key.name.removeprefix(own) for key in keys_of(Problem) if key.name.startswith(own)]
    assert re.findall(r"^# (\w+) = \S+.*  # .+", part, re.M) == wanted


LIKE = {
    "far_field": "far_field.toml",
    "point": "point.toml",
    "extended": "extended.toml",
    "two_surfaces": "extended_two.toml",
}


def test_every_kind_but_the_default_has_an_example():
    assert {*LIKE, "collimated", *SHORT} == set(STARTS)


@pytest.mark.parametrize("kind", LIKE)
def test_a_kind_of_start_is_an_example_that_is_known_to_be_solved(kind, tmp_path, capsys):
    text = printed(capsys, "new", "--kind", kind)
    (tmp_path / "my.toml").write_text(text)
    started, example = load_problem(tmp_path / "my.toml"), load_problem(EXAMPLES / LIKE[kind])
    assert bool(started.target.image) == bool(example.target.image)
    assert started == example.with_(**{"title": "my lens", "target.image": started.target.image})
    assert sum("#" in line for line in text.splitlines()) > 60


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["collimated", "far_field", "point"])  # glowing squares take a minute
def test_a_start_can_be_checked(kind, tmp_path, capsys):
    (tmp_path / "my.toml").write_text(commented_problem(kind))
    Image.linear_gradient("L").resize((32, 32)).save(tmp_path / "picture.png")
    few = ("--set", "target.pixels=[32, 32]")
    assert "  problem is valid\n" in printed(capsys, "check", tmp_path / "my.toml", *few)


SHORT = ("mirror", "wall_washer", "plate", "round", "collimator", "sun")


@pytest.mark.parametrize("kind", SHORT)
def test_a_short_start_is_a_commented_problem_without_other_files_that_check_accepts(kind, tmp_path, capsys):
    text = printed(capsys, "new", "--kind", kind)
    (tmp_path / "my.toml").write_text(text)
    problem = load_problem(tmp_path / "my.toml")
    assert not problem.target.image
    assert len(text.splitlines()) < 60
    assert text.count("#") > 4
    free = problem.optic.key("face" if kind == "mirror" else "rear")
    few = ("--set", "target.pixels=[24, 24]", "--set", f"{free}.freeform.max_level=1")
    assert "  problem is valid\n" in printed(capsys, "check", tmp_path / "my.toml", *few)


# ---- three questions ----

ANSWERS = [(source, light) for source in ASKED_SOURCES for light in (*ASKED_LIGHT, "picture.png")]


@pytest.fixture
def terminal(monkeypatch, tmp_path):
    """A function that runs `thbcad new` with lines that a person types, in the test's folder."""
    Image.linear_gradient("L").save(tmp_path / "picture.png")
    monkeypatch.chdir(tmp_path)

    def typed(*lines, arguments=("new",), stdin=True, stdout=True):
        text = io.StringIO("".join(f"{line}\n" for line in lines))
        text.isatty = lambda: stdin
        monkeypatch.setattr(sys, "stdin", text)
        monkeypatch.setattr(sys.stdout, "isatty", lambda: stdout, raising=False)
        return main([*arguments])

    return typed


def test_answers_become_a_commented_problem_file_with_what_comes_next(terminal, tmp_path, capsys):
    assert terminal("led", "'picture.png'", "60") == 0
    said = capsys.readouterr().out
    assert said.endswith("thbcad check my_lens.toml\n  thbcad design my_lens.toml --live\n")
    text = (tmp_path / "my_lens.toml").read_text()
    assert text == answered_problem("led", "picture.png", 60.0)
    assert sum("#" in line for line in text.splitlines()) > 60


def test_no_answer_is_the_usual_one_and_no_file_is_replaced(terminal, tmp_path):
    assert [terminal("", "", "") for _ in range(3)] == [0, 0, 0]
    names = {path.name for path in tmp_path.glob("*.toml")}
    assert names == {"my_lens.toml", "my_lens_2.toml", "my_lens_3.toml"}
    assert (tmp_path / "my_lens_3.toml").read_text() == answered_problem("beam", "square", 100.0)


def test_an_answer_that_is_none_is_asked_for_again(terminal, tmp_path, capsys):
    assert terminal("moon", "BEAM", "lost.png", "~nobody/lost.png", "disk", "wide", "0", "nan", "50") == 0
    said = capsys.readouterr().out
    assert "answer beam or sun or point or led" in said
    assert "there is no picture lost.png" in said
    assert "there is no picture ~nobody/lost.png" in said
    assert said.count("answer a number from 1 to 1000, in mm") == 3
    assert (tmp_path / "my_lens.toml").read_text() == answered_problem("beam", "disk", 50.0)


def test_questions_without_an_answer_end_in_one_sentence(terminal, tmp_path, capsys):
    assert terminal("beam") == 2
    said = capsys.readouterr()
    assert said.out.endswith("\n")  # of the question, which a sentence follows
    assert said.err == ("thbcad: a question has no answer; thbcad new --kind NAME asks none\n")
    assert list(tmp_path.glob("*.toml")) == []


@pytest.mark.parametrize(
    "asked",
    [{"stdin": False}, {"stdout": False}, {"arguments": ("new", "--kind", "collimated")}],
    ids=["no input", "no screen", "an option"],
)
def test_elsewhere_nothing_is_asked(terminal, tmp_path, capsys, asked):
    assert terminal(**asked) == 0
    assert capsys.readouterr().out == commented_problem()
    assert list(tmp_path.glob("*.toml")) == []


@pytest.mark.parametrize(("source", "light"), ANSWERS)
def test_answers_of_any_size_are_a_problem_in_proportion(source, light, tmp_path):
    problems = []
    for width in (1.0, 30.0, 1000.0):
        (tmp_path / "my.toml").write_text(answered_problem(source, light, width))
        problem = load_problem(tmp_path / "my.toml")
        problems.append(problem)
        assert problem.lens.rear.half_width == (width / 2, width / 2)
        assert problem.target.distance == pytest.approx(3 * width)
        assert problem.target.half_width[0] == pytest.approx(width)
    assert problems[0].source.half_angle == problems[2].source.half_angle


@pytest.mark.slow
@pytest.mark.parametrize(
    ("source", "light", "width"), [(*answers, (10.0, 100.0)[k % 2]) for k, answers in enumerate(ANSWERS)]
)
def test_nothing_speaks_against_any_answers(source, light, width, tmp_path, capsys, coarse_concentration):
    (tmp_path / "my.toml").write_text(answered_problem(source, light, width))
    Image.open(EXAMPLES / "pearl.png").save(tmp_path / "picture.png")
    few = ("--set", "target.pixels=[32, 32]")
    said = printed(capsys, "check", tmp_path / "my.toml", *few)
    assert re.match("my lens +problem is valid\n", said)  # or it may miss its limits


@pytest.mark.slow
@pytest.mark.parametrize(
    ("source", "light", "width"),
    [("beam", "picture.png", 60.0), ("point", "square", 20.0), ("led", "disk", 100.0)],
)
def test_answers_are_designed_well(source, light, width, tmp_path, capsys):
    """With fewer pixels."""
    (tmp_path / "my.toml").write_text(answered_problem(source, light, width))
    Image.open(EXAMPLES / "pearl.png").save(tmp_path / "picture.png")
    few = ("--set", "target.pixels=[64, 64]", "--out", str(tmp_path / "lens"), "--quiet")
    assert "the lens makes the light asked for" in printed(capsys, "design", tmp_path / "my.toml", *few)


def test_without_a_standard_input_the_file_is_printed(monkeypatch, capsys):
    monkeypatch.setattr("sys.stdin", None)
    assert printed(capsys, "new").strip() == commented_problem().strip()
