"""Systems of one element in any pose: what cannot be lit is said before any tracing; gradients of loss."""

import numpy as np
import pytest

import optics
from optics.scene.system import solvable_system
from tests.optics.scene.problem.cases import LENS, MIRROR, load_text, refusal

POINT = {"source.kind": "point", "source.half_width": (0, 0), "source.half_angle": 10.0}
FAR = {"target.surface": "far_field", "target.position": False, "target.half_width": (20.0, 20.0)}
CYLINDER = {"target.surface": "cylinder", "target.radius": 50.0}


@pytest.fixture
def mirror(tmp_path):
    return load_text(tmp_path, MIRROR)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"element.M1.tilt": (225, 0, 0)}, "light along +z meets element.M1 from behind, or never"),
        ({"element.M1.tilt": (120, 0, 0)}, "light along +z meets element.M1 from behind, or never"),
        (
            POINT | {"element.M1.position": (0, 0, -40)},
            "the source lies behind element.M1, at its own z = 7.071",
        ),
        (
            {"target.position": (0, -60, 0)},
            "100% of the light is asked for beside element.M1 or behind where",
        ),
        ({"target.tilt": (90, 0, 0)}, "where the target shows element.M1 its back"),
        ({"target.position": (0, 5, 0)}, "the target cuts element.M1"),
        ({"target.position": (0, 0, -8)}, "the target cuts element.M1"),
        ({"target.position": (0, 2, 2), "target.tilt": (45, 0, 0)}, "the target cuts element.M1"),
        ({"target.position": (0, 0, 40), "target.tilt": (0, 90, 0), "target.half_width": (60, 9)}, "cuts"),
        (CYLINDER | {"target.position": (0, 6, 0)}, "the target cuts element.M1"),
        ({"element.M1.tilt": (90, 0, 0)}, "light along +z meets element.M1 from behind, or never"),
        (POINT | {"element.M1.tilt": (180, 0, 0)}, "the source lies behind element.M1, at its own z = 30"),
        (POINT | {"element.M1.position": (0, 0, -30)}, "at its own z = 0 mm; turn it by element.M1.tilt"),
        ({"element.M1.face.radius": 12.0}, "raise element.M1.thickness by more than 4.33333 mm"),
        (FAR | {"target.tilt": (90, 0, 0)}, "asked for beside element.M1 or behind where light leaves it"),
        ({"element.M1.face.radius": 3.0, "element.M1.face.conic": 0.0}, "element.M1.face: "),
        ({"element.M1.thickness": 1e-6, "element.M1.face.radius": 30.0}, "element.M1: "),
    ],
)
def test_a_scene_that_cannot_be_is_one_sentence(mirror, changes, words):
    assert words in refusal(lambda: solvable_system(mirror.with_(**changes)))


@pytest.mark.parametrize(
    "changes",
    [{}, CYLINDER, CYLINDER | {"target.surface": "sphere", "target.radius": -70.0}, FAR, POINT],
    ids=["plane", "cylinder", "sphere", "far field", "point"],
)
@pytest.mark.parametrize("kind", ["mirror", "lens"])
def test_gradients_are_those_of_differences(tmp_path, mirror, kind, changes):
    """Central differences of fourth order, through a window with two continuous derivatives."""
    if kind == "lens":
        head, _, rest = MIRROR.partition("[[element]]")
        tail = "[target]" + rest.partition("[target]")[2]
        mirror = load_text(tmp_path, head + LENS + tail)
        changes = {"target.position": (0, 5, 70), "target.tilt": (20, 0, 0)} | changes
    system = optics.System(
        mirror.with_(
            **changes, **{"run.threads": 1, "optimizer.window": "bspline", "optimizer.window_degree": 5}
        )
    )
    space = system.space(level=1)
    model = system.model(space, rays=(97, 89))
    rng = np.random.default_rng(5)
    c, along = 0.02 * rng.standard_normal(space.dim), rng.standard_normal(space.dim)
    _, gradient = model.loss(c)
    h = 2e-5
    steps = [model.loss(c + k * h * along)[0] for k in (-2, -1, 1, 2)]
    difference = (8 * (steps[2] - steps[1]) - (steps[3] - steps[0])) / (12 * h)
    assert gradient @ along == pytest.approx(difference, rel=1e-8)
