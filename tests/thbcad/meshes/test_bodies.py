"""Meshes of apertures, polygons and flanges: closed, within their chord of the exact lens, by trimesh and by
OCCT's volume."""

import io
import json

import numpy as np
import pytest
import trimesh
from hypothesis import given, strategies as st
from scipy.spatial import cKDTree

from tests.cases import examples
from tests.thbcad.drawings.cases import BALL, PLAIN, WAVY, WIDER, outlined
from thbcad import body_mesh, to_trimesh
from thbcad.cad.shapes import flanged_part, lens_part, trimmed_part
from thbcad.fitting import quasi_interpolate
from thbcad.hierarchy import THBSpace
from thbcad.io import obj_bytes, ply_bytes, stl_bytes
from thbcad.lens import (
    Flange,
    FreeformSurface,
    Lens,
    Tessellation,
    aperture_volume,
    flanged_volume,
    polygon_volume,
    ruled_edges,
    tessellated,
)
from thbcad.meshes import glb_bytes
from thbcad.meshes.polygon_bodies import ears
from thbcad.outlines import Polygon
from thbcad.sags import Conic
from thbcad.splines import KnotVector

FLANGE = Flange(2.0, 0.3, 1.0)
APERTURE = (4.5, 3.5)
CHORD = 5e-3
BODIES = {
    "aperture": (WAVY, APERTURE, None),
    "circle of two sizes": (WIDER, (4.0, 4.0), None),
    "flange": (WAVY, None, FLANGE),
    "both": (PLAIN, APERTURE, FLANGE),
    "both, of conics": (BALL, (3.5, 3.9), Flange(1.0, 1.5, 2.5)),
}

TURN = np.linspace(0, 2 * np.pi, 60, endpoint=False)
POLYGONS = {
    "triangle, clockwise": [(-3, -3), (0, 3), (3, -3)],
    "L": [(-4, -3), (4, -3), (4, 0), (0, 0), (0, 3), (-4, 3)],
    "star": np.c_[np.cos(TURN), np.sin(TURN)] * (2.5 + 1.4 * np.cos(15 * TURN)[:, None]),
    "corners on sides": [(-4, -3), (0, -3), (1, -3), (4, -3), (4, 3), (2, 3), (-4, 3)],
    "whole": [(-5, -4), (5, -4), (5, 4), (-5, 4)],
}


def heights(lens, points, face):
    surface, vertex = ((lens.front, 0.0), (lens.rear, lens.thickness))[face]
    return points[:, 2] - vertex - surface(*points[:, :2].T)


def samples(mesh, face, count=2000):
    """Random points of the triangles of a face."""
    rng = np.random.default_rng(0)
    corners = mesh.vertices[mesh.triangles[mesh.faces == face]]
    weights = rng.dirichlet(np.ones(3), count)
    return np.einsum("kc,kcd->kd", weights, corners[rng.integers(len(corners), size=count)])


def assert_a_mesh_of(lens, mesh, volume, chord=CHORD):
    """One closed body of this volume, front and rear within the chord error that the mesh states."""
    made = to_trimesh(mesh)
    assert mesh.chord <= chord
    assert (made.is_watertight, made.is_winding_consistent) == (True, True)
    assert (made.body_count, made.euler_number) == (1, 2)
    assert abs(made.volume - volume) <= mesh.chord * made.area
    for face in (0, 1):
        assert np.abs(heights(lens, samples(mesh, face), face)).max() <= mesh.chord


@pytest.mark.parametrize(("lens", "aperture", "flange"), BODIES.values(), ids=BODIES)
@pytest.mark.parametrize("single", [False, True])
def test_a_body_is_closed_and_within_its_chord(lens, aperture, flange, single):
    mesh = body_mesh(lens, CHORD, aperture, flange, single)
    volume = flanged_volume(lens, flange, aperture) if flange else aperture_volume(lens, aperture)
    assert_a_mesh_of(lens, mesh, volume)
    assert (mesh.vertices == mesh.vertices.astype(np.float32)).all() or not single
    assert mesh.faces.max() == len(mesh.names) - 1


