"""The tables of the CIE against those of the package colour-science."""

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.scene.photometry import ILLUMINANTS, spectral_lines, white_of
from optics.scene.photometry.cie_tables import colour_matching, illuminant
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
