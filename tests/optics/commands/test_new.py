"""The commented problem file that `thbcad new` prints."""

import tomllib
from dataclasses import fields, is_dataclass

from PIL import Image

from optics.commands.cli import main
from optics.problem import Problem, commented_problem, load_problem, problem_to_toml


def keys(record, prefix=""):
    """Return the dotted names of all keys but those of tables that are left out."""
    found = []
    for f in fields(record):
        value = getattr(record, f.name)
        if value is None:
            continue
        found += keys(value, f"{prefix}{f.name}.") if is_dataclass(value) else [prefix + f.name]
    return found


def test_new_prints_a_problem_that_can_be_checked(tmp_path, capsys):
    assert main(["new"]) == 0
    text = capsys.readouterr().out
    (tmp_path / "my.toml").write_text(text)
    Image.linear_gradient("L").save(tmp_path / "picture.png")
    problem = load_problem(tmp_path / "my.toml")
    assert isinstance(problem, Problem)
    assert main(["check", str(tmp_path / "my.toml")]) == 0
    assert tomllib.loads(text)["target"]["image"] == "picture.png"


def test_every_key_is_there_and_nearly_every_key_explained(tmp_path):
    lines = commented_problem().splitlines()
    values = [line for line in lines if "=" in line]
    (tmp_path / "my.toml").write_text("\n".join(lines))
    problem = load_problem(tmp_path / "my.toml")
    assert len(values) == len(keys(problem))
    assert [line for line in values if "#" not in line] == ['title = "my lens"']
    assert all("#" not in line for line in problem_to_toml(problem).splitlines())