@pytest.mark.parametrize("lens", [WAVY, PLAIN, BALL])
def test_a_lens_within_an_ellipse_has_the_mesh_of_that_aperture(lens):
    lens = outlined(lens, (0, 0))
    half = lens.rear.half_width
    assert body_mesh(outlined(lens, (1, 1)), CHORD) == body_mesh(lens, CHORD, half)


@pytest.mark.every(3)
@pytest.mark.parametrize("share", [(1, 1), (0.3, 0.5), (1, 0.5)])
@pytest.mark.parametrize("scale", [(1.0, 1.0), (0.8, 0.6)])
def test_a_lens_within_an_outline_is_closed_and_within_its_chord(share, scale):
    lens, chord = outlined(WAVY, share, scale), 4 * CHORD
    mesh = body_mesh(lens, chord)
    assert_a_mesh_of(lens, mesh, lens.volume(), chord)
    places, normals = zip(*map(points_and_normals, ruled_edges(lens)))
    walls = np.concatenate([samples(mesh, face) for face in range(2, 6)])
    # the nearest of points about 0.05 mm apart, on edges whose curvature is at most 2 / mm
    at = cKDTree(np.concatenate(places)).query(walls)[1]
    off = ((walls - np.concatenate(places)[at]) * np.concatenate(normals)[at]).sum(axis=1)
    assert np.abs(off).max() <= mesh.chord + 0.05**2


def points_and_normals(edge):
    u, v = np.linspace(edge.kv_u.start, edge.kv_u.stop, 201), np.linspace(0, 1, 81)
    points, along, across = (edge.grid(u, v, orders).reshape(-1, 3) for orders in ((0, 0), (1, 0), (0, 1)))
    normals = np.cross(along, across)
    return points, normals / np.linalg.norm(normals, axis=1)[:, None]


@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_what_a_surface_does_outside_its_outline_costs_no_triangles(scale):
    """A peak in the corner of the square, which the rectangular lens has; a right triangle needs as many for
    its curvature in a disk as in the square."""
    kv = KnotVector.uniform(3, 20)
    peak = quasi_interpolate(THBSpace(kv, kv), lambda u, v: 2 * np.exp(-500 * ((u - 0.02) ** 2 + v**2)))
    counts = []
    for share in (0.0, 1.0):
        half, small = (20.0, 20.0), (20.0 * scale, 20.0 * scale)
        front = FreeformSurface(small, corners=(share * small[0], share * small[1]))
        rear = FreeformSurface(half, Conic(-60.0, -1.0), peak, (20.0 * share, 20.0 * share))
        mesh = body_mesh(Lens(front, rear, 14.0, 1.5), CHORD)
        assert mesh.chord <= CHORD
        counts.append(len(mesh.triangles))
    assert counts[1] <= 1.2 * counts[0]


def test_a_flange_has_its_planes_and_its_outline():
    mesh = body_mesh(PLAIN, CHORD, APERTURE, FLANGE)
    by_name = {name: samples(mesh, k) for k, name in enumerate(mesh.names)}
    for name, points in by_name.items():
        if name.startswith("flange front"):
            assert np.abs(points[:, 2] - FLANGE.low).max() < 1e-14
        if name.startswith("flange side"):
            radius = np.hypot(points[:, 0] / 6.5, points[:, 1] / 5.5)
            assert (radius >= 1 - CHORD / 5.5).all()
            assert (radius <= 1 + 1e-12).all()
        if name.startswith("edge"):
            assert (np.hypot(points[:, 0] / 4.5, points[:, 1] / 3.5) >= 1 - CHORD / 3.5).all()


@pytest.mark.slow
@examples(20)
@given(st.floats(0.3, 5.0), st.floats(0.3, 4.0), st.floats(1e-3, 0.1))
def test_any_ellipse_keeps_any_chord(a, b, chord):
    mesh = body_mesh(WAVY, chord, (a, b))
    assert mesh.chord <= chord
    assert max(np.abs(heights(WAVY, samples(mesh, face), face)).max() for face in (0, 1)) <= mesh.chord
    assert to_trimesh(mesh).is_watertight


