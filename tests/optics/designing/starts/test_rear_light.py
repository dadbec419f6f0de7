"""Cells of the light on a surface."""

import pytest

from optics.designing.starts.rear_light import as_many_within, inside
from thbcad.outlines import Outline


@pytest.mark.parametrize("cells", [192, 512, 1024])
@pytest.mark.parametrize("corners", [(0.0, 0.0), (3.0, 2.0), (8.0, 5.0)])
def test_a_map_has_as_many_cells_within_an_outline_as_within_a_rectangle(cells, corners):
    """To the multiple of 32 that is next: 1 + 16 / cells each way, and 1 % for those that the rim cuts."""
    outline = Outline((8.0, 5.0), corners)
    count = as_many_within(outline, cells)
    held = inside([outline], outline.half_width, (count, count)).sum()
    assert held == pytest.approx(cells**2, rel=32 / cells + 0.01)
    assert count == cells or corners != (0.0, 0.0)
