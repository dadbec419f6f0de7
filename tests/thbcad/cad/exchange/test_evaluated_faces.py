"""Nodes of faces: OCCT's points and normals are those of the splines."""

import numpy as np
import pytest

from tests.thbcad.cases import LENSES
from thbcad.cad.exchange import face_nodes
from thbcad.cad.shapes import lens_solid
from thbcad.lens import optical_forms
from thbcad.sags import PlacedConic


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
@pytest.mark.parametrize(("number", "outward"), [(0, -1), (1, 1)], ids=["front", "rear"])
def test_nodes_lie_on_the_surface_with_outward_normals(lens, number, outward):
    surface = optical_forms(lens)[number]
    if isinstance(surface, PlacedConic):
        x, y = np.meshgrid(*(np.linspace(-h, h, 7) for h in surface.half_width), indexing="ij")
        points = np.stack([x, y, surface(x, y) + 0 * x], axis=-1)
        u, v = surface.parameters(points.reshape(-1, 3)).T.reshape(2, *x.shape)
        one, zero = np.ones_like(x), np.zeros_like(x)
        by_x, by_y = (surface.conic(x, y, d) + zero for d in ((1, 0), (0, 1)))
        along = [np.stack(rows, axis=-1) for rows in ((one, zero, by_x), (zero, one, by_y))]
    else:
        u, v = (np.linspace(kv.start, kv.stop, n) for kv, n in ((surface.kv_u, 7), (surface.kv_v, 5)))
        points = surface.grid(u, v)
        along = [surface.grid(u, v, d) for d in ((1, 0), (0, 1))]
    nodes = face_nodes(lens_solid(lens), number, u, v)
    np.testing.assert_allclose(nodes.points, points, rtol=0, atol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(nodes.normals, axis=-1), 1, rtol=0, atol=1e-14)
    for tangent in along:
        np.testing.assert_allclose((nodes.normals * tangent).sum(axis=-1), 0, rtol=0, atol=1e-13)
    assert (np.sign(nodes.normals[..., 2]) == outward).all()
