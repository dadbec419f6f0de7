"""Colours in sRGB, against colour-science."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.scene.photometry import ILLUMINANTS, chromaticity_distance, spectral_lines, srgb, white_of
from optics.scene.photometry.cie_tables import chromaticity, colour_matching
from tests.optics.scene.photometry.colour_cases import colour

D65 = np.array([0.3127 / 0.3290, 1.0, (1 - 0.3127 - 0.3290) / 0.3290])
Y_OF_RGB = colour.RGB_COLOURSPACES["sRGB"].matrix_RGB_to_XYZ


@pytest.mark.parametrize("name", ILLUMINANTS)
def test_the_white_of_a_source_is_the_white_of_the_screen(name):
    white = white_of(spectral_lines(name))
    assert srgb(white, white) == pytest.approx([1, 1, 1], abs=1e-12)


def test_d65_is_white():
    assert srgb(D65, D65) == pytest.approx([1, 1, 1], abs=1e-12)


@given(st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3))
def test_colours_of_the_screen_are_those_of_colour_science(rgb):
    """Its matrices have four digits behind the point, as IEC 61966-2-1 prints them; the encoding is steepest,
    12.92, in the dark."""
    xyz = Y_OF_RGB @ np.array(rgb)
    wanted = colour.XYZ_to_sRGB(xyz, illuminant=[0.3127, 0.3290])
    assert srgb(xyz, D65) == pytest.approx(np.clip(wanted, 0, 1), abs=3e-3)


def test_colours_adapt_as_colour_science_adapts_them():
    white = white_of(spectral_lines("A"))
    xyz = np.array([0.5, 0.4, 0.1]) * white[1]
    adapted = colour.adaptation.chromatic_adaptation_VonKries(
        xyz / white[1], white / white[1], D65, "Bradford"
    )
    assert srgb(xyz, white) == pytest.approx(srgb(adapted, D65), abs=1e-9)


def test_a_colour_out_of_gamut_keeps_its_luminance():
    """A laser of 520 nm: no channel is negative, and Y is that asked for."""
    xyz = 0.2 * colour_matching(520.0)[:, 0]
    shown = srgb(xyz, D65)
    linear = np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)
    assert shown.min() == pytest.approx(0, abs=1e-9)
    assert (np.array([0.2126, 0.7152, 0.0722]) * linear).sum() == pytest.approx(xyz[1], rel=1e-3)


def test_a_picture_is_pixel_by_pixel():
    rng = np.random.default_rng(1)
    picture = rng.uniform(0, 1, (3, 4, 5))
    shown = srgb(picture, D65)
    assert shown.shape == (3, 4, 5)
    assert shown[:, 2, 3] == pytest.approx(srgb(picture[:, 2, 3], D65), abs=1e-15)
    assert ((shown >= 0) & (shown <= 1)).all()


def test_black_is_black_and_has_no_chromaticity():
    assert not srgb(np.zeros(3), D65).any()
    assert np.isnan(chromaticity(np.zeros(3))).all()


def test_chromaticities_are_those_of_the_cie():
    assert chromaticity(D65) == pytest.approx([0.1978, 0.4683], abs=5e-5)  # CIE 15
    assert chromaticity_distance(7 * D65, D65) == pytest.approx(0, abs=1e-15)
