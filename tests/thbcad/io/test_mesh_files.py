"""Meshes of any numbers read back by trimesh, which shares no code with their writers."""

import io

import numpy as np
import pytest
import trimesh
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from thbcad.io import obj_bytes, ply_bytes, stl_bytes
from thbcad.lens import Tessellation

NUMBERS = st.floats(-1e6, 1e6, allow_nan=False, allow_subnormal=False)


def read(data, kind):
    return trimesh.load(io.BytesIO(data), file_type=kind, process=False, maintain_order=True)


@st.composite
def meshes(draw, width=64):
    count = draw(st.integers(3, 12))
    numbers = NUMBERS if width == 64 else st.floats(-1e6, 1e6, width=32, allow_subnormal=False)
    vertices = draw(arrays(np.float64, (count, 3), elements=numbers))
    triangles = draw(arrays(np.int64, (draw(st.integers(1, 9)), 3), elements=st.integers(0, count - 1)))
    return Tessellation(vertices, triangles, np.zeros(len(triangles), dtype=np.int64), 1e-3)


@pytest.mark.parametrize(("write", "kind"), [(obj_bytes, "obj"), (ply_bytes, "ply")])
@given(mesh=meshes())
def test_every_bit_of_a_vertex_and_every_triangle_come_back(write, kind, mesh):
    found = read(write(mesh), kind)
    np.testing.assert_array_equal(found.faces, mesh.triangles)
    used = np.unique(mesh.triangles)
    np.testing.assert_array_equal(found.vertices[used], mesh.vertices[used])


@pytest.mark.filterwarnings("ignore:invalid value")  # facets without area have no normal
@given(mesh=meshes(width=32))
def test_the_corners_of_every_facet_come_back_from_an_stl_file(mesh):
    found = read(stl_bytes(mesh), "stl")
    np.testing.assert_array_equal(found.vertices[found.faces], mesh.vertices[mesh.triangles])


def test_numbers_beyond_float32_are_refused():
    mesh = Tessellation(np.eye(3) * 0.1, np.array([[0, 1, 2]]), np.zeros(1, dtype=np.int64), 1e-3)
    with pytest.raises(ValueError, match="STL holds float32"):
        stl_bytes(mesh)
