"""Solids of patches: closed over T-junctions, every face on its surface, every edge on both of its faces."""

import re

import build123d
import numpy as np
import pytest
from hypothesis import given, strategies as st
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SHELL, TopAbs_VERTEX
from OCP.TopExp import TopExp

from tests.cases import examples
from tests.thbcad.cad.shapes.cases import assert_whole
from tests.thbcad.cases import surfaces
from thbcad.cad.exchange import SolidState, explore, part_step, solid_volume, step_shape
from thbcad.cad.occt_names import ShapeNumbers, ShapeOwners, as_edge, as_face
from thbcad.cad.shapes.lens_parts import lens_part
from thbcad.cad.shapes.patched_solid import lens_patches, patched_part
from thbcad.hierarchy import THBSpace
from thbcad.io import parse_brep, patched_deviation
from thbcad.lens import FreeformSurface, Lens, Product, placed_surfaces
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

EPS = np.finfo(float).eps
CONIC = 1e-11  # mm, of conics that are neither planes nor paraboloids


def sag(space, amplitude=0.05):
    return THBSurface(space, amplitude * np.sin(np.arange(space.dim)))


def disk(degree=(3, 3), spans=4, levels=3, radius=0.4):
    """A space refined level by level in smaller and smaller disks at the centre: many T-junctions."""
    space = THBSpace(*(KnotVector.uniform(p, spans, -1.0, 2.0) for p in degree))
    for level in range(levels):
        cells = space.cells[space.cells[:, 0] == level, 1:]
        centres = (cells + 0.5) / (spans << level) - 0.5
        space = space.refine({level: cells[np.hypot(*centres.T) < radius * 0.7**level]})
    return space


def corner(degree=(3, 3), levels=2):
    """A space refined in one corner only: T-junctions on the rim."""
    space = THBSpace(*(KnotVector.uniform(p, 4) for p in degree))
    for level in range(levels):
        space = space.refine({level: [(i, j) for i in range(3) for j in range(4)]})
    return space


LENSES = {
    "plano": Lens(FreeformSurface((10, 8)), FreeformSurface((10, 8), Conic(-80.0, -1.0)), 5.0, 1.5),
    "disk": Lens(
        FreeformSurface((10, 8)), FreeformSurface((10, 8), Conic(150.0, -1.0), sag(disk())), 5.0, 1.5
    ),
    "both": Lens(
        FreeformSurface((9, 9), Conic(60.0, -1.0), sag(corner((2, 4)))),
        FreeformSurface((9, 9), Conic(), sag(disk((4, 3), levels=2))),
        6.0,
        1.5,
    ),
    "larger": Lens(
        FreeformSurface((5, 4), Conic(-90.0, -1.0), sag(corner())),
        FreeformSurface((6.7, 8), Conic(50.0, -1.0), sag(corner((4, 4)))),
        6.0,
        1.5,
    ),
    "smaller": Lens(
        FreeformSurface((7, 20 / 3), Conic(80.0, -1.0), sag(disk())),
        FreeformSurface((5, 1 / 0.3), Conic(-90.0, -1.0)),
        6.0,
        1.5,
    ),
    "conics": Lens(
        FreeformSurface((3.1, 3), Conic(-40.0, 0.0), sag(corner())),
        FreeformSurface((2.9, 3), Conic(-60.0, -2.5), sag(disk(levels=2))),
        4.0,
        1.5,
    ),
    "awkward": Lens(
        FreeformSurface((1.0988357457165069, 1 / 3), Conic(), sag(corner(), 0.01)),
        FreeformSurface((1 / 1.3, 0.7), Conic(33.0, -1.0), sag(corner(), 0.01)),
        np.pi,
        1.5,
    ),
}


@st.composite
def thick_lenses(draw):
    """Lenses so thick that no ruled edge crosses a surface; front and rear may differ in size."""
    rear = draw(surfaces())
    front = draw(surfaces(tuple(draw(st.sampled_from([1.0, 1.0, 0.8, 1.3])) * h for h in rear.half_width)))
    return Lens(front, rear, 100.0, 1.5)


def allowed(lens):
    """What separates a file from the lens, mm: the conic's tolerance, and rounding of sums of at most 25
    values of the heights' size."""
    exact = all(surface.conic.is_paraboloid for surface in (lens.front, lens.rear))
    size = lens.thickness + max(abs(graph.coefficients).max() for graph in lens.graphs())
    return (0.0 if exact else CONIC) + 50 * EPS * size


@pytest.fixture(scope="module", params=LENSES)
def written(request, tmp_path_factory):
    """(lens, part, path, shape read back), written once for each lens."""
    lens = LENSES[request.param]
    path = tmp_path_factory.mktemp("patched") / f"{request.param}.step"
    part = patched_part(lens)
    path.write_bytes(part_step(part, Product()))
    return lens, part, path, step_shape(path)


def count(shape, kind):
    found = ShapeNumbers()
    TopExp.MapShapes_s(shape, kind, found)
    return found.Extent()


