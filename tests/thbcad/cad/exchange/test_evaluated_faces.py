"""Nodes of faces: OCCT's points and normals are those of the splines."""

from __future__ import annotations

import numpy as np
import pytest

from tests.thbcad.cases import LENSES
from thbcad.cad.exchange import face_nodes
from thbcad.cad.shapes import lens_solid
from thbcad.lens import placed_surfaces


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
@pytest.mark.parametrize(("number", "outward"), [(0, -1), (1, 1)], ids=["front", "rear"])
def test_nodes_lie_on_the_spline_with_outward_normals(lens, number, outward):
    surface = placed_surfaces(lens)[number]
    u, v = (np.linspace(kv.start, kv.stop, n) for kv, n in ((surface.kv_u, 7), (surface.kv_v, 5)))
    nodes = face_nodes(lens_solid(lens), number, u, v)
    np.testing.assert_allclose(nodes.points, surface.grid(u, v), rtol=0, atol=1e-13)
    along = [surface.grid(u, v, d) for d in ((1, 0), (0, 1))]
    np.testing.assert_allclose(np.linalg.norm(nodes.normals, axis=-1), 1, rtol=0, atol=1e-14)
    for tangent in along:
        np.testing.assert_allclose((nodes.normals * tangent).sum(axis=-1), 0, rtol=0, atol=1e-13)
    assert (np.sign(nodes.normals[..., 2]) == outward).all()
