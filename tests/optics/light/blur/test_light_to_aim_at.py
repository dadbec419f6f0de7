"""The sharp light whose blur comes nearest to a target."""

import numpy as np
import pytest
from scipy.optimize import minimize

from optics.base.runtime import load_backend
from optics.light.blur import Blur, LandingShifts, aimed, aimed_light
from optics.light.blur.light_to_aim_at import LOST, PEAK
from optics.scene.receivers import Screen
from optics.scene.sources import Divergence
from optics.scene.system import System
from tests.optics.cases import small_problem, small_system

SCREEN = Screen((8.0, 6.0), (16, 12))
SHIFTS = LandingShifts(200 * np.eye(2), np.zeros((2, 2)), np.zeros((2, 2)), 0.0)
SUN = {"source.divergence_profile": "sun", "source.divergence": 2.0}


def disk(radius):
    """Return the blur of a disk of light.  radius : mm."""
    return Blur(Divergence("uniform", np.degrees(radius / 200)), (0.0, 0.0), SHIFTS)


def picture():
    """Return light with a dark half, of unit rms."""
    x, y = SCREEN.centres
    light = (0.2 + np.exp(-(x[None] ** 2) / 8)) * (y[:, None] > 0)
    return light / np.sqrt((light**2).mean())


def test_the_blur_onto_a_screen_and_back_are_adjoint():
    blurred = disk(1.6).onto(SCREEN)
    random = np.random.default_rng(3)
    light, image = random.normal(size=blurred.wide.shape), random.normal(size=SCREEN.shape)
    assert np.vdot(blurred(light), image) == pytest.approx(np.vdot(light, blurred.back(image)), rel=1e-12)


def test_no_other_light_has_a_lower_cost():
    """Against scipy's L-BFGS-B on the cost in words, with the blur as a dense matrix."""
    blur, target = disk(1.6), picture()
    wide, found = aimed_light(blur, SCREEN, target)
    blurred = blur.onto(SCREEN)
    matrix = np.array([blurred(unit.reshape(wide.shape)).ravel() for unit in np.eye(found.size)]).T
    cost = LOST * (1 - matrix.sum(axis=0))

    def value(light):
        rest = matrix @ light - target.ravel()
        return rest @ rest / 2 + cost @ light, matrix.T @ rest + cost

    bounds = [(0, PEAK * target.max())] * found.size
    best = minimize(value, found.ravel(), jac=True, bounds=bounds, options={"maxiter": 2000, "ftol": 1e-14})
    assert value(found.ravel())[0] < best.fun * (1 + 2e-3)
    assert found.min() >= 0
    assert found.max() <= PEAK * target.max()


def test_its_blur_is_nearer_than_that_of_the_target():
    blur, target = disk(1.6), picture()
    _, found = aimed_light(blur, SCREEN, target)
    plain = np.pad(target, blur.reach(SCREEN))
    off, off_plain = (np.linalg.norm(blur.onto(SCREEN)(light) - target) for light in (found, plain))
    assert off < 0.7 * off_plain


def test_it_does_not_depend_on_the_scale_and_keeps_symmetry():
    blur, target = disk(1.6), picture()
    wide, found = aimed_light(blur, SCREEN, target)
    _, scaled = aimed_light(blur, SCREEN, 1e-7 * target)
    assert wide.shape == tuple(n + 2 * blur.reach(SCREEN) for n in SCREEN.shape)
    assert scaled == pytest.approx(found)
    assert np.fliplr(found) == pytest.approx(found, abs=1e-10)


def test_a_blur_much_narrower_than_a_pixel_leaves_the_target():
    _, found = aimed_light(disk(0.01), SCREEN, picture())
    assert found[1:-1, 1:-1] == pytest.approx(picture(), abs=1.5 * LOST)


def test_a_blurred_system_gets_an_aim_and_others_stay(tmp_path):
    backend = load_backend("double", 1)
    blurred = small_system(tmp_path, SUN)
    system = aimed(blurred, backend)
    assert not system.blurred
    assert system.aim is not None
    assert system.target.settings == blurred.target.settings
    assert system.goal.screen().pitch == pytest.approx(blurred.target.screen().pitch)
    light = system.goal.irradiance(system.goal.screen(), 2.0)
    assert light.sum() * system.goal.screen().pixel_area == pytest.approx(2.0)
    assert aimed(system, backend) is system
    plain = small_system(tmp_path)
    assert aimed(plain, backend) is plain
    assert plain.goal is plain.target


@pytest.mark.slow
def test_a_wide_blur_is_aimed_through_on_merged_pixels(tmp_path):
    """It hides them anyway, and reaches far: 12 degrees over 60 mm are 16 pixels here, or a thousand."""
    for pixels, most in ((48, 48 + 2 * 20), (2048, 2048 // 8 + 2 * 66)):
        changes = {"source.divergence": 12.0, "target.pixels": [pixels, pixels]}
        blurred = small_system(tmp_path, changes)
        screen = aimed(blurred, load_backend("double", 1)).goal.screen()
        assert max(screen.pixels) <= most


def test_the_far_field_has_an_aim_of_intensities(tmp_path):
    far = {"target.distance": float("inf"), "target.half_width": [15.0, 15.0], "target.kind": "tophat"}
    problem = small_problem(tmp_path, SUN | far, drop=("target.image",))
    blurred = System(problem)
    system = aimed(blurred, load_backend("double", 1))
    screen = system.goal.screen()
    assert screen.angular
    assert system.goal.irradiance(screen, 1.0).sum() * screen.pixel_area == pytest.approx(1.0)
