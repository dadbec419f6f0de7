"""Problems built and varied in code: the checks and the messages of a problem file."""

import math
import re
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.scene.keys import assignment, keys_of
from optics.scene.problem import (
    Freeform,
    Front,
    LensSpec,
    Limits,
    Optimizer,
    Problem,
    Rear,
    Run,
    Source,
    Target,
    load_problem,
)
from tests.cases import EXAMPLES, python
from tests.optics.cases import SMALL, toml_text
from tests.optics.scene.problem.cases import load_text, load_values, refusal


def built(**changes):
    """Return the pearl-like problem in code; changes : whole tables."""
    tables = {
        "source": Source(kind="collimated", half_width=(9.5, 9.5)),
        "lens": LensSpec(
            index=1.5,
            thickness=6,
            front=Front(half_width=[10, 10]),
            rear=Rear(half_width=(10.0, 10.0), radius=40, conic=-1, freeform=Freeform(spans=[4, 4])),
        ),
        "target": Target(kind="image", image="picture.png", distance=60, half_width=[20, 20]),
    }
    return Problem(**(tables | changes))


def nested(values):
    """Return {"table.key": value} as tables within tables, without the package's own code."""
    tables = {}
    for key, value in values.items():
        *way, name = key.split(".")
        node = tables
        for part in way:
            node = node.setdefault(part, {})
        node[name] = value
    return tables


def test_numbers_become_floats_and_lists_tuples_at_every_depth():
    problem = built(optimizer=Optimizer(iterations=[5, 3]))
    assert isinstance(problem.lens.thickness, float)
    assert isinstance(problem.lens.rear.radius, float)
    assert problem.lens.front.half_width == (10.0, 10.0)
    assert all(isinstance(v, float) for v in problem.target.half_width)
    assert problem.lens.rear.freeform.spans == (4, 4)
    assert problem.optimizer.iterations == (5, 3)
    assert hash(problem) == hash(built(optimizer=Optimizer(iterations=(5, 3))))


def test_dicts_records_and_files_give_the_same_problem(tmp_path):
    from_file = load_values(tmp_path, SMALL)
    tables = nested(SMALL | {"target.image": str(tmp_path / "picture.png")})
    in_code = Problem(**tables)
    assert in_code == from_file
    assert Problem(**(tables | {"target": from_file.target, "run": Run(threads=1)})) == from_file
    assert load_text(tmp_path, in_code.to_toml()) == from_file


def test_paths_of_pictures_stay_as_they_are_in_code():
    assert built().target.image == "picture.png"
    assert replace(built(), title="x").target.image == "picture.png"
    assert built().with_(**{"target.image": Path("a") / "b.png"}).target.image == "a/b.png"


def test_numbers_of_numpy_are_numbers():
    target = Target(
        kind="tophat",
        distance=np.float32(60),
        half_width=(np.float64(20), 20),
        pixels=tuple(np.array([8, 9])),
    )
    problem = built(target=target, run=Run(seed=np.int64(3)))
    assert [type(v) for v in (*problem.target.pixels, problem.run.seed)] == [int] * 3
    assert [type(v) for v in (problem.target.distance, *problem.target.half_width)] == [float] * 3
    assert "[20.0, 20.0]" in problem.to_toml()


CASES = [
    ("source.kind", "glow"),
    ("source.half_width", [0, 0]),
    ("lens.index", 1),
    ("lens.thickness", "thick"),
    ("lens.front.half_width", [1.0]),
    ("lens.rear.radius", 0),
    ("lens.rear.conic", True),
    ("lens.rear.freeform.degree", 2.5),
    ("lens.front.freeform.spans", [0, 4]),
    ("target.distance", math.nan),
    ("target.distance", -math.inf),
    ("target.pixels", [1, 48]),
    ("target.image", ""),
    ("optimizer.merge", 13),
    ("optimizer.engine", "exakt"),
    ("optimizer.step", 0.0),
    ("limits.thickness", 100.0),
    ("export.author", "two\nlines"),
    ("run.threads", 10**30),
    ("run.keep", "all"),
    ("source", 3),
    ("colour", 3),
    ("target.distanse", 3),
]


@pytest.mark.parametrize(("key", "bad"), CASES, ids=str)
def test_code_refuses_with_the_words_of_a_file(tmp_path, key, bad):
    values = {k: v for k, v in SMALL.items() if not k.startswith(f"{key}.")} | {key: bad}
    from_file = refusal(lambda: load_values(tmp_path, values))
    in_code = refusal(lambda: Problem(**nested(SMALL)).with_(**{key: bad}))
    assert from_file == f"{tmp_path / 'problem.toml'}: {in_code}"


