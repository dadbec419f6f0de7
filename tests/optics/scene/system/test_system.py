"""A system is a value: other shapes make another system, and what the prescription says is shared."""

import pickle
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

import optics
from optics.light.analysis import measure
from optics.scene.system import System
from tests.optics.cases import rough, small_problem, small_system
from thbcad.surfaces import THBSurface


def shaped_lens(system, height=0.05):
    (sag,) = system.base.sags
    return system.base.with_sags([THBSurface(sag.space, rough(sag.space, height))])


@pytest.fixture(params=["of the problem", "for scripts"])
def system(request, tmp_path):
    if request.param == "for scripts":
        return optics.System(small_problem(tmp_path))
    return small_system(tmp_path)


def test_another_lens_makes_another_system_of_the_same_class(system):
    lens = shaped_lens(system)
    shaped = system.with_lens(lens)
    assert type(shaped) is type(system)
    assert shaped.designed is lens
    assert system.designed is system.base is shaped.base is shaped.unshaped.designed
    assert [*shaped.path.sags] == [*shaped.sags] == [*lens.sags]
    again = system.with_sags(lens.sags)
    assert again.designed.rear.sag is lens.rear.sag
    with pytest.raises(FrozenInstanceError):
        shaped.shapes = {}


def test_what_the_prescription_says_is_computed_once(system):
    shaped = system.with_lens(shaped_lens(system))
    assert shaped.target is system.target
    assert shaped.source is system.source
    assert shaped.with_lens(shaped.base).skips is system.skips


def test_another_prescription_computes_anew_and_keeps_the_shapes(tmp_path):
    system = small_system(tmp_path)
    shaped = system.with_lens(shaped_lens(system))
    farther = system.problem.with_(**{"target.distance": 90.0})
    for other in (shaped.with_prescription(problem=farther), replace(shaped, problem=farther)):
        assert other.designed is shaped.designed
        z = other.target.receiver.pose.shift[2]
        assert z == pytest.approx(system.problem.lens.thickness + 90.0)
        assert z != system.target.receiver.pose.shift[2]


def test_a_pickle_has_the_shapes_and_nothing_that_can_be_computed(system):
    shaped = system.with_lens(shaped_lens(system))
    assert shaped.target.light.size > 0  # known now
    kept = pickle.loads(pickle.dumps(shaped))
    assert type(kept) is type(system)
    assert kept.computed == {}
    np.testing.assert_array_equal(kept.sags[0].coefficients, shaped.sags[0].coefficients)
    assert kept.problem == shaped.problem


def test_a_measurement_is_that_of_the_designed_lens(tmp_path, backend):
    """No argument can be forgotten: the lens is in the system."""
    system = small_system(tmp_path)
    shaped = system.with_lens(shaped_lens(system, 0.2))
    before, after = (measure(s, backend).irradiance for s in (system, shaped))
    assert np.linalg.norm(after - before) > 0.1 * np.linalg.norm(before)
    np.testing.assert_array_equal(
        measure(System(shaped.problem, shapes=shaped.shapes), backend).irradiance, after
    )
