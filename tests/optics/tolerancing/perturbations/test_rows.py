"""Rows of elements that are not quite what was designed: each in its own axes, and what is predicted."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from optics.base.runtime import UserError
from optics.scene.problem import Problem
from optics.scene.system import System
from optics.tolerancing.metrology import MeasuredPoints, light_as_built
from optics.tolerancing.monte_carlo_samples import FormTolerance
from optics.tolerancing.perturbations import NOMINAL, LinearLight, Perturbation, PerturbedLight, tolerances_of
from optics.tolerancing.perturbations.perturbation import ElementErrors
from tests.optics.cases import rough
from tests.optics.tolerancing.perturbations.cases import (
    Bowl,
    Waves,
    from_source,
    on_target,
    shaped,
    through,
)
from thbcad.poses import Pose
from thbcad.surfaces import THBSurface

SIZE = (10.0, 10.0)
FREE = {"spans": (4, 4), "max_level": 2, "z_freedom": 1.0}
FIXED = {"freeform": None, "half_width": SIZE}
LENS = {"kind": "lens", "name": "L1", "index": 1.5, "thickness": 6.0, "front": {"half_width": SIZE}}
MIRROR = {"kind": "mirror", "name": "M1", "position": (0, 0, 40), "tilt": (45, 0, 0), "thickness": 5.0}
TARGET = {"kind": "tophat", "pixels": (48, 48), "half_width": (20, 20)}
TARGET |= {"position": (0, 40, 40), "tilt": (-90, 0, 0)}
FOLDED = (  # as examples/folded.toml: light goes through a free lens, and a plane mirror turns it aside
    LENS | {"rear": {"half_width": SIZE, "radius": 40.0, "conic": -1.0, "freeform": FREE}},
    MIRROR | {"face": {"half_width": (20.0, 30.0), "radius": np.inf, "conic": 0.0, "freeform": None}},
)
SPREAD = (  # as examples/two_elements.toml: a fixed lens spreads light before a free mirror
    LENS
    | {"position": (1.0, -0.5, -2.0), "tilt": (3.0, -2.0, 5.0)}
    | {"front": {"half_width": SIZE, "radius": 60.0}, "rear": FIXED | {"radius": 40.0, "conic": -1.0}},
    MIRROR | {"face": {"half_width": (20.0, 30.0), "radius": -500.0, "freeform": FREE}},
)
BOTH = SPREAD[0] | {"rear": FOLDED[0]["rear"]}, SPREAD[1]


def row(*elements, height=0.02, **more):
    """Return the system of elements in a beam along z, the free one rough."""
    source = {"kind": "collimated", "half_width": (7, 7), "distance": 20.0}
    problem = Problem(source=source, element=elements, target=TARGET | more.pop("target", {}), **more)
    system = System(problem)
    spaces = [sag.space for sag in system.sags]
    return system.with_sags([THBSurface(space, rough(space, height)) for space in spaces])


def posed(own, errors):
    """Return rotations and shifts of one body within another, outermost first."""
    turns = Rotation.from_euler("XYZ", own.tilt, degrees=True), Rotation.from_rotvec(errors.lens_tilt)
    return [*zip(turns, (np.array(own.position), np.array(errors.lens_shift)))]


def by_numpy(system, p, origin, direction):
    """Return x and y on the moved target of one ray through SPREAD, in the frame of the scene."""
    one, mirror = system.problem.element
    of, (_, fixed) = p.others["L1"], system.others[0]
    frames, index = posed(one, of), fixed.index + of.index
    front = (Rotation.from_rotvec(of.front_tilt), np.array(of.front_shift))
    behind = (Rotation.identity(), np.array([0.0, 0.0, fixed.thickness + of.thickness]))
    start, ray = from_source(p, origin, direction, -system.problem.source.distance)
    for frame, eta, jet in (
        ([*frames, front], 1 / index, shaped(fixed.front, of.front_error)),
        ([*frames, behind], index, shaped(fixed.rear, power=1 + of.rear_power)),
        (posed(mirror, p), 0.0, shaped(system.designed.front, p.front_error)),
    ):
        start, ray = through(start, ray, frame, jet, eta)
    target = system.problem.target
    turn = Rotation.from_euler("XYZ", target.tilt, degrees=True)
    return on_target(start, ray, p, turn, target.position)


TENTH, FREE_OF_CARE = 0.1, 100.0  # of a pixel; times the usual amount
EVERYTHING = Perturbation(
    lens_shift=(0.3, -0.2, 0.4),
    lens_tilt=(0.02, -0.03, 0.05),
    front_error=Waves(2e-3, 0.2),
    source_shift=(-0.1, 0.2, 0.3),
    source_tilt=(0.01, 0.02, -0.03),
    target_shift=(1.0, 2.0, -3.0),
    target_tilt=(0.1, -0.2, 0.3),
    others={
        "L1": ElementErrors(
            lens_shift=(-0.2, 0.1, 0.3),
            lens_tilt=(-0.02, 0.01, 0.04),
            front_shift=(0.2, 0.1, -0.05),
            front_tilt=(-0.01, 0.02, 0.03),
            thickness=0.1,
            index=0.01,
            rear_power=0.02,
            front_error=Waves(1e-3, 0.3),
        )
    },
)


def test_rays_land_where_numpy_has_them_with_everything_wrong(backend):
    system = row(*SPREAD)
    light = PerturbedLight(system, backend)
    parts = light.parts(EVERYTHING)
    rays = system.source.rays((4, 5)).rays(-50.0)
    _, landing = light.trace_through(parts)(parts.rays(rays))
    expected = [by_numpy(system, EVERYTHING, o, d) for o, d in zip(rays.origin.T, rays.direction.T)]
    found = np.column_stack([landing.x.numpy(), landing.y.numpy()])
    # as through one lens: heights of the third order in 2e-3 are left
    np.testing.assert_allclose(found, expected, atol=2e-7, rtol=0)


def test_no_perturbation_leaves_the_path_as_it_is(backend):
    system = row(*SPREAD)
    path, nominal = (
        system.path,
        PerturbedLight(system, backend).parts(NOMINAL).path,
    )
    assert nominal.media == path.media
    assert nominal.receiver == path.receiver
    for own, same in zip(path.surfaces, nominal.surfaces):
        assert own.pose == same.pose
        assert own.shape is same.shape
    assert path.moved([Pose.at()] * 4) is path


def prediction_errors(light, names=None):
    """Return the errors of the predicted change at a tenth of a pixel in the retraced one, by name.

    Of what light shows by a hundred times the usual amount: the lens that turns about its axis moves it less.
    """
    linear, errors = LinearLight(light), {}
    for tolerance in tolerances_of(light.system):
        p = tolerance.at(tolerance.amount)
        times = TENTH * light.screen.pitch[0] / light.moved_by(p)
        if times < FREE_OF_CARE and (names is None or tolerance.name in names):
            change = light(times * p)[0] - linear.irradiance
            predicted = linear.moved(times * p)[1] - linear.irradiance
            errors[tolerance.name] = np.linalg.norm(predicted - change) / np.linalg.norm(change)
    return errors


def test_the_change_by_a_fixed_mirror_is_predicted(backend):
    names = "L1.decentre_x", "M1.tilt_x", "M1.defocus", "target.defocus"
    errors = prediction_errors(PerturbedLight(row(*FOLDED, target={"pixels": (24, 24)}), backend), names)
    assert {*errors} == {*names}
    assert max(errors.values()) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("elements", [FOLDED, SPREAD, BOTH], ids=["folded", "spread", "two free"])
def test_the_change_by_every_tolerance_is_predicted(backend, elements):
    errors = prediction_errors(PerturbedLight(row(*elements), backend))
    assert len(errors) >= 25
    assert max(errors.values()) < 0.02, errors


def test_each_element_has_its_tolerances_by_name():
    system = row(*SPREAD)
    amounts = {"L1.tilt": 0.7, "M1.face.power": 0, "L1.temperature": 0}
    found = {t.name: t.amount for t in tolerances_of(system, amounts)}
    placed = ["decentre_x", "decentre_y", "defocus", "tilt_x", "tilt_y"]
    front = [f"front.{name}" for name in placed if name != "defocus"]
    of_lens = [*placed, "thickness", "index", *front, "front.power", "rear.power"]
    named = [f"M1.{name}" for name in [*placed, "tilt_z"]] + [f"L1.{name}" for name in of_lens]
    assert [name for name in found if name[1:3] == "1."] == named
    assert found["L1.tilt_x"] == 0.7
    assert found["source.tilt_x"] == 0.1


WRONG = [
    ({"M2.tilt_x": 1.0}, "begin with L1, M1, source, target, such as L1.decentre_x, got 'M2.tilt_x'"),
    ({"index": 1.0}, "begin with L1, M1, source, target"),
    ({"M1.index": 1.0}, "M1 is a mirror, which has no index; leave M1.index out"),
    ({"M1.temperature": 20.0}, "M1 is a mirror, which has no temperature"),
    ({"M1.decentre": 0.1}, "M1 is plane, so that it has no middle"),
    ({"M1.face.power": 0.1}, "M1.face is plane, so that it has no radius"),
    ({"L1.front.decentre_x": 0.1}, "L1.front is plane"),
    ({"L1.temperature": 20.0}, "how L1 changes with temperature is not known: element.L1.material names no"),
    ({"L1.tillt_x": 1.0}, "did you mean L1.tilt_x"),
]


@pytest.mark.parametrize(("amounts", "words"), WRONG)
def test_what_an_element_cannot_have_is_one_sentence(amounts, words):
    system = row(*FOLDED)
    with pytest.raises(UserError, match=words) as error:
        tolerances_of(system, amounts)
    assert "\n" not in str(error.value)


def test_a_bowl_on_a_face_that_is_met_from_behind_is_another_power(backend):
    """Light goes through the front, is reflected by the rear, leaves by the front, and meets a mirror."""
    face = {"half_width": (20, 30), "radius": np.inf, "freeform": FREE}
    glass = LENS | {"name": "L2", "front": {"half_width": SIZE, "radius": 80.0, "conic": -1.0}}
    elements = (
        glass | {"rear": FIXED | {"reflectance": 0.9}, "tilt": (10, 0, 0)},
        MIRROR | {"face": face, "position": (0, 14.6, -40), "tilt": (180, 0, 0)},
    )
    faces = ["L2.front", "L2.rear:reflect", "L2.front", "M1"]
    place = {"position": (0, 36.4, 20), "tilt": (0, 0, 0)}
    light = PerturbedLight(row(*elements, path=({"faces": faces},), target=place), backend)
    bowl, power = (
        Perturbation(others={"L2": errors})
        for errors in (ElementErrors(front_error=Bowl(0.01 / 80)), ElementErrors(front_power=0.01))
    )
    (by_height, fates), (by_power, _), (image, _) = light(bowl), light(power), light()
    assert fates.on_target > 0.1
    assert np.linalg.norm(by_height - by_power) < 1e-8 * np.linalg.norm(image)
    assert np.linalg.norm(by_power - image) > 1e-3 * np.linalg.norm(image)


def test_a_form_is_that_of_a_face_of_the_path():
    system = row(*SPREAD)
    band = (4.0, 10.0)
    drawn = FormTolerance("L1.rear", 1e-5, band).drawn(system, 3)
    assert drawn.others["L1"].rear_error.half_width == SIZE
    assert FormTolerance("M1.face", 1e-5, band).drawn(system, 3).front_error.half_width == (
        20,
        30,
    )
    with pytest.raises(UserError, match=r'one of "L1\.front" or "L1\.rear" or "M1\.face", got'):
        FormTolerance("rear", 1e-5, band).drawn(system, 3)


@pytest.mark.slow
@pytest.mark.parametrize(("elements", "side"), [(FOLDED, "rear"), (SPREAD, "front")], ids=["lens", "mirror"])
def test_a_made_element_of_a_row_gives_the_light_of_its_error(backend, elements, side):
    """That of its refitted surface is that of the designed one with the error itself, for 8000 points."""
    system = row(*elements, target={"pixels": (24, 24)})
    designed, waves = getattr(system.designed, side), Waves(1e-3, 0.7)
    x, y = np.random.default_rng(1).uniform(-1, 1, (2, 8000)) * np.reshape(designed.half_width, (2, 1))
    points = MeasuredPoints(np.stack([x, y, designed(x, y) + waves.jet(x, y)[0]]))
    built = light_as_built(system, points, backend, side, correct=False)
    light = PerturbedLight(system, backend)
    (image, _), (wrong, _) = light(), light(Perturbation(**{f"{side}_error": waves}))
    made, _ = PerturbedLight(system.with_lens(built.lens), backend)()
    assert np.linalg.norm(made - wrong) < 0.02 * np.linalg.norm(wrong - image)
    assert built.known == 1


def test_the_back_of_a_mirror_makes_no_light(backend):
    system = row(*SPREAD)
    points = MeasuredPoints(np.stack([*np.random.default_rng(1).uniform(-9, 9, (2, 400)), np.zeros(400)]))
    with pytest.raises(UserError, match=r"does not meet the back of element\.M1; take its front"):
        light_as_built(system, points, backend, "rear")


@pytest.mark.slow
def test_a_lens_that_moves_into_the_light_of_a_mirror_takes_more_of_it(backend):
    """It goes back in the direction (0, sqrt(3), -1) / 2, beside the upper edge of a plane rear or onto it.

    From y it comes to z = 6 at 2 y + sqrt(3) (Z - 6), where the mirror stands at Z: what is before 10 ends.
    """
    height = 6 + 20 / np.sqrt(3)
    near = {"position": (0, 0, height), "tilt": (30, 0, 0), "reflectance": 1.0, "face": FOLDED[1]["face"]}
    plate = LENS | {"rear": {"half_width": SIZE, "radius": np.inf, "conic": 0.0, "freeform": FREE}}
    place = {"position": (0, 30 * np.sqrt(3), height - 30), "tilt": (-120, 0, 0)}
    light = PerturbedLight(row(plate, MIRROR | near, height=0.0, target=place), backend)
    for depth in (0.0, 0.5):
        _, fates = light(Perturbation(lens_shift=(0.0, 0.0, depth)))
        strip = 2 + depth * np.sqrt(3) / 2  # of 14 mm; the finest cells are a 2000th of it
        assert fates.blocked == pytest.approx(0.96**2 * strip / 14, abs=1 / 2000)
