"""Spectra, the tables of the CIE and colours in sRGB, against colour-science."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.base.runtime import UserError
from optics.scene.photometry import ILLUMINANTS, chromaticity_distance, spectral_lines, srgb, white_of
from optics.scene.photometry.cie_tables import chromaticity, colour_matching, illuminant
from optics.scene.photometry.reduced_spectra import MOST_LINES
from tests.optics.scene.photometry.colour_cases import colour

OBSERVER = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
FIVE = np.arange(380.0, 781.0, 5.0)


def test_the_observer_is_that_of_the_cie():
    """The table at 5 nm has a digit fewer than the one at 1 nm."""
    wanted = np.array([OBSERVER[nm] for nm in FIVE]).T
    assert colour_matching(FIVE) == pytest.approx(wanted, abs=1.1e-7)


def test_splines_between_the_rows_are_near_the_table_at_1_nm():
    """Their error is that of cubic interpolation at 5 nm; it is greatest where z is steepest, near 417 nm."""
    nm = np.arange(380.0, 781.0)
    wanted = np.array([OBSERVER[w] for w in nm]).T
    off = np.abs(colour_matching(nm) - wanted).max(axis=1)
    assert (off < [3e-4, 2e-4, 1.1e-3]).all()


def test_beyond_the_table_nothing_is_seen():
    assert not colour_matching([200.0, 379.0, 781.0, 1e6]).any()


@pytest.mark.parametrize("name", ILLUMINANTS)
def test_illuminants_are_those_of_the_cie(name):
    nm, power = illuminant(name)
    assert (nm == FIVE).all()
    assert power == pytest.approx([colour.SDS_ILLUMINANTS[name][w] for w in FIVE], rel=1e-5)


@pytest.mark.parametrize("name", ILLUMINANTS)
def test_lines_keep_the_white_of_an_illuminant(name):
    """The difference is that of summing at 1 nm and at 5 nm."""
    white = white_of(spectral_lines(name))
    with colour.utilities.suppress_warnings(colour_runtime_warnings=True):  # of another step
        wanted = colour.sd_to_XYZ(colour.SDS_ILLUMINANTS[name], OBSERVER)
    assert white[:2] / white.sum() == pytest.approx(wanted[:2] / wanted.sum(), abs=3e-4)


def test_another_name_is_refused():
    with pytest.raises(UserError, match="an illuminant must be one of A, D65, LED-B1"):
        illuminant("F2")


CURVES = st.lists(st.floats(0, 1), min_size=MOST_LINES + 1, max_size=60).filter(lambda s: sum(s) > 0.01)


def test_few_rows_are_lines_themselves():
    lines = spectral_lines([(650.0, 3.0), (450.0, 1.0), (500.0, 0.0)])
    assert [(line.nm, line.weight) for line in lines] == [(450.0, 0.25), (650.0, 0.75)]
    assert lines[0].xyz == pytest.approx(colour_matching(450.0)[:, 0], rel=1e-15)


@given(CURVES)
def test_lines_keep_flux_colour_and_mean_dispersion(power):
    """The sums over lines are those over a fine grid, whatever the curve."""
    nm = np.linspace(400.0, 700.0, len(power))
    lines = spectral_lines(list(zip(nm, power)))
    fine = np.union1d(nm, np.arange(400.0, 700.0))
    widths = np.diff(fine)
    flux = np.interp(fine, nm, power) * (np.append(widths, 0) + np.append(0, widths)) / 2
    flux = flux / flux.sum()
    assert len(lines) <= MOST_LINES
    assert sum(line.weight for line in lines) == pytest.approx(1, rel=1e-12)
    assert white_of(lines) == pytest.approx((flux * colour_matching(fine)).sum(axis=1), rel=1e-9, abs=1e-15)
    mean = sum(line.weight * line.nm**-2.0 for line in lines)
    assert mean == pytest.approx((flux * fine**-2.0).sum(), rel=1e-12)


@pytest.mark.parametrize("name", ILLUMINANTS)
def test_ten_lines_leave_little_of_the_dispersion(name):
    """With u = 1 / nm^2 the spread of the index within strata is below 14 % of that of the whole source."""
    rows = illuminant(name)
    nm = np.arange(380.0, 781.0)
    power = np.interp(nm, *rows)
    flux = power / power.sum()
    whole = (flux * nm**-4.0).sum() - (flux * nm**-2.0).sum() ** 2
    lines = spectral_lines(name)
    kept = sum(x.weight * x.nm**-4.0 for x in lines) - sum(x.weight * x.nm**-2.0 for x in lines) ** 2
    assert len(lines) == MOST_LINES
    assert 0 <= 1 - kept / whole < 0.14**2


def test_a_stratum_stands_where_its_flux_is():
    """Two narrow bands stay two groups of lines, with next to nothing between them."""
    nm = np.arange(400.0, 701.0)
    power = np.exp(-(((nm - 450) / 5) ** 2)) + np.exp(-(((nm - 650) / 5) ** 2))
    far = [
        x.weight for x in spectral_lines(list(zip(nm, power))) if min(abs(x.nm - 450), abs(x.nm - 650)) > 15
    ]
    assert sum(far) < 0.05


def strip(lines, apart):
    """Return what pixels of width 1 hold of a strip from -20 to 20 in light of these lines, XYZ, (3, n).

    The strip moves with 1 / nm^2, by `apart` between 450 and 650 nm, as behind a prism of Cauchy's law.
    """
    edges = np.arange(-30.0, 30.5)
    moved = [apart * (x.nm**-2 - 550**-2) / (450**-2 - 650**-2) for x in lines]
    held = [np.diff(np.clip(edges, m - 20, m + 20)) for m in moved]
    return sum(np.multiply.outer(x.weight * np.array(x.xyz), h) for x, h in zip(lines, held))


@pytest.mark.parametrize("name", ILLUMINANTS)
@pytest.mark.parametrize(("apart", "most"), [(1.0, 0.0025), (4.0, 0.007)])
def test_ten_lines_stand_for_a_whole_spectrum(name, apart, most):
    """Edges that colours take one and four pixels apart, against eight times as many lines: luminance in the
    L2 norm, and how far off the chromaticity of a pixel is, weighted by luminance."""
    few, every = (strip(spectral_lines(name, count), apart) for count in (MOST_LINES, 8 * MOST_LINES))
    assert np.linalg.norm(few[1] - every[1]) < most * np.linalg.norm(every[1])
    lit = (every[1] > 1e-6) & (few[1] > 1e-6)
    off = chromaticity_distance_of(few[:, lit], every[:, lit])
    assert np.average(off, weights=every[1][lit]) < most


def chromaticity_distance_of(some, others):
    """Return how far colours are apart in (u', v'), one by one."""
    return np.hypot(*(chromaticity(some) - chromaticity(others)))


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
