"""Rims of faces in the text of a STEP file, against the outline that the lens was made of."""

import numpy as np
import pytest

from optics.exchange.verification.independent_checks import text_checks
from optics.exchange.verification.traced_faces import FaceRim
from tests.optics.cases import failing
from thbcad.cad.exchange import step_bytes
from thbcad.io import brep_of_text
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic


@pytest.mark.every(2)
@pytest.mark.parametrize("front", [(10.0, 8.0), (7.0, 8.0)])
@pytest.mark.parametrize("share", [(1.0, 1.0), (0.3, 0.5), (0.0, 0.0)])
def test_points_within_a_rim_are_those_within_the_outline(front, share):
    lens = Lens(
        FreeformSurface(front, Conic(90.0), corners=np.multiply(front, share)),
        FreeformSurface((10.0, 8.0), corners=np.multiply((10.0, 8.0), share)),
        6.0,
        1.5,
    )
    solid = brep_of_text(step_bytes(lens).decode())
    assert failing(text_checks(solid, lens)) == []
    rng = np.random.default_rng(0)
    for face, surface in zip(solid.faces, (lens.front, lens.rear)):
        outline = surface.outline
        x, y = rng.uniform(-1.1, 1.1, (2, 2000)) * np.array(surface.half_width)[:, None]
        k = outline.gauge(x, y)
        rim = FaceRim(solid, face)
        assert (rim.holds(np.column_stack([x, y])) == (k <= 1)).all()
        # 1e-8 mm, ten times what rims are fitted to, on both sides
        for side in (-1, 1):
            near = (1 + side * 1e-8) / k
            assert (rim.holds(np.column_stack([near * x, near * y])) == (side < 0)).all()
