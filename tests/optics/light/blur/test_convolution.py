"""The blur as a convolution: its transfer function against random rays, its flux, and its adjoint."""

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.light.blur import Blur, LandingShifts
from optics.scene.receivers import Screen
from optics.scene.sources import Divergence

SCREEN = Screen((16.0, 12.0), (64, 40))
SHIFTS = LandingShifts(
    beam=np.array([[200.0, 20.0], [-10.0, 170.0]]),
    front=np.array([[-90.0, 0.0], [5.0, -100.0]]),
    rear=np.array([[110.0, 4.0], [0.0, 95.0]]),
    variation=0.0,
)
RAYS = 400_000
KINDS = ["uniform", "theta_uniform", "gaussian", "sun"]


def blurs():
    yield from (pytest.param(Blur(Divergence(kind, 0.4), (0.0, 0.0), SHIFTS), id=kind) for kind in KINDS)
    yield pytest.param(Blur(None, (0.004, 0.007), SHIFTS), id="rough")
    yield pytest.param(Blur(Divergence("sun", 0.4), (0.0, 0.005), SHIFTS), id="sun on a rough rear")


def landings(blur, rng):
    """Where random rays of one point land, (n, 2)."""
    moved = np.zeros((RAYS, 2))
    if blur.spread is not None:
        u, turn = rng.uniform(0, 1, RAYS), rng.uniform(0, 2 * np.pi, RAYS)
        sine = blur.spread.stretch(u) * np.sqrt(u)
        moved += np.stack([sine * np.cos(turn), sine * np.sin(turn)], axis=1) @ SHIFTS.beam.T
    for rms, matrix in zip(blur.slope_rms, (SHIFTS.front, SHIFTS.rear)):
        moved += rng.normal(0, rms, (RAYS, 2)) @ matrix.T
    return moved


@pytest.mark.every(2)
@pytest.mark.parametrize("blur", [*blurs()])
def test_the_transfer_function_is_the_mean_wave_of_random_rays(blur):
    moved = landings(blur, np.random.default_rng(1))
    found = blur.transfer(SCREEN, SCREEN.shape)
    fx = np.fft.rfftfreq(64) / SCREEN.pitch[0]
    fy = np.fft.fftfreq(40) / SCREEN.pitch[1]
    for row, column in ((0, 0), (0, 5), (3, 0), (2, 3), (35, 6), (20, 32)):
        wave = np.exp(-2j * np.pi * (moved[:, 0] * fx[column] - moved[:, 1] * fy[row])).mean()
        assert abs(found[row, column] - wave) < 5 / np.sqrt(RAYS)


@pytest.mark.every(3)
@pytest.mark.parametrize("blur", [*blurs()])
def test_the_spot_is_the_histogram_of_random_rays(blur):
    """On pixels: second moments agree, and nothing is beyond its reach."""
    rng = np.random.default_rng(2)
    moved = landings(blur, rng) + rng.uniform(-0.5, 0.5, (RAYS, 2)) * SCREEN.pitch
    spot = blur.kernel(SCREEN)
    rows, columns = (s // 2 for s in spot.shape)
    y, x = np.mgrid[rows : -rows - 1 : -1, -columns : columns + 1]
    x, y = x * SCREEN.pitch[0], y * SCREEN.pitch[1]
    assert spot.sum() == pytest.approx(1)
    found = [[(spot * a * b).sum() for a in (x, y)] for b in (x, y)]
    np.testing.assert_allclose(found, np.cov(moved.T), atol=0.02 * np.trace(np.cov(moved.T)))
    reach = blur.reach(SCREEN) * np.array(SCREEN.pitch)
    assert (abs(moved) > reach + np.array(SCREEN.pitch)).any(axis=1).mean() < 0.02


@pytest.mark.parametrize(("degrees", "refused"), [(1.0, False), (60.0, True)])
def test_a_spot_over_too_many_pixels_is_refused_in_a_sentence(degrees, refused):
    """The spot of 60 degrees reaches 174 mm, the target has 32 mm on 1024 pixels."""
    blur, screen = Blur(Divergence("uniform", degrees), (0.0, 0.0), SHIFTS), SCREEN.finer(16)
    if refused:
        with pytest.raises(UserError, match="the target has 1024: too many to compute; use less of them"):
            blur.onto(screen)
    else:
        assert blur.widened(screen) == screen.widened(blur.reach(screen))


def test_large_pictures_with_a_narrow_spot_are_not_refused():
    blur, screen = Blur(Divergence("uniform", 0.4), (0.0, 0.0), SHIFTS), SCREEN.finer(64)
    assert blur.widened(screen).pixels[0] > 4096


@pytest.mark.parametrize("blur", [*blurs()])
def test_the_blur_is_its_own_adjoint_and_keeps_the_flux(blur):
    rng = np.random.default_rng(3)
    reach = blur.reach(SCREEN)
    image, other = np.pad(rng.uniform(0, 1, (40, 64)), reach), np.pad(rng.uniform(0, 1, (40, 64)), reach)
    there, back = blur.convolution(SCREEN, image.shape)(image), blur.convolution(SCREEN, other.shape)(other)
    assert (there * other).sum() == pytest.approx((image * back).sum(), rel=1e-12)
    assert there.sum() == pytest.approx(image.sum(), rel=0.01)


def test_samples_that_are_the_blur_leave_nothing(tmp_path):
    """k - k_N falls as the samples fill the spot: 20 000 random rays against none but the middle one."""
    blur = Blur(Divergence("uniform", 0.4), (0.0, 0.0), SHIFTS)
    image = np.pad(np.random.default_rng(4).uniform(0, 1, (40, 64)), blur.reach(SCREEN))
    moved = landings(blur, np.random.default_rng(5))[:20_000]
    blurred = blur.convolution(SCREEN, image.shape)(image)
    samples = moved, np.zeros((1, 2))
    filled, middle = (np.linalg.norm(blurred - blur.sampled(image, SCREEN, d)) for d in samples)
    assert filled < 0.03 * middle


def test_a_disk_is_as_wide_as_its_angles():
    blur = Blur(Divergence("uniform", 0.4), (0.0, 0.0), LandingShifts(*[200.0 * np.eye(2)] * 3, 0.0))
    assert blur.width == pytest.approx(2 * 200 * np.sin(np.radians(0.4)))
    rough = Blur(None, (0.003, 0.004), LandingShifts(*[200.0 * np.eye(2)] * 3, 0.0))
    assert rough.width == pytest.approx(2.355 * 200 * 0.005, rel=1e-3)
