"""The light of a plate is that of all its lenses: N times one in the far field, else shifted and added."""

from dataclasses import replace

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.designing.etendue import bounds_hold
from optics.light.analysis import crosstalk, measure
from optics.light.outgoing import outgoing_intensity, outgoing_rays
from optics.scene.system import System
from optics.tolerancing.form_errors import form_errors_of
from optics.tolerancing.machining import light_with_cusps
from optics.tolerancing.perturbations import PerturbedLight
from tests.optics.cases import small_problem

PLATE = {"lens.array.columns": 2, "lens.array.rows": 1, "lens.array.pitch": 25.0, "lens.thickness": 8.0}
POINT = {"source.kind": "point", "source.half_angle": 70.0, "source.distance": 4.0}
FAR = {"target.distance": np.inf, "target.half_width": [60.0, 60.0]}
TWICE = 0.04**2  # of the light of a beam is reflected twice within the lens, and may take other ways
NEAR = {"target.half_width": [50.0, 50.0], "target.pixels": [32, 32], "target.distance": 60.0}


@pytest.fixture
def pair(tmp_path):
    """Return the systems of a plate and of one of its lenses."""

    def made(keys):
        plate = small_problem(tmp_path, PLATE | keys)
        return System(plate), System(replace(plate, lens=replace(plate.lens, array=None)))

    return made


def test_what_follows_one_lens_leaves_the_sum_of_a_plate_alone(pair, backend):
    plate, one = pair(NEAR)
    order, slopes = ("rear", lambda x, y: np.zeros((2, x.size))), 0.1
    assert light_with_cusps(plate, backend, *order, slopes) is None
    assert light_with_cusps(one, backend, *order, slopes) is not None
    with pytest.raises(UserError, match=r"errors of form .* a plate is a sum; leave out lens\.array"):
        form_errors_of(plate, backend, 0.01)
    assert (bounds_hold(plate), bounds_hold(one)) == (False, False)  # no extent
    lamps = pair(NEAR | POINT | {"source.kind": "lambertian", "source.half_width": [0.5, 0.5]})
    assert [bounds_hold(system) for system in lamps] == [False, True]


def test_in_the_far_field_two_lenses_give_twice_the_light_of_one(pair, backend):
    plate, one = (measure(system, backend) for system in pair(FAR))
    assert plate.irradiance == pytest.approx(2 * one.irradiance, rel=1e-12)
    assert plate.target == pytest.approx(2 * one.target, rel=1e-12)
    for name in ("rel_l2", "efficiency", "lit_efficiency", "stray"):
        assert plate.metrics[name] == pytest.approx(one.metrics[name], rel=1e-12)


def test_on_a_plane_the_light_of_one_is_shifted_by_half_a_pitch_to_either_side_and_added(pair, backend):
    """Half a pitch is four pixels, and the light of one lens lies within."""
    plate, one = (measure(system, backend) for system in pair(NEAR))
    beside = np.pad(one.irradiance, ((0, 0), (4, 4)))
    assert one.irradiance[:, [*range(4), *range(-4, 0)]].max() == 0
    assert plate.irradiance == pytest.approx(beside[:, 8:] + beside[:, :-8], abs=1e-9 * one.irradiance.max())
    assert plate.metrics["efficiency"] == pytest.approx(one.metrics["efficiency"], rel=1e-9)


@pytest.mark.slow
def test_a_beam_leaves_neighbours_dark_and_a_point_does_not(pair, backend):
    beam, point = (pair(FAR | keys)[0] for keys in ({}, POINT))
    assert crosstalk(beam, backend)["crosstalk"] < TWICE
    found = crosstalk(point, backend)
    assert found["crosstalk"] > 5 * found["crosstalk_error"] > 0


def test_rays_for_other_programs_start_at_every_lens(pair, backend):
    plate, one = pair(FAR)
    all_of_plate = outgoing_rays(plate, backend, 2 * 32**2, "rear")
    of_one = outgoing_rays(one, backend, 32**2, "rear")
    assert all_of_plate.total == pytest.approx(2 * of_one.total, rel=1e-12)
    here, beside = np.split(all_of_plate.position, 2)
    assert (here == of_one.position).all()
    assert beside == pytest.approx(np.add(of_one.position, (25.0, 0.0, 0.0)), rel=1e-15)


@pytest.mark.slow
def test_the_intensity_for_other_programs_is_that_of_all_sources(pair, backend):
    plate, one = (outgoing_intensity(system, backend, 4096, 10.0) for system in pair(FAR))
    assert plate.flux == pytest.approx(2 * one.flux, rel=TWICE)
    assert plate.luminaire.opening.size == (50.0, 25.0)


def test_tolerances_of_a_plate_are_refused_where_its_light_is_a_sum(pair, backend):
    near, far = (pair(keys)[0] for keys in (NEAR, FAR))
    assert PerturbedLight(far, backend).screen == far.target.screen()
    with pytest.raises(UserError, match=r"leave out lens\.array, or take the far field"):
        PerturbedLight(near, backend)
