"""Nodes of faces, and OCCT's intersections of rays with them: against closed forms and the lens surfaces."""

import numpy as np
import pytest
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeSphere

from tests.thbcad.cases import LENSES
from thbcad import write_step
from thbcad.cad.exchange.face_points import face_hits, face_nodes, step_solid
from thbcad.cad.shapes import lens_solid
from thbcad.lens import optical_forms
from thbcad.sags import PlacedConic

ROUNDING = 1e-12  # mm: some hundred last digits of numbers up to 100


def scattered(count, seed, least=0.3):
    """Return (origins in the plane z = -20, unit directions with d_z >= least)."""
    rng = np.random.default_rng(seed)
    origins = np.column_stack([rng.uniform(-8, 8, (count, 2)), np.full(count, -20.0)])
    rise, turn = rng.uniform(least, 1, count), rng.uniform(0, 2 * np.pi, count)
    across = np.sqrt(1 - rise**2)
    return origins, np.column_stack([across * np.cos(turn), across * np.sin(turn), rise])


def test_a_box_is_met_at_its_planes():
    box = BRepPrimAPI_MakeBox(2.0, 3.0, 4.0).Shape()
    origins = [[1, 1, -5], [1, 1, 9], [-7, 1, 1], [1, 1, 1], [5, 5, -5], [1, 1, 4]]
    directions = [[0, 0, 1], [0, 0, -1], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -2.0]]
    hits = face_hits(box, origins, directions)
    np.testing.assert_allclose(
        hits.points[:4], [[1, 1, 0], [1, 1, 4], [0, 1, 1], [1, 3, 1]], rtol=0, atol=ROUNDING
    )
    np.testing.assert_allclose(
        hits.normals[:4], [[0, 0, -1], [0, 0, 1], [-1, 0, 0], [0, 1, 0]], rtol=0, atol=ROUNDING
    )
    assert len(set(hits.faces[:4])) == 4
    assert hits.faces[4] == -1
    assert np.isnan(hits.points[4]).all()
    assert np.isnan(hits.normals[4]).all()
    np.testing.assert_allclose(
        hits.points[5], [1, 1, 0], rtol=0, atol=ROUNDING
    )  # leaves the face that it starts on


def test_a_sphere_is_met_where_the_quadratic_says():
    origins, directions = scattered(200, 0)
    hits = face_hits(BRepPrimAPI_MakeSphere(7.0).Shape(), origins, directions)
    half = np.einsum("ij,ij->i", origins, directions)
    square = half**2 - np.einsum("ij,ij->i", origins, origins) + 49
    met = square > 0
    np.testing.assert_array_equal(hits.faces >= 0, met)
    assert 20 < met.sum() < 180
    points = (origins + (-half - np.sqrt(np.where(met, square, 0)))[:, None] * directions)[met]
    # near tangency the root of the quadratic spreads a last digit by R / sqrt(square)
    np.testing.assert_allclose(
        hits.points[met], points, rtol=0, atol=ROUNDING * 7 / np.sqrt(square[met].min())
    )
    np.testing.assert_allclose(
        hits.normals[met], points / 7, rtol=0, atol=ROUNDING / np.sqrt(square[met].min())
    )


@pytest.mark.parametrize("name", LENSES)
def test_lens_faces_are_met_on_the_surface_of_the_lens(name):
    """First the front, from below; from there straight on, the rear or an edge face: heights and normals by
    the kernel."""
    lens = LENSES[name]
    rng = np.random.default_rng(3)
    h = np.minimum(lens.front.half_width, lens.rear.half_width)
    x, y = (a * rng.uniform(-0.99, 0.99, 40) for a in h)
    up = np.tile([0.0, 0.0, 1.0], (40, 1))
    solid = lens_solid(lens)
    front = face_hits(solid, np.column_stack([x, y, np.full(40, -100.0)]), up)
    rear = face_hits(solid, front.points, up)
    for hits, surface, vertex, sign in ((front, lens.front, 0.0, -1), (rear, lens.rear, lens.thickness, 1)):
        assert hits.faces.tolist() == [0 if sign < 0 else 1] * 40
        # a conic that is no paraboloid is within 1e-11 mm
        np.testing.assert_allclose(
            hits.points, np.column_stack([x, y, vertex + surface(x, y)]), rtol=0, atol=2e-11
        )
        normal = np.column_stack([-surface(x, y, (1, 0)), -surface(x, y, (0, 1)), np.ones(40)])
        normal *= sign / np.linalg.norm(normal, axis=1, keepdims=True)
        np.testing.assert_allclose(hits.normals, normal, rtol=0, atol=1e-10)
    if lens.front.half_width == lens.rear.half_width:
        sideways = face_hits(solid, (front.points + rear.points) / 2, np.tile([1.0, 0.0, 0.0], (40, 1)))
        np.testing.assert_allclose(sideways.points[:, 0], lens.front.half_width[0], rtol=0, atol=ROUNDING)
        assert set(sideways.faces) <= {2, 3, 4, 5}


def test_a_file_gives_the_hits_of_the_solid(tmp_path):
    lens, path = LENSES["table63"], tmp_path / "lens.step"
    write_step(lens, path)
    rays = scattered(50, 1)
    by_file, by_shape, direct = (face_hits(s, *rays) for s in (path, step_solid(path), lens_solid(lens)))
    assert (direct.faces >= 0).sum() > 5
    for hits in (by_file, by_shape):
        np.testing.assert_array_equal(hits.faces, direct.faces)
        np.testing.assert_allclose(hits.points, direct.points, rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(hits.normals, direct.normals, rtol=0, atol=ROUNDING)


def test_no_rays_meet_nothing():
    hits = face_hits(BRepPrimAPI_MakeBox(2.0, 3.0, 4.0).Shape(), np.zeros((0, 3)), np.zeros((0, 3)))
    assert hits.points.shape == hits.normals.shape == (0, 3)
    assert hits.faces.shape == (0,)


@pytest.mark.parametrize(
    ("origins", "directions", "sentence"),
    [
        (np.zeros(3), np.ones(3), "same shape"),
        (np.zeros((2, 3)), np.ones((1, 3)), "same shape"),
        (np.zeros((2, 2)), np.ones((2, 2)), "same shape"),
        (np.full((1, 3), np.nan), np.ones((1, 3)), "finite"),
        (np.zeros((1, 3)), np.zeros((1, 3)), "not zero"),
    ],
)
def test_rays_that_are_none_are_refused(origins, directions, sentence):
    with pytest.raises(ValueError, match=sentence):
        face_hits(BRepPrimAPI_MakeBox(2.0, 3.0, 4.0).Shape(), origins, directions)


def test_a_damaged_file_does_not_reach_occt(tmp_path):
    path = tmp_path / "lens.step"
    write_step(LENSES["table63"], path)
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(ValueError, match="not a whole STEP file"):
        face_hits(path, [[0, 0, -9]], [[0, 0, 1]])


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