def owners(shape):
    """Return [(edge, its faces), ...]."""
    table = ShapeOwners()
    TopExp.MapShapesAndAncestors_s(shape, TopAbs_EDGE, TopAbs_FACE, table)
    return [
        (as_edge(table.FindKey(k)), [as_face(f) for f in table.FindFromIndex(k)])
        for k in range(1, table.Extent() + 1)
    ]


def assert_closed(shape):
    assert_whole(SolidState(shape), count(shape, TopAbs_FACE))
    assert len(explore(shape, TopAbs_SHELL)) == 1
    assert count(shape, TopAbs_VERTEX) - count(shape, TopAbs_EDGE) + count(shape, TopAbs_FACE) == 2


def value(surface, vertex, x, y):
    """Return z of the lens's own THB surface in the lens frame."""
    return vertex + surface(*(np.clip(a, -h, h) for a, h in zip((x, y), surface.half_width)))


@pytest.mark.every(3)
def test_the_solid_is_closed_before_and_after_a_round_trip(written):
    _, part, _, shape = written
    assert_closed(part.solid)
    assert_closed(shape)
    assert count(shape, TopAbs_FACE) == len(part.faces) == len(part.names) == len(set(part.names))


@pytest.mark.every(3)
def test_one_face_for_each_patch(written):
    lens, part, _, _ = written
    wanted = []
    for name, surface in (("front", lens.front), ("rear", lens.rear)):
        patches = 1 if surface.sag is None else len(surface.sag.to_patches())
        wanted += [f"{name} {k}" for k in range(1, patches + 1)]
    assert list(part.names) == [*wanted, "edge -y", "edge +x", "edge +y", "edge -x"]


@pytest.mark.every(3)
def test_the_volume_is_the_lens_volume(written):
    lens, part, _, shape = written
    for solid in (part.solid, shape):
        assert solid_volume(solid, 1e-7) == pytest.approx(lens.volume(), rel=1e-6)


@pytest.mark.every(4)
def test_faces_read_back_lie_on_the_surfaces(written):
    """OCCT evaluates what it read, in the order of the names; the lens evaluates its THB surface."""
    lens, part, _, shape = written
    rng = np.random.default_rng(0)
    for name, face in zip(part.names, explore(shape, TopAbs_FACE)):
        surface, vertex = {"front": (lens.front, 0.0), "rear": (lens.rear, lens.thickness)}.get(
            name.split()[0], (None, None)
        )
        if surface is None:
            continue
        occt = BRepAdaptor_Surface(as_face(face))
        u = rng.uniform(occt.FirstUParameter(), occt.LastUParameter(), 40)
        v = rng.uniform(occt.FirstVParameter(), occt.LastVParameter(), 40)
        x, y, z = np.array([occt.Value(*place).Coord() for place in zip(u.tolist(), v.tolist())]).T
        assert abs(value(surface, vertex, x, y) - z).max() <= allowed(lens)


@pytest.mark.every(4)
def test_the_deviation_of_the_file_is_rounding(written):
    lens, _, path, _ = written
    assert patched_deviation(path, lens) <= allowed(lens)


def test_the_text_names_the_faces(written):
    _, part, path, _ = written
    assert sorted(re.findall(r"ADVANCED_FACE\('([^']*)'", path.read_text("ascii"))) == sorted(part.names)


def test_the_text_pairs_every_edge_without_occt(written):
    _, part, path, _ = written
    solid = parse_brep(path)
    assert (len(solid.faces), solid.unpaired, solid.gaps) == (len(part.faces), 0, 0)


def test_edges_lie_on_both_faces_at_equal_parameters(written):
    lens, part, _, _ = written
    # both neighbours have the error of the lens, and x and y are as large as the lens
    room = 2 * allowed(lens) + 50 * EPS * max(*lens.front.half_width, *lens.rear.half_width)
    for edge, faces in owners(part.solid):
        curve = BRepAdaptor_Curve(edge)
        for face in faces:
            on_face = BRepAdaptor_Curve(edge, face)
            for t in np.linspace(curve.FirstParameter(), curve.LastParameter(), 7).tolist():
                assert curve.Value(t).Distance(on_face.Value(t)) <= room


def test_vertices_are_the_corners_of_patches(written):
    lens, part, _, _ = written
    for patches, name in zip(lens_patches(lens), ("front", "rear")):
        corners = {
            (u, v) for p in patches for u in (p.kv_u.start, p.kv_u.stop) for v in (p.kv_v.start, p.kv_v.stop)
        }
        faces = [face for face, own in zip(part.faces, part.names) if own.startswith(name)]
        vertices = ShapeNumbers()
        for face in faces:
            TopExp.MapShapes_s(face, TopAbs_VERTEX, vertices)
        assert vertices.Extent() == len(corners)


@pytest.mark.every(3)
def test_build123d_reads_a_valid_solid(written):
    lens, part, path, _ = written
    solid = build123d.import_step(path)
    assert solid.is_valid
    assert len(solid.faces()) == len(part.faces)
    # build123d does not ask OCCT for an accuracy
    assert solid.volume == pytest.approx(lens.volume(), rel=1e-3)


