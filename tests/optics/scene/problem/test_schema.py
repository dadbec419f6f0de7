"""What a problem file means: defaults, units, kinds."""

import math
from pathlib import Path

import pytest

from optics.scene.problem import Rear, load_problem, per_level
from tests.cases import EXAMPLES
from tests.optics.cases import SMALL, target_z, toml_text
from tests.optics.scene.problem.cases import EXTENDED, MINIMAL, load_values


@pytest.mark.parametrize("base", [SMALL, EXTENDED], ids=["small", "extended"])
def test_every_key_reaches_the_problem(tmp_path, base):
    values = base | {
        "source.flux": 2.5,
        "source.distance": 3,
        "lens.front.radius": -80.0,
        "lens.front.conic": 0.25,
        "lens.rear.freeform.degree": 4,
        "target.encoding": "linear",
        "target.fit": "pad",
        "optimizer.window": "gaussian",
        "optimizer.sigma": 1.5,
        "optimizer.memory": 7,
        "optimizer.rays_per_pixel": 2.5,
        "optimizer.lost_flux_weight": 3.0,
        "refinement.alpha": [0.5, 0.25],
        "verify.surface": 1e-9,
        "run.seed": 9,
        "run.precision": "single",
    }
    problem = load_values(tmp_path, values)
    for key, value in values.items():
        found = problem
        for name in key.split("."):
            found = getattr(found, name)
        wanted = tuple(value) if isinstance(value, list) else value
        assert found == (str(tmp_path / value) if key in ("target.image", "source.image") else wanted), key


def test_defaults_are_those_of_the_design_contract(tmp_path):
    p = load_values(tmp_path, MINIMAL)
    assert (p.source.distance, p.source.flux, p.source.unit) == (2.0, 1.0, "W")
    assert (p.source.profile, p.source.image, p.source.half_angle, p.source.exponent) == (
        "uniform",
        "",
        90.0,
        0.0,
    )
    assert p.lens.front.freeform is None
    for surface in (p.lens.front, p.lens.rear):
        assert (surface.radius, surface.conic) == (math.inf, 0.0)
    assert vars(p.lens.rear.freeform) == {"degree": 3, "spans": (7, 7), "max_level": 5, "z_freedom": 5.0}
    assert (p.target.encoding, p.target.pixels, p.target.fit) == ("srgb", (256, 256), "crop")
    assert (p.run.seed, p.run.precision) == (0, "mixed")
    assert target_z(p) == SMALL["lens.thickness"] + SMALL["target.distance"]


def test_the_pearl_example_holds_the_numbers_of_the_design_contract():
    p = load_problem(EXAMPLES / "pearl.toml")
    assert (p.source.half_width, p.source.distance, p.source.flux) == ((47.5, 47.5), 2.0, 1.0)
    assert (p.lens.index, p.lens.thickness, p.lens.front.half_width, p.lens.front.radius) == (
        1.5,
        20.0,
        (50.0, 50.0),
        math.inf,
    )
    assert (p.lens.rear.half_width, p.lens.rear.radius, p.lens.rear.conic) == ((50.0, 50.0), 150.0, -1.0)
    assert (p.lens.rear.freeform.degree, p.lens.rear.freeform.spans, p.lens.rear.freeform.max_level) == (
        3,
        (7, 7),
        5,
    )
    assert (p.target.distance, p.target.half_width, p.target.pixels) == (300.0, (100.0, 100.0), (256, 256))
    assert Path(p.target.image).is_file()


def test_whole_numbers_count_as_numbers_and_one_number_as_a_list_per_level(tmp_path):
    p = load_values(
        tmp_path,
        SMALL
        | {"lens.thickness": 6, "lens.rear.radius": 40, "optimizer.iterations": 9, "refinement.alpha": 1},
    )
    assert isinstance(p.lens.thickness, float)
    assert (p.lens.thickness, p.lens.rear.radius) == (6.0, 40.0)
    assert (p.optimizer.iterations, p.refinement.alpha) == ((9,), (1.0,))


def test_the_last_entry_per_level_goes_on():
    assert [per_level((5, 4, 3), level) for level in range(5)] == [5, 4, 3, 3, 3]


def test_the_picture_is_found_beside_the_problem_file(tmp_path, monkeypatch):
    folder = tmp_path / "somewhere"
    folder.mkdir()
    (folder / "problem.toml").write_text(toml_text(SMALL))
    monkeypatch.chdir(tmp_path)
    assert load_problem("somewhere/problem.toml").target.image == str(folder / "picture.png")


def test_an_absolute_picture_path_stays(tmp_path):
    assert load_values(tmp_path, SMALL | {"target.image": "/data/a.png"}).target.image == "/data/a.png"


def test_a_target_has_its_place_by_distance_or_by_position(tmp_path):
    """What is left out is false in a file and None in code; a variation may exchange one for the other."""
    problem = load_values(tmp_path, SMALL)
    assert (problem.target.position, problem.throw) == (None, SMALL["target.distance"])
    aside = problem.with_(**{"target.distance": None, "target.position": (3, 4, SMALL["lens.thickness"])})
    assert aside.throw == 5
    changed = {"target.distance": False, "target.position": [3, 4, SMALL["lens.thickness"]]}
    assert load_values(tmp_path, SMALL | changed) == aside
    assert (
        load_values(tmp_path, SMALL | {"target.surface": "far_field", "target.distance": False}).throw
        == math.inf
    )
    curved = {"target.surface": "sphere", "target.radius": -30.0, "target.tilt": [1.0, 2.0, 3.0]}
    assert load_values(tmp_path, SMALL | changed | curved).target.place == (
        "on a sphere of radius -30 mm, at (3, 4, 6) mm, tilted by (1, 2, 3) degrees"
    )


@pytest.mark.parametrize(
    ("said", "conic"), [({}, 0.0), ({"radius": 80.0}, 0.0), ({"radius": "auto"}, "auto")]
)
def test_a_conic_constant_that_is_left_out_follows_from_the_radius(said, conic):
    """A base that the program chooses is a paraboloid, which STEP holds exactly; one in numbers a sphere."""
    assert Rear(half_width=(10, 10), **said).conic == conic
    assert Rear(half_width=(10, 10), **said | {"conic": 0.5}).conic == 0.5
