"""The check of a solid's volume by the text of its STEP file, which needs no OCCT."""

from __future__ import annotations

from math import inf

from optics.base.runtime import Check
from thbcad.io import Brep, volume
from thbcad.lens import Lens

VOLUME = 1e-10  # relative


def text_volume_check(solid: Brep, lens: Lens) -> Check:
    """Return the Check of the volume by quadrature over the text against the lens in memory."""
    return volume_check(solid, lens.volume(), VOLUME)


def volume_check(solid: Brep, wanted: float, limit: float) -> Check:
    """Return the Check of the volume by quadrature over the text against a wanted one, mm^3.

    limit : of the relative difference
    """
    try:
        off = abs(volume(solid) / wanted - 1)
    except ValueError:  # faces that do not close
        off = inf
    name = "volume by quadrature over the text of the file against the closed form, relative"
    return Check(name, off, limit, "")