def test_t_junctions_divide_the_sides_of_coarse_patches():
    part = patched_part(LENSES["disk"])
    edges = [
        count(face, TopAbs_EDGE) for face, name in zip(part.faces, part.names) if name.startswith("rear")
    ]
    assert min(edges) == 4 < max(edges)


def test_a_lens_without_sags_is_the_lens_of_six_faces():
    faces = (FreeformSurface((10, 8), Conic(radius, -1.0)) for radius in (60.0, -80.0))
    lens = Lens(*faces, 5.0, 1.5)
    text = (
        part_step(patched_part(lens), Product())
        .replace(b"'front 1'", b"'front'")
        .replace(b"'rear 1'", b"'rear'")
    )
    assert text == part_step(lens_part(lens), Product())


@pytest.mark.slow
@given(thick_lenses())
@examples(25)
def test_random_lenses_are_closed(lens):
    part = patched_part(lens)
    assert_closed(part.solid)
    assert solid_volume(part.solid, 1e-7) == pytest.approx(lens.volume(), rel=1e-6)


@given(thick_lenses())
@examples(25)
def test_patches_tile_both_surfaces_and_lie_on_them(lens):
    for patches, surface, vertex in zip(lens_patches(lens), (lens.front, lens.rear), (0.0, lens.thickness)):
        area = sum(np.ptp(p.coefficients[..., 0]) * np.ptp(p.coefficients[..., 1]) for p in patches)
        assert area == pytest.approx(4 * np.prod(surface.half_width), rel=len(patches) * 8 * EPS)
        for patch in patches:
            net = patch.grid(*(np.linspace(kv.start, kv.stop, 9) for kv in (patch.kv_u, patch.kv_v)))
            x, y, z = net.reshape(-1, 3).T
            assert abs(value(surface, vertex, x, y) - z).max() <= allowed(lens)


@given(thick_lenses())
@examples(25)
def test_patches_have_the_parameters_of_the_one_face(lens):
    """x and y of a patch at (u, v) are those of the face that the six-face lens has there."""
    for patches, whole in zip(lens_patches(lens), placed_surfaces(lens)):
        for patch in patches:
            middle = [[(kv.start + kv.stop) / 2] for kv in (patch.kv_u, patch.kv_v)]
            assert (
                abs(patch.grid(*middle) - whole.grid(*middle)).max()
                <= 2 * allowed(lens) + 50 * EPS * abs(whole.coefficients).max()
            )


@pytest.mark.every(3)
def test_the_deviation_is_what_was_moved(written):
    lens, _, path, _ = written
    moved = Lens(lens.front, lens.rear, lens.thickness + 0.25, lens.index)
    assert patched_deviation(path, moved) == pytest.approx(0.25, abs=allowed(moved))


def test_the_deviation_finds_one_coefficient(tmp_path):
    lens = LENSES["disk"]
    path = tmp_path / "lens.step"
    path.write_bytes(part_step(patched_part(lens), Product()))
    values = lens.rear.sag.coefficients.copy()
    values[-1] += 1e-6
    moved = lens.with_sags([THBSurface(lens.rear.sag.space, values)])
    # a THB function is between 0 and 1; one of the deepest level reaches (2/3)^2 inside
    assert 0.4e-6 < patched_deviation(path, moved) <= 1e-6 + allowed(lens)


def test_the_deviation_refuses_another_lens(tmp_path):
    path = tmp_path / "lens.step"
    path.write_bytes(part_step(patched_part(LENSES["disk"]), Product()))
    wider = Lens(FreeformSurface((11, 8)), FreeformSurface((11, 8)), 5.0, 1.5)
    with pytest.raises(ValueError, match=r"must cover the front once, got 0\.909"):
        patched_deviation(path, wider)


def test_the_same_lens_gives_the_same_file():
    first, second = (part_step(patched_part(LENSES["both"]), Product()) for _ in range(2))
    assert first == second


def test_patches_below_the_resolution_of_cad_are_refused():
    space = THBSpace(KnotVector.uniform(3, 4), KnotVector.uniform(3, 4))
    for level in range(14):
        space = space.refine({level: [(i, j) for i in range(2) for j in range(2)]})
    surface = FreeformSurface((1e-3, 1e-3), Conic(), sag(space, 1e-9))
    with pytest.raises(ValueError, match=r"an edge of at most 2e-07 mm"):
        patched_part(Lens(FreeformSurface((1e-3, 1e-3)), surface, 1e-3, 1.5))


def test_other_things_are_refused():
    with pytest.raises(ValueError, match="lens must be a Lens, got str"):
        patched_part("lens.json")
    disk = FreeformSurface((10.0, 10.0), corners=(10.0, 10.0))
    with pytest.raises(ValueError, match="patches are those of a lens with the outline of a rectangle"):
        patched_part(Lens(disk, disk, 5.0, 1.5))
