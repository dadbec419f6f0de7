"""A problem that is not that of the lens is seen, key by key."""

from types import SimpleNamespace

import numpy as np
import pytest

from optics.exchange.verification.same_design import prescription_checks
from optics.scene.problem import load_problem
from tests.optics.cases import write_problem
from tests.optics.exchange.verification.cases import EVERY_LENS, FREE_FRONT, shaped
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic

BOTH = FREE_FRONT | {"lens.front.radius": 60.0, "lens.front.conic": -1.0, "lens.thickness": 12.0}

# what is changed in the problem, and what the check says of it
CHANGES = [
    ("lens.index", 1.7, "lens.index is 1.7 in problem.toml and 1.5 in lens.json", 0.2),
    ("lens.thickness", 25.0, "lens.thickness is 25 in problem.toml and 12 in lens.json", 13.0),
    ("lens.thickness", np.nextafter(12.0, 13.0), "lens.thickness is 12 in", 2e-15),
    ("lens.front.radius", 61.0, "lens.front.radius is 61 in problem.toml and 60 in lens.json", 1.0),
    ("lens.front.radius", np.inf, "lens.front.radius is inf in problem.toml and 60 in lens.json", np.inf),
    ("lens.rear.radius", -40.0, "lens.rear.radius is -40 in problem.toml and 40 in lens.json", 80.0),
    ("lens.rear.conic", 0.0, "lens.rear.conic is 0 in problem.toml and -1 in lens.json", 1.0),
    ("lens.front.half_width", [11.0, 10.0], "lens.front.half_width in x is 11 in", 1.0),
    ("lens.rear.half_width", [10.0, 9.0], "lens.rear.half_width in y is 9 in", 1.0),
    ("lens.rear.freeform.degree", 5, "lens.rear.freeform.degree in x is 5 in problem.toml and 3 in", 2),
    ("lens.rear.freeform.spans", [4, 5], "lens.rear.freeform.spans in y is 5 in problem.toml and 4 in", 1),
    ("lens.front.freeform.spans", [4, 4], "lens.front.freeform.spans in x is 4 in problem.toml and 3 in", 1),
    (
        "lens.rear.freeform.z_freedom",
        0.04,
        "lens.rear.freeform.z_freedom is 0.04 in problem.toml and 0.0",
        0.01,
    ),
]


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """A lens with two free surfaces."""
    problem, lens = shaped(tmp_path_factory.mktemp("prescription"), BOTH)
    return SimpleNamespace(problem=problem, lens=lens)


@pytest.mark.parametrize("changes", EVERY_LENS)
def test_the_problem_of_a_lens_passes(tmp_path, changes):
    (check,) = prescription_checks(*shaped(tmp_path, changes))
    assert (check.name, check.ok) == ("keys of problem.toml that lens.json contradicts", True)


@pytest.mark.parametrize(("key", "value", "sentence", "off"), CHANGES)
def test_another_problem_is_seen(good, tmp_path, key, value, sentence, off):
    other = load_problem(write_problem(tmp_path, BOTH | {key: value}))
    first, *rest = prescription_checks(other, good.lens)
    assert first.name.startswith(sentence)
    assert not first.ok
    assert first.value == pytest.approx(off, rel=0.2)
    assert all(key.rpartition(".")[2] in check.name for check in rest)


def test_every_key_that_differs_has_its_check(good, tmp_path):
    other = load_problem(write_problem(tmp_path, BOTH | {"lens.index": 1.6, "lens.rear.conic": 0.5}))
    assert [check.value for check in prescription_checks(other, good.lens)] == pytest.approx([0.1, 1.5])


def test_a_lens_without_a_free_surface_is_seen(good):
    rear = FreeformSurface(good.lens.rear.half_width, good.lens.rear.conic)
    (check,) = prescription_checks(good.problem, Lens(good.lens.front, rear, 12.0, 1.5))
    assert check.name.startswith(
        "number of free surfaces by lens.rear.freeform is 1 in problem.toml and 0 in"
    )


def test_a_plane_has_no_side(tmp_path):
    """The lens file keeps no sign of an infinite radius."""
    problem = load_problem(write_problem(tmp_path, {"lens.front.radius": -np.inf}))
    _, lens = shaped(tmp_path)
    plane = Lens(FreeformSurface((10.0, 10.0), Conic(np.inf)), lens.rear, lens.thickness, lens.index)
    assert [check.ok for check in prescription_checks(problem, plane)] == [True]