@pytest.mark.every(4)
@pytest.mark.parametrize(  # every polygon of every lens, in one of both precisions often
    ("corners", "lens", "single"),
    [
        pytest.param(corners, lens, single, marks=() if single == (k + n) % 2 else pytest.mark.slow)
        for k, corners in enumerate(POLYGONS.values())
        for n, lens in enumerate((WAVY, PLAIN, WIDER, BALL))
        for single in (False, True)
    ],
)
def test_a_lens_cut_to_a_polygon_is_closed_and_within_its_chord(corners, lens, single):
    mesh = body_mesh(lens, CHORD, single=single, polygon=corners)
    assert_a_mesh_of(lens, mesh, polygon_volume(lens, corners))
    sides = Polygon(tuple(map(tuple, np.array(corners).tolist()))).sides
    for k, (start, stop) in enumerate(sides):
        assert mesh.names[2 + k] == f"edge {k + 1}"
        points = samples(mesh, 2 + k)[:, :2]
        step, (x, y) = stop - start, (points - start).T
        along, across = step[0] * x + step[1] * y, step[0] * y - step[1] * x
        assert abs(across).max() <= 1e-5  # float32 at 5 mm, along sides of at most 10 mm
        assert -1e-5 <= along.min() <= along.max() <= step @ step + 1e-5
    assert (mesh.vertices == mesh.vertices.astype(np.float32)).all() or not single


@given(st.lists(st.tuples(st.integers(0, 2), st.floats(0.2, 1)), min_size=3, max_size=12))
def test_ears_fill_any_polygon(steps):
    """Star-shaped polygons with corners on straight lines."""
    corners = []
    for k, (between, radius) in enumerate(steps):
        t = 2 * np.pi * k / len(steps)
        corner = radius * np.array([np.cos(t), np.sin(t)])
        if corners:
            corners += [
                corners[-1] + (corner - corners[-1]) * j / (between + 1) for j in range(1, between + 1)
            ]
        corners.append(corner)
    polygon = Polygon(tuple(map(tuple, corners)))
    triangles = np.array(polygon.corners)[ears(polygon)]
    u, v = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    areas = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2
    assert len(triangles) == len(polygon.corners) - 2
    assert areas.min() > -1e-15  # rounding of corners on straight lines
    assert areas.sum() == pytest.approx(polygon.area, rel=1e-12)


def test_occt_agrees_with_a_body():
    """The vertices of OCCT's mesh lie on ours within both errors."""
    part = flanged_part(PLAIN, FLANGE, APERTURE)
    other = to_trimesh(part, 2e-2)
    ours = to_trimesh(body_mesh(PLAIN, CHORD, APERTURE, FLANGE))
    assert other.volume == pytest.approx(ours.volume, abs=2e-2 * ours.area)
    dense = cKDTree(trimesh.sample.sample_surface(ours, 200_000, seed=0)[0])
    assert dense.query(other.vertices)[0].max() < 0.15  # the spacing of the samples


def test_to_trimesh_has_units_names_and_colours():
    made = to_trimesh(WAVY, 1e-2)
    assert made.is_watertight
    assert made.units == "mm"
    assert made.metadata["names"][:2] == ("front", "rear")
    assert made.metadata["chord"] <= 1e-2
    front = made.visual.face_colors[made.metadata["faces"] == 0]
    assert (front == [184, 217, 242, 255]).all()
    assert len(np.unique(made.visual.face_colors, axis=0)) == 3


@pytest.mark.every(2)
@pytest.mark.parametrize("chord", [2e-2, 5e-3])
def test_a_part_is_meshed_by_occt_within_the_measured_chord(chord):
    part = trimmed_part(WAVY, APERTURE)
    made = to_trimesh(part, chord)
    faces = made.metadata["faces"]
    mesh = Tessellation(made.vertices, made.faces, faces, chord, made.metadata["names"])
    assert made.is_watertight
    assert made.metadata["chord"] <= chord
    assert made.metadata["names"] == ("front", "rear", "edge 1", "edge 2")
    for face in (0, 1):  # 2000 other points than were measured
        assert np.abs(heights(WAVY, samples(mesh, face), face)).max() <= 1.5 * chord
    assert abs(made.volume - aperture_volume(WAVY, APERTURE)) <= chord * made.area


