"""What diffraction does to a picture: the estimate against waves along rows, and where it is worth a line."""

import numpy as np
import pytest

import optics
from optics.designing.prediction.diffracted_light import LEAST, diffraction, diffraction_of, in_waves
from optics.light.analysis import rel_l2
from oracles.wave_light import row_in_waves
from tests.optics.cases import WIDE, example_system, small_system

LINES = [0.15, 0.29, 0.43, 0.57, 0.71, 0.85]  # of a picture's height and width, that are compared
GREY = 0.005  # of the brightest pixel: rows need some light everywhere


def errors_of_rows(name):
    """Return rel_l2 of rows and columns of a published case: in waves, and by the estimate."""
    system = example_system(name)
    problem, screen = system.problem, system.target.screen()
    picture, pixel = system.target.irradiance(screen, 1.0), screen.pitch[0]
    half, lens, distance = screen.half_width[0], problem.source.half_width[0], problem.target.distance
    wave = problem.source.wavelength * 1e-6
    square = wave * distance * half / lens / pixel**2  # of the Fresnel length, in pixels
    found = []
    places = (np.array(LINES) * len(picture)).astype(int)
    for row in np.concatenate([picture[places], picture[:, places].T]):
        row = np.maximum(row, GREY * picture.max())
        waves = row_in_waves(row, half, lens, distance, wave)
        found.append((rel_l2(waves[None], row[None]), rel_l2(in_waves(row[None], square, 0.0), row[None])))
    return np.transpose(found)


@pytest.mark.parametrize(
    ("name", "in_all", "single"),
    [
        ("pearl", 1.2, 1.5),
        ("others/hobby", 1.2, 1.5),
        ("others/pearl_near", 1.2, 1.5),
        ("others/text_near", 1.3, 3.0),  # of a row that meets one letter
    ],
)
def test_rows_of_pictures_are_as_far_off_as_their_waves(name, in_all, single):
    """Within 1.5 times, and within 1.2 times of all rows together."""
    waves, estimate = errors_of_rows(name)
    assert 1 / in_all < np.linalg.norm(estimate) / np.linalg.norm(waves) < in_all
    assert np.abs(np.log(estimate / waves)).max() < np.log(single)


@pytest.mark.parametrize("fresnel_number", [100, 1000])
def test_a_top_hat_ends_in_the_fringes_of_a_slit(fresnel_number):
    """W D / (lambda L) is the square of its width in Fresnel lengths."""
    row = np.ones(128)
    waves = row_in_waves(row, 1.0, 0.5, 50.0, 2.0 * 1.0 / (50.0 * fresnel_number))
    estimate = in_waves(row[None], 128**2 / fresnel_number, 0.0)
    expected = rel_l2(waves[None], row[None])
    assert rel_l2(estimate, row[None]) == pytest.approx(expected, rel=0.15)


def test_detail_of_little_contrast_keeps_sin_chi_over_chi_of_it():
    """chi = pi b^2 f^2; pixels of a cosine's mean values, in the middle of a wide picture."""
    x = np.arange(512)
    wave = 1 + 0.01 * np.cos(2 * np.pi * 32 * (x + 0.5) / 512)
    square = 100.0
    kept = in_waves(wave[None], square, 0.0)[0][192:320]
    contrast = np.ptp(kept - in_waves(np.ones((1, 512)), square, 0.0)[0][192:320]) / 0.02
    assert contrast == pytest.approx(abs(np.sinc(square * (32 / 512) ** 2)), rel=0.05)


def test_light_that_is_not_diffracted_stays():
    picture = np.random.default_rng(0).random((20, 30))
    assert rel_l2(in_waves(picture, 1e-4, 1e-4), picture) < 1e-3


def far_screen(folder, half_width=500.0, **more):
    """Return a small lens with a top hat 10 km away.  more : keys."""
    place = {"target.distance": 1e7, "target.half_width": [half_width, half_width]}
    return small_system(folder, WIDE | place | {"target.pixels": [48, 48]} | more)


def found_of(system, backend):
    return diffraction_of(system, backend)


def test_a_top_hat_ten_kilometres_away_is_blurred_by_lambda_l_over_d(tmp_path, backend):
    system = far_screen(tmp_path)
    found = found_of(system, backend)
    width = 2 * system.problem.source.half_width[0]
    assert found.blur == pytest.approx(550e-6 * 1e7 / width, rel=1e-4)
    assert found.lens == pytest.approx(width)
    assert found.metrics("mm")["diffraction_blur_mm"] == found.blur
    assert (
        "of 550 nm that passes 19 mm of the lens is blurred by at least 290 mm (14 pixels)"
        in found.sentence("mm")
    )


def test_in_the_far_field_it_is_an_angle(tmp_path, backend):
    """lambda / D, in degrees."""
    far = {"target.distance": np.inf, "target.half_width": [0.5, 0.5], "target.pixels": [256, 256]}
    system = small_system(tmp_path, WIDE | far)
    found = found_of(system, backend)
    width = 2 * system.problem.source.half_width[0]
    assert found.blur == pytest.approx(np.degrees(550e-6 / width), rel=1e-4)
    assert "degrees" in found.sentence(system.target.unit)


def test_white_light_counts_by_its_mean_wavelength(tmp_path, backend):
    lines = [[450.0, 1.0], [650.0, 3.0]]
    material = {"lens.material": "N-BK7", "lens.index": 1.5168, "source.spectrum": lines}
    found = found_of(far_screen(tmp_path, **material), backend)
    assert found.wavelength == pytest.approx(600.0)


def test_a_blur_wider_than_the_lit_part_leaves_no_rel_l2(tmp_path, backend):
    found = found_of(far_screen(tmp_path, half_width=100.0), backend)
    assert found.rel_l2 is None
    assert "rel_l2" not in found.sentence("mm")


def test_nothing_is_said_where_pixels_are_coarse_or_the_source_blurs_more(tmp_path, backend):
    coarse = small_system(tmp_path, WIDE | {"target.pixels": [16, 16]})
    assert found_of(coarse, backend) is None
    assert found_of(far_screen(tmp_path), backend) is not None
    assert found_of(far_screen(tmp_path, **{"source.divergence_profile": "sun"}), backend) is None
    assert found_of(example_system("extended", {"target.pixels": [64, 64]}), backend) is None


def test_zones_have_a_blur_and_no_rel_l2(backend):
    system = example_system("headlamp")
    halves = {name: (1e-3, 1e-3) for name in system.problem.face_names}  # mm: so small a lens
    found = diffraction(system, halves, lambda: 0.0)
    assert found.rel_l2 is None
    assert found.blur == pytest.approx(np.degrees(system.problem.source.wavelength * 1e-6 / 2e-3), rel=1e-6)


def test_the_lens_of_4_mm_reads_worse_in_waves_than_by_rays():
    """rays print 0.030 of `examples/others/pearl_near.toml`, waves allow more than twice as much."""
    system = example_system("others/pearl_near")
    found = diffraction(system, {name: (2.0, 2.0) for name in system.problem.face_names}, lambda: 0.0)
    assert found.blur == pytest.approx(550e-6 * 6.0 / 4.0, rel=1e-6)
    assert 0.06 < found.rel_l2 < 0.09


def test_designs_have_it_in_metrics_and_notes(tmp_path):
    system = far_screen(tmp_path)
    design = optics.Design.of_lens(system.problem, system.base)
    assert design.metrics["diffraction_blur_mm"] > 0
    assert design.metrics["rel_l2_diffraction"] > LEAST
    assert any("geometrical optics" in sentence for sentence in design.notes)
