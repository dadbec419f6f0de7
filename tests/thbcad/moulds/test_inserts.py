"""Inserts of a mould: their backs lie beyond what is left of the surface, and no farther."""

import pytest

from thbcad.lens import FreeformSurface, Lens
from thbcad.moulds import Insert
from thbcad.outlines import Outline, Polygon
from thbcad.sags import Conic

ROUND = (10.0, 10.0)
BOWL = Lens(
    FreeformSurface(ROUND, Conic(-30.0, -1.0), None, ROUND), FreeformSurface(ROUND, corners=ROUND), 5.0, 1.5
)


@pytest.mark.parametrize(
    ("shape", "reach"),
    [
        (None, 10.0),
        (Outline((3.0, 3.0), (3.0, 3.0)), 3.0),
        (Polygon(((-3.0, -3.0), (3.0, -3.0), (0.0, 3.0))), 10.0),  # a bound, of the whole disk
    ],
    ids=["disk", "aperture", "polygon"],
)
def test_the_back_is_as_far_from_the_rim_as_the_lens_is_thick(shape, reach):
    """The paraboloid reaches -r^2 / 60 on a disk; the corners of its square, no lens, twice as far."""
    rim = -(reach**2) / 60
    assert Insert.of(BOWL, "front", None, shape).back == pytest.approx(rim - 5.0, abs=1e-6)
    assert Insert.of(BOWL, "front", rim - 0.01, shape).back == rim - 0.01
    with pytest.raises(ValueError, match="must lie below z = "):
        Insert.of(BOWL, "front", rim + 0.01, shape)