def test_a_glb_is_in_metres_with_one_coloured_material_per_face():
    mesh = tessellated(WAVY, 1e-2, single=True)
    data = glb_bytes(mesh, "lamp")
    scene = trimesh.load_scene(io.BytesIO(data), file_type="glb")
    assert scene.units == "meters"
    assert scene.bounds == pytest.approx(1e-3 * to_trimesh(mesh).bounds, rel=1e-12)
    assert len(scene.geometry) == 6
    colours = {g.visual.material.name: g.visual.material.baseColorFactor for g in scene.geometry.values()}
    assert set(colours) == set(mesh.names)
    length = int.from_bytes(data[12:16], "little")
    header = json.loads(data[20 : 20 + length])
    assert len(data) == int.from_bytes(data[8:12], "little")
    assert header["nodes"][0]["name"] == "lamp"
    assert header["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] == pytest.approx(
        [0.4770, 0.6921, 0.8900, 1], abs=1e-4
    )
    assert glb_bytes(mesh, "lamp") == data


def test_the_triangles_of_a_glb_close_over_its_one_list_of_vertices():
    """Read from the bytes: every edge once each way, over all primitives."""
    data = glb_bytes(tessellated(WAVY, 1e-2, single=True))
    length = int.from_bytes(data[12:16], "little")
    header, binary = json.loads(data[20 : 20 + length]), data[20 + length + 8 :]
    (mesh,) = header["meshes"]
    assert {part["attributes"]["POSITION"] for part in mesh["primitives"]} == {0}
    corners = []
    for part in mesh["primitives"]:
        accessor = header["accessors"][part["indices"]]
        start = header["bufferViews"][accessor["bufferView"]]["byteOffset"]
        corners.append(np.frombuffer(binary, "<u4", accessor["count"], start).reshape(-1, 3))
    triangles = np.concatenate(corners)
    edges = np.concatenate([triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    assert len(np.unique(edges, axis=0)) == len(edges)
    assert set(map(tuple, edges.tolist())) == set(map(tuple, edges[:, ::-1].tolist()))


@pytest.mark.parametrize("name", ["stl", "ply", "obj", "glb"])
def test_files_are_closed_as_trimesh_loads_them_but_for_glb_which_has_a_mesh_for_every_face(name):
    mesh = tessellated(WAVY, 1e-2, single=True)
    write = {"stl": stl_bytes, "ply": ply_bytes, "obj": obj_bytes, "glb": glb_bytes}
    read = trimesh.load_mesh(io.BytesIO(write[name](mesh)), file_type=name)
    if name == "glb":
        assert not read.is_watertight
        read.merge_vertices(merge_norm=True, merge_tex=True)
    assert read.is_watertight
    assert read.is_winding_consistent


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: body_mesh(WIDER, 1e-3, None, FLANGE), "cut both by an aperture, or export step"),
        (lambda: body_mesh(PLAIN, 1e-3, (9, 9)), "semi_axes must be at most the front's half-widths"),
        (lambda: body_mesh(PLAIN, 1e-3, None, Flange(2, -1, 1)), "flange low must lie above the front's"),
        (lambda: body_mesh(PLAIN, 1e-3, (2, 2), polygon=POLYGONS["L"]), "an outline by itself"),
        (lambda: body_mesh(PLAIN, 1e-3, polygon=[(0, 0), (9, 0), (0, 9)]), "must lie within the front's"),
        (lambda: body_mesh(WAVY, 1e-8, polygon=POLYGONS["L"]), "needs more than 20,000,000 triangles"),
        (lambda: body_mesh(WAVY, 1e-8, None, None, True, POLYGONS["L"]), "chord must be greater than 2e-06"),
        (lambda: body_mesh(PLAIN, np.nan, (2, 2)), "chord must be a finite number"),
        (lambda: body_mesh(WAVY, 1e-8, (2, 2)), "needs more than 20,000,000 triangles"),
        (lambda: glb_bytes(tessellated(WAVY, 1e-2)), "GLB holds float32"),
        (lambda: to_trimesh("lens"), "lens must be a Lens or Part or Tessellation, got str"),
        (lambda: to_trimesh(lens_part(WAVY), 1e-6), "chord must be a finite number of at least 1e-05"),
    ],
)
def test_refusals(call, words):
    with pytest.raises(ValueError, match=words):
        call()
