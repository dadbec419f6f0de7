"""The commented problem file that `thbcad new` prints."""

import tomllib
from dataclasses import fields, is_dataclass

import pytest
from PIL import Image

from optics.interface.commands.cli import main
from optics.scene.problem import STARTS, Problem, commented_problem, load_problem, problem_to_toml
from tests.cases import EXAMPLES, ROOT


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


@pytest.mark.slow
def test_new_prints_a_problem_that_can_be_checked(tmp_path, capsys):
    assert main(["new"]) == 0
    text = capsys.readouterr().out
    (tmp_path / "my.toml").write_text(text)
    Image.linear_gradient("L").save(tmp_path / "picture.png")
    problem = load_problem(tmp_path / "my.toml")
    assert isinstance(problem, Problem)
    assert main(["check", str(tmp_path / "my.toml")]) == 0
    assert tomllib.loads(text)["target"]["image"] == "picture.png"


def test_the_page_of_keys_has_what_new_prints():
    assert (ROOT / "docs" / "every_key.toml").read_text("utf-8") == commented_problem()


def test_every_key_is_there_and_explained(tmp_path):
    lines = commented_problem().splitlines()
    values = [line for line in lines if "=" in line]
    (tmp_path / "my.toml").write_text("\n".join(lines))
    problem = load_problem(tmp_path / "my.toml")
    assert len(values) == len(keys(problem))
    assert [line for line in values if "#" not in line] == []
    assert all("#" not in line for line in problem_to_toml(problem).splitlines())


LIKE = {
    "far_field": "far_field.toml",
    "point": "point.toml",
    "extended": "extended.toml",
    "two_surfaces": "extended_two.toml",
}


def test_every_kind_but_the_default_has_an_example():
    assert {*LIKE, "collimated"} == set(STARTS)


@pytest.mark.parametrize("kind", LIKE)
def test_a_kind_of_start_is_an_example_that_is_known_to_be_solved(kind, tmp_path, capsys):
    assert main(["new", "--kind", kind]) == 0
    text = capsys.readouterr().out
    (tmp_path / "my.toml").write_text(text)
    started, example = load_problem(tmp_path / "my.toml"), load_problem(EXAMPLES / LIKE[kind])
    assert bool(started.target.image) == bool(example.target.image)
    assert started == example.with_(**{"title": "my lens", "target.image": started.target.image})
    assert sum("#" in line for line in text.splitlines()) > 60


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["far_field", "point"])  # glowing squares take a minute
def test_a_start_can_be_checked(kind, tmp_path, capsys):
    (tmp_path / "my.toml").write_text(commented_problem(kind))
    Image.linear_gradient("L").save(tmp_path / "picture.png")
    assert main(["check", str(tmp_path / "my.toml")]) == 0
    assert "the problem is valid" in capsys.readouterr().out