def test_records_are_checked_as_tables_are():
    small = Problem(**nested(SMALL))
    for key, table in (
        ("source", Source(kind="glow")),
        ("lens.front.freeform", Freeform(degree=1)),
        ("limits", Limits(slope=100)),
    ):
        with pytest.raises(UserError, match=key):
            small.with_(**{key: table})
    with pytest.raises(UserError, match=r"source\.kind must be one of 'collimated', .*, got 'glow'"):
        built(source=Source(kind="glow"))
    with pytest.raises(UserError, match=r"lens\.rear must be a table, got Front"):
        small.with_(**{"lens.rear": Front(half_width=(1, 1))})


def test_replaced_tables_are_checked():
    problem = built()
    with pytest.raises(UserError, match=r"target\.distance must be at least 1e-06, got -1"):
        replace(problem, target=replace(problem.target, distance=-1))


def test_a_variation_changes_its_keys_alone():
    problem = built()
    other = problem.with_(**{"target.distance": 400, "lens.rear.freeform.max_level": "auto"})
    assert (other.target.distance, other.lens.rear.freeform.max_level) == (400.0, "auto")
    assert problem.target.distance == 60.0
    assert other.with_(**{"target.distance": 60, "lens.rear.freeform.max_level": 5}) == problem
    assert problem.with_() == problem
    assert problem.with_(title="x", run={"seed": 3}) == replace(problem, title="x", run=Run(seed=3))


def test_a_variation_makes_the_tables_of_its_keys_and_leaves_them_out_again():
    problem = built()
    free = problem.with_(**{"lens.front.freeform.degree": 4})
    assert free.lens.front.freeform == Freeform(degree=4)
    assert free.with_(**{"lens.front.freeform": None}) == problem


def test_a_key_below_a_value_is_refused():
    with pytest.raises(UserError, match=r"target\.distance is a value, no table"):
        built().with_(**{"target.distance.mm": 3})


@pytest.mark.parametrize(
    ("key", "meant"),
    [
        ("target.distanse", "target.distance"),
        ("target.half_widht", "target.half_width"),
        ("tarket.distance", "target"),
        ("optimiser.merge", "optimizer"),
        ("source.index", "lens.index"),
        ("distance", "source.distance or target.distance"),
        ("lens.rear.z_freedom", "lens.rear.freeform.z_freedom"),
        ("lens.rear.freeform.max_levels", "lens.rear.freeform.max_level"),
    ],
)
def test_an_unknown_key_proposes_what_was_meant_from_file_code_and_command_line(tmp_path, key, meant):
    proposal = f"(did you mean {meant}?)"
    top = {} if "." in key else {key: 1}
    text = toml_text(top | SMALL | {key: 1})
    assert proposal in refusal(lambda: load_text(tmp_path, text))
    assert proposal in refusal(lambda: built().with_(**{key: 1}))
    if not key.startswith(("tarket", "optimiser")):
        assert proposal in refusal(lambda: assignment(f"{key}=1", Problem))


def test_every_problem_has_a_small_table_for_notebooks_with_its_text_escaped():
    page = built(title="<b>&")._repr_html_()
    assert "<caption>&lt;b&gt;&amp;</caption>" in page
    assert "<b>" not in page
    assert "60 mm behind the lens, half-width 20 x 20 mm, 256 x 256 pixels" in page
    far = built().with_(**{"target.distance": math.inf, "lens.front.freeform": {}})
    assert "far field, half-width 20 x 20 degrees" in far._repr_html_()
    assert far._repr_html_().count("sag within") == 2
    assert len(page) < 2000


def test_a_problem_in_code_loads_neither_renderer_nor_pictures():
    program = (
        "import sys; from optics.scene.problem import *; p = load_problem('examples/pearl.toml'); "
        "p.with_(title='x')._repr_html_(); p.to_toml(); print(*sys.modules)"
    )
    done = python(program, check=True)
    heavy = {"drjit", "mitsuba", "OCP", "matplotlib", "PIL", "skimage"}
    assert not heavy & set(done.stdout.split())


# ---- KEY=VALUE ----


