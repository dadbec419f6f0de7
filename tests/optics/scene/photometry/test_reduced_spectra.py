"""Spectra as few lines."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.scene.photometry import ILLUMINANTS, spectral_lines, white_of
from optics.scene.photometry.cie_tables import chromaticity, colour_matching, illuminant
from optics.scene.photometry.reduced_spectra import MOST_LINES

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
