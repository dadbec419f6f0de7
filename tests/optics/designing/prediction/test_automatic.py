"""What a problem leaves to the program comes from the transport map: base lens, bounds of sags, levels."""

import re

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.designing.optimisation import first_fit
from optics.designing.prediction import resolved
from optics.designing.prediction.freedom_note import freedom_note
from optics.designing.starts import TransportStart
from optics.light.analysis import measure
from optics.scene.keys import AUTO, problem_to_toml
from optics.scene.problem import FINEST_AUTO, Problem, load_problem
from optics.scene.system import System, solvable_system
from tests.optics.cases import small_system, write_problem

AUTOMATIC = {"lens.rear.freeform.max_level": AUTO, "lens.rear.freeform.z_freedom": 20.0}
BASE = {"lens.rear.radius": AUTO, "lens.rear.conic": AUTO, "lens.rear.freeform.z_freedom": AUTO}
WHITE = np.full((48, 48), 255, dtype=np.uint8)
BOARD = (200 * ((np.indices((96, 96)) // 6).sum(axis=0) % 2) + 20).astype(np.uint8)


def based(folder, backend, changes, image=WHITE):
    """Return the small problem with a base lens from the transport map."""
    return resolved(solvable_system(small_system(folder, BASE | changes, image=image).problem), backend)[0]


def level_of(folder, backend, picture=None, changes=None):
    system, start = resolved(small_system(folder, AUTOMATIC | (changes or {}), picture), backend)
    assert start is not None
    return system.problem.lens.rear.freeform.max_level


def test_finer_detail_takes_more_levels(tmp_path, backend):
    """A smooth slope of light needs the least level, a board of few pixels' squares the finest."""
    across = np.linspace(60, 200, 96)
    smooth = np.round(np.tile(across, (96, 1))).astype(np.uint8)
    least, most = (level_of(tmp_path, backend, picture) for picture in (smooth, BOARD))
    assert least == 3
    assert least < most <= FINEST_AUTO


def test_dense_meshes_have_the_base_of_coarse_ones(tmp_path, backend):
    """More functions than the coarse map has cells: the bound of the sag is still that of its slopes."""
    bounds = []
    for spans in ([7, 7], [20, 3], [40, 40]):
        changes = {"lens.rear.freeform.spans": spans, "lens.rear.freeform.max_level": 0}
        bounds.append(based(tmp_path, backend, changes).freeforms[-1].freedom)
    assert bounds == pytest.approx([bounds[0]] * 3, rel=0.1)


@pytest.mark.slow
def test_levels_of_dense_meshes_have_cells(tmp_path, backend):
    """The start on the mesh that is chosen casts a ramp on few pixels, however many spans level 0 has."""
    ramp = np.tile(np.linspace(100, 255, 24).astype(np.uint8), (24, 1))
    for spans in ([7, 7], [20, 3], [60, 60]):
        changes = {"target.pixels": [24, 24], "lens.rear.freeform.spans": spans}
        system, start = resolved(small_system(tmp_path, AUTOMATIC | changes, ramp), backend)
        sag = start.finest_fit().sag
        assert sag.space.levels == system.freeforms[-1].finest + 1
        assert measure(system.with_lens(system.base.with_sags([sag])), backend).metrics["rel_l2"] < 0.03


def test_a_level_that_is_chosen_starts_like_the_same_level_as_a_number(tmp_path, backend):
    """Noise on few pixels takes a level that asks for more cells than the map had which told it."""
    noise = np.random.default_rng(0).integers(55, 255, (48, 48)).astype(np.uint8)
    changes = {"target.pixels": [48, 48], "lens.rear.freeform.spans": [7, 7]}
    system, start = resolved(small_system(tmp_path, AUTOMATIC | changes, noise), backend)
    assert system.freeforms[-1].finest > 3
    known = TransportStart(system, backend)
    fits = start.finest_fit(), known.finest_fit()
    assert np.array_equal(*(fit.sag.coefficients for fit in fits))


@pytest.mark.slow
def test_detail_that_the_blur_hides_takes_no_levels(tmp_path, backend):
    """Squares of 6 pixels: a spot of a third of a pixel leaves them, one of 17 pixels does not."""
    sharp = level_of(tmp_path, backend, BOARD)
    hardly, much = (
        level_of(tmp_path, backend, BOARD, {"source.divergence": degrees}) for degrees in (0.03, 1.5)
    )
    assert sharp >= hardly > 3
    assert much == 3


@pytest.mark.slow
def test_even_light_takes_no_levels_for_texture(tmp_path, backend):
    """The same disk in a cone of light, asked for as even light and as a picture."""
    cone = {"source.kind": "point", "source.half_angle": 20.0, "source.distance": 30.0}
    asked = cone | {"target.pixels": [96, 96]}
    even = {"target.kind": "tophat", "target.shape": "ellipse", "target.lit": [0.9, 0.9]}
    x, y = (2 * np.indices((96, 96)) + 1) / 96 - 1
    picture = np.uint8(255 * (np.hypot(x, y) < 0.9))
    as_light = level_of(tmp_path, backend, changes=asked | even)
    assert 3 == as_light < level_of(tmp_path, backend, picture, asked)


def test_numbers_are_left_as_they_are(tmp_path, backend):
    system = small_system(tmp_path)
    assert resolved(system, backend) == (system, None)


def test_the_choice_is_written_into_the_result_as_a_number(tmp_path, backend):
    system, _ = resolved(small_system(tmp_path, AUTOMATIC), backend)
    (tmp_path / "again.toml").write_text(problem_to_toml(system.problem), "utf-8")
    level = load_problem(tmp_path / "again.toml").lens.rear.freeform.max_level
    assert type(level) is int
    assert level == system.problem.lens.rear.freeform.max_level


def test_auto_survives_the_trip_through_toml(tmp_path):
    system = small_system(tmp_path, AUTOMATIC)
    assert system.problem.lens.rear.freeform.finest == FINEST_AUTO
    (tmp_path / "again.toml").write_text(problem_to_toml(system.problem), "utf-8")
    assert load_problem(tmp_path / "again.toml") == system.problem


@pytest.mark.parametrize("value", ["fine", "Auto", True, 2.5, -1, 13])
def test_other_levels_are_refused_with_the_key(tmp_path, value):
    with pytest.raises(UserError, match=r"lens\.rear\.freeform\.max_level must be"):
        load_problem(write_problem(tmp_path, {"lens.rear.freeform.max_level": value}))


@pytest.mark.parametrize("half", [20.0, 5.0])
def test_the_base_is_the_paraboloid_that_spreads_the_beam(tmp_path, backend, half):
    """The map is linear: x goes to m x.  The slope at the middle, from Snell's law for small angles, is
    (m - 1) x / ((n - 1) D); over the aperture, up to 10 degrees, tangents and sines differ by 5 %."""
    rear = based(tmp_path, backend, {"target.half_width": [half, half]}).problem.lens.rear
    assert rear.radius == pytest.approx((1.5 - 1) * 60 / (half / 9.5 - 1), rel=0.1)
    assert rear.conic == -1.0
    assert rear.freeform.z_freedom == 0.1  # the least: a hundredth of the half-width


def test_a_beam_that_is_not_bent_starts_from_a_plane(tmp_path, backend):
    assert based(tmp_path, backend, {"target.half_width": [9.5, 9.5]}).base.rear.conic.is_plane


def test_the_base_leaves_the_map_within_reach_where_a_number_was_a_trap(tmp_path, backend):
    """A diverging base and a target smaller than the beam: z_freedom cuts off most of the map."""
    small = {"target.half_width": [5.0, 5.0], "lens.rear.freeform.z_freedom": 0.3}
    arriving = []
    for system in (small_system(tmp_path, small), based(tmp_path, backend, small | BASE)):
        start = TransportStart(system, backend)
        lens = system.base.with_sags([start.fit(system.base.sags[-1].space.uniform(1)).sag])
        arriving.append(measure(system.with_lens(lens), backend).metrics["efficiency"])
    assert arriving[0] < 0.5
    assert arriving[1] > 0.9


def test_given_numbers_stay_and_the_bound_follows_them(tmp_path, backend):
    """Half of the map's sag against the plane is left to a base of half of its curvature."""
    bounds = []
    for radius in (np.inf, 55.0):
        rear = based(
            tmp_path, backend, {"lens.rear.radius": radius, "lens.rear.conic": -1.0}
        ).problem.lens.rear
        assert (rear.radius, rear.conic) == (radius, -1.0)
        bounds.append(rear.freeform.z_freedom)
    assert bounds[1] == pytest.approx(bounds[0] / 2, rel=0.15)


PLANE = {"lens.rear.radius": np.inf, "lens.rear.conic": -1.0, "lens.thickness": 2.0}
CONE = {"source.kind": "point", "source.distance": 20.0, "source.half_angle": 20.0}


@pytest.mark.every(3)
@pytest.mark.parametrize(
    "changes",
    [
        PLANE,  # 1.05 times the sag of the map is more than its two digits
        PLANE | CONE | {"target.half_width": [30.0, 30.0]},  # the first mesh asks for half as much again
        PLANE | CONE | {"target.half_width": [30.0, 30.0], "lens.rear.freeform.max_level": AUTO},
    ],
    ids=["parallel", "cone", "levels"],
)
def test_nobody_is_told_to_raise_a_bound_that_the_program_chose(tmp_path, backend, changes):
    system, start = resolved(small_system(tmp_path, BASE | changes), backend)
    fits = [first_fit(system, start), start.finest_fit()]
    assert freedom_note(system, backend, start, fits) == ""
    assert TransportStart(system, backend).within(fits[0])


def test_a_thin_lens_keeps_its_thickness(tmp_path, backend):
    """Without limits the paraboloid of R = -64.5 would fall 1.6 mm to the corner of a lens of 1 mm."""
    system = based(tmp_path, backend, {"lens.thickness": 1.0, "target.half_width": [5.0, 5.0]})
    assert system.base.least_thickness().lower > 0.1


@pytest.mark.slow
def test_rays_that_spread_in_the_lens_have_a_map_too(tmp_path, backend):
    changes = {"source.kind": "point", "source.distance": 20.0, "source.half_angle": 20.0}
    system = based(tmp_path, backend, changes)
    start = TransportStart(system, backend)
    assert start.traced is not None
    assert start.within(start.traced)


@pytest.mark.slow
def test_a_target_out_of_reach_is_refused_with_what_to_do(tmp_path, backend):
    changes = {"source.kind": "point", "source.distance": 20.0, "source.half_angle": 20.0}
    with pytest.raises(UserError, match=r'"auto" stands for: .* only \d+% of the light .*target\.half_width'):
        based(tmp_path, backend, changes | {"target.half_width": [100.0, 100.0]})


@pytest.mark.slow
def test_an_element_whose_target_lies_out_of_reach_is_told_where_it_would_serve(tmp_path, backend):
    """A part lies 50 degrees aside, beyond arccos(1 / 1.5): the place that is named has a base lens."""
    automatic = {
        "radius": AUTO,
        "conic": AUTO,
        "freeform": {"z_freedom": AUTO, "max_level": 1, "spans": [4, 4]},
    }
    lens = {
        "kind": "lens",
        "name": "L1",
        "position": (0, 0, 2),
        "index": 1.5,
        "thickness": 6.0,
        "front": {"half_width": [10, 10]},
    }
    problem = Problem(
        source={"kind": "collimated", "half_width": (9.5, 6.5)},
        element=[lens | {"rear": {"half_width": [10, 10]} | automatic}],
        target={
            "kind": "tophat",
            "position": (60, 0, 70),
            "tilt": (0, 40, 0),
            "half_width": (20, 20),
            "pixels": (32, 32),
        },
    )
    with pytest.raises(UserError, match=r"of the light to where it should go") as caught:
        resolved(solvable_system(problem), backend)
    (place,) = re.findall(r"--set 'target\.position=\[(.*?)\]'", str(caught.value))
    nearer = problem.with_(**{"target.position": [float(p) for p in place.split(",")]})
    assert not resolved(solvable_system(nearer), backend)[0].problem.optic.automatic


def test_all_that_was_left_to_the_program_is_written_as_numbers(tmp_path, backend):
    front = {"lens.front.radius": AUTO, "lens.front.conic": AUTO, "lens.front.freeform.z_freedom": AUTO}
    front |= {"lens.front.freeform.spans": [4, 4]}
    system = based(tmp_path, backend, front)
    text = problem_to_toml(system.problem)
    assert AUTO not in text.replace("auto_", "")
    (tmp_path / "again.toml").write_text(text, "utf-8")
    again = load_problem(tmp_path / "again.toml")
    assert again == system.problem
    assert not again.lens.automatic
    assert System(again).base.front.conic.is_plane


@pytest.mark.parametrize("key", BASE)
@pytest.mark.parametrize("value", ["Auto", True])
def test_other_words_are_refused_with_the_key(tmp_path, key, value):
    with pytest.raises(UserError, match=rf'{key} must be a number or "auto"'):
        load_problem(write_problem(tmp_path, {key: value}))