@pytest.mark.parametrize(
    ("text", "key", "value"),
    [
        ("target.distance=400", "target.distance", 400),
        (" target.distance = 4e2 ", "target.distance", 400.0),
        ("target.distance=inf", "target.distance", math.inf),
        ("target.half_width=[3, 4.5]", "target.half_width", [3, 4.5]),
        ("optimizer.fresnel=false", "optimizer.fresnel", False),
        ("title=a = b, c", "title", "a = b, c"),
        ("title=", "title", ""),
        ('title="quoted"', "title", "quoted"),
        ("optimizer.engine=mitsuba-exact", "optimizer.engine", "mitsuba-exact"),
        ("lens.rear.radius=auto", "lens.rear.radius", "auto"),
        ("lens.index=auto", "lens.index", "auto"),
        ("source.spectrum=LED-B1", "source.spectrum", "LED-B1"),
        ("source.spectrum=[[450, 1], [650, 2.5]]", "source.spectrum", [[450, 1], [650, 2.5]]),
        ("lens.front.freeform={degree = 4}", "lens.front.freeform", {"degree": 4}),
        ("target.image=../my picture.png", "target.image", "../my picture.png"),
    ],
)
def test_an_assignment_is_a_key_and_a_value_of_toml_or_a_bare_word_for_a_text(text, key, value):
    assert assignment(text, Problem) == (key, value)


def test_the_example_of_a_number_is_one_that_its_key_takes():
    """lens.index = 2.5 is no glass, and a share of 2.5 none at all."""
    examples = {}
    for key in keys_of(Problem):
        told = refusal(assignment, f"{key.name}=text", Problem) if key.hint is not str else ""
        if found := re.search(r"a (?:whole )?number(?: or \"auto\")?, such as \S+=([-\d.e]+), got", told):
            examples[key.name] = number = float(found[1])
            limits = key.limits
            assert limits["low"] is None or limits["low"] <= number, key.name
            assert limits["high"] is None or number <= limits["high"], key.name
            assert limits["above"] is None or limits["above"] < number, key.name
    assert len(examples) > 50
    assert examples["lens.index"] == 1.49


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("target.distance", "write KEY=VALUE"),
        ("=3", "a key is missing before = in '=3': write KEY=VALUE"),
        (" = 3", "a key is missing before = in ' = 3': write KEY=VALUE"),
        ("=", "a key is missing before = in '=': write KEY=VALUE"),
        (
            "target.distance=far",
            "target.distance must be a number, such as target.distance=400.0, got 'far'",
        ),
        ("element.M1.reflectance=gold", "such as element.M1.reflectance=0.9, got"),
        ("target.half_width=100,100", "such as target.half_width=[1.5, 1.5]"),
        ("target.pixels=100x100", "such as target.pixels=[1, 1]"),
        ("optimizer.fresnel=yes", "true or false"),
        ("lens.indices=many", "a list of rows, such as lens.indices=[[450, 1.5], [550, 1.49]], got 'many'"),
        (
            "source.spectrum=red",
            "a list of rows, such as source.spectrum=[[450, 1.5], [550, 1.49]], or A, got",
        ),
        ("lens.rear.radius=flat", 'a number or "auto"'),
        ("lens.front.freeform=yes", "a table, such as lens.front.freeform={KEY = VALUE}"),
        ("run.seed=1\n[lens]\nindex=2", "a whole number"),
        ("target.distance=" + "[" * 5000, "a number"),
    ],
)
def test_an_assignment_that_cannot_be_read_says_how_to_write_it(text, words):
    assert words in refusal(lambda: assignment(text, Problem))


def test_changes_take_the_place_of_what_a_file_says_and_pictures_start_from_it(tmp_path):
    path = tmp_path / "problem.toml"
    path.write_text(toml_text({k: v for k, v in SMALL.items() if k != "target.distance"}))
    problem = load_problem(path, {"target.distance": 70, "target.image": "other.png"})
    assert (problem.target.distance, problem.target.image) == (70.0, str(tmp_path / "other.png"))
    with pytest.raises(UserError, match=r"problem\.toml: target\.distance must be at least"):
        load_problem(path, {"target.distance": -1})


def test_every_example_is_its_own_variation():
    for path in EXAMPLES.glob("*.toml"):
        problem = load_problem(path)
        changes = {}

        def collect(record, prefix="", changes=changes):
            for f in fields(record):
                value = getattr(record, f.name)
                if is_dataclass(value):
                    collect(value, f"{prefix}{f.name}.")
                else:
                    changes[prefix + f.name] = value

        collect(problem)
        assert built().with_(**changes) == problem
