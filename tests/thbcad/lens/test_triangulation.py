"""Meshes of lenses: closed, oriented, and as close to the surfaces as they say."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, strategies as st
from scipy.spatial import cKDTree

from tests.cases import examples
from tests.thbcad.cases import lenses, seeds
from thbcad import FreeformSurface, KnotVector, Lens, THBSpace, THBSurface
from thbcad.io import obj_bytes, ply_bytes, stl_bytes, threemf_bytes
from thbcad.lens.triangulation import ALLOWANCE, EDGES, FRONT, MOST_TRIANGLES, REAR, tessellated
from thbcad.sags import Conic

BOWL = Lens(
    FreeformSurface((5.0, 4.0), Conic(40.0, -1.0)), FreeformSurface((5.0, 4.0), Conic(-30.0, -1.0)), 6.0, 1.5
)
RULED = Lens(
    FreeformSurface((5.0, 4.0), Conic(-9.0, -1.0)), FreeformSurface((8.0, 3.0), Conic(-12.0, -1.0)), 6.0, 1.5
)
LINE = KnotVector.uniform(3, 1, -5.0, 5.0)
TILT = THBSurface(THBSpace(LINE, LINE), np.repeat(0.5 * LINE.greville(), 4))  # z = x / 2
TWISTED = Lens(FreeformSurface((5.0, 5.0)), FreeformSurface((5.0, 11.0), sag=TILT), 3.0, 1.5)
BIG = examples(60, suppress_health_check=[HealthCheck.too_slow])


def directed_edges(mesh):
    """Return the directed edges of all triangles, one number each, and those of the turned-over mesh."""
    a, b = mesh.triangles.ravel(), np.roll(mesh.triangles, -1, axis=1).ravel()
    n = len(mesh.vertices)
    return np.sort(a * n + b), np.sort(b * n + a)


def volume_and_area(mesh):
    """Return the volume by the divergence theorem and the area."""
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return (corners[:, 0] * normals).sum() / 6, np.linalg.norm(normals, axis=1).sum() / 2


def points_of(mesh, face, shares):
    """Return the points with barycentric shares (k, 3) on every triangle of a face, (n, 3)."""
    corners = mesh.vertices[mesh.triangles[mesh.faces == face]]
    return np.einsum("kc,tcd->ktd", shares, corners).reshape(-1, 3)


def height_errors(lens, mesh, shares):
    """Return |z - surface| at points of the front and of the rear, the rim's rounding clipped."""
    found = []
    for face, surface, vertex in ((FRONT, lens.front, 0.0), (REAR, lens.rear, lens.thickness)):
        x, y, z = points_of(mesh, face, shares).T
        x, y = (np.clip(a, -h, h) for a, h in zip((x, y), surface.half_width))
        found.append(np.abs(z - vertex - surface(x, y)))
    return found


LENSES_AND_CHORDS = lenses(conics=False), st.booleans(), st.sampled_from([1e-2, 3e-3]), seeds()


@pytest.mark.slow
@BIG
@given(*LENSES_AND_CHORDS)
def test_the_mesh_is_closed_and_keeps_its_chord(lens, single, chord, rng):
    mesh = tessellated(lens, chord, single)
    forward, backward = directed_edges(mesh)
    assert (np.diff(forward) > 0).all()  # no edge twice the same way
    assert np.array_equal(forward, backward)  # every edge once each way: closed, consistently oriented
    assert len(np.unique(mesh.vertices, axis=0)) == len(mesh.vertices)
    assert np.array_equal(np.unique(mesh.triangles), np.arange(len(mesh.vertices)))
    assert mesh.chord <= chord
    shares = np.concatenate(
        [rng.dirichlet(np.ones(3), 3), [[0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [1, 0, 0]]]
    )
    assert max(errors.max() for errors in height_errors(lens, mesh, shares)) <= mesh.chord
    volume, area = volume_and_area(mesh)
    assert abs(volume - lens.volume()) <= mesh.chord * area


@pytest.mark.parametrize("lens", [BOWL, RULED], ids=["equal sizes", "ruled edges"])
def test_paraboloids_have_the_error_of_the_bound(lens):
    """z = (x^2 + y^2) / 2 R has constant second derivatives: in the middle of the longest side the error is
    (h^2 + k^2) / 8 R."""
    mesh = tessellated(lens, 1e-3)
    middles = np.array([[0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]])
    worst = max(errors.max() for errors in height_errors(lens, mesh, middles))
    assert worst <= mesh.chord <= 1e-3
    if lens is BOWL:  # the edges of the other one decide
        assert worst == pytest.approx(mesh.chord - ALLOWANCE, rel=1e-6)


def test_conics_that_are_no_polynomials_keep_it():
    lens = Lens(
        FreeformSurface((4.0, 4.0), Conic(9.0, 0.0)),
        FreeformSurface((4.0, 4.0), Conic(-12.0, -3.0)),
        12.0,
        1.5,
    )
    mesh = tessellated(lens, 1e-4)
    assert (
        max(
            e.max()
            for e in height_errors(lens, mesh, np.array([[0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]]))
        )
        <= mesh.chord
        <= 1e-4
    )


def test_triangles_grow_as_the_inverse_of_the_chord():
    counts = [(tessellated(BOWL, chord).faces <= REAR).sum() for chord in (1e-3, 1e-4, 1e-5)]
    assert np.diff(np.log10(counts)) == pytest.approx([1, 1], abs=0.05)


def test_edges_of_equal_rims_are_plane():
    mesh = tessellated(BOWL, 1e-3)
    for face, axis, place in zip(EDGES, (1, 0, 1, 0), (-4.0, 5.0, 4.0, -5.0)):
        # a mean of equal numbers is wrong by some roundings
        assert mesh.vertices[mesh.triangles[mesh.faces == face], axis] == pytest.approx(place, abs=1e-14)


@pytest.mark.parametrize("lens", [BOWL, RULED], ids=["equal sizes", "ruled edges"])
def test_edges_look_outwards(lens):
    mesh = tessellated(lens, 1e-2)
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    for face, axis, sign in zip((*EDGES, FRONT, REAR), (1, 0, 1, 0, 2, 2), (-1, 1, 1, -1, -1, 1)):
        assert (sign * normals[mesh.faces == face, axis] > 0).all()


def test_ruled_edges_keep_the_chord():
    """Every point of the mesh's edges has a point of the ruled surface within the chord error, found on a
    fine grid.

    The rear is a tilted plane: front and rear need no grid lines, and the flat edge at high y is a hyperbolic
    paraboloid, all twist and no bend, which only rows of triangles bring nearer.
    """
    mesh = tessellated(TWISTED, 0.1)
    s, w = np.linspace(-1, 1, 801), np.linspace(0, 1, 801)[:, None, None]
    rims = []
    for surface, vertex in ((TWISTED.front, 0.0), (TWISTED.rear, TWISTED.thickness)):
        x, y = s * surface.half_width[0], np.full_like(s, surface.half_width[1])
        rims.append(np.column_stack([x, y, vertex + surface(x, y)]))
    exact = ((1 - w) * rims[0] + w * rims[1]).reshape(-1, 3)
    points = points_of(
        mesh, EDGES[2], np.array([[0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [1 / 3, 1 / 3, 1 / 3]])
    )
    distance, _ = cKDTree(exact).query(points)
    # the nearest point of the grid lies up to half the diagonal of its cells beside the nearest point
    cells = exact.reshape(801, 801, 3)
    blur = np.linalg.norm(cells[1:, 1:] - cells[:-1, :-1], axis=2).max() / 2
    assert np.sqrt(np.maximum(distance**2 - blur**2, 0)).max() <= mesh.chord <= 0.1
    # and half the rows would not do
    assert np.sqrt(np.maximum(distance**2 - blur**2, 0)).max() > 0.5 * mesh.chord


def test_float32_is_part_of_the_chord():
    mesh = tessellated(BOWL, 1e-4, single=True)
    assert np.array_equal(mesh.vertices, mesh.vertices.astype(np.float32))
    assert mesh.chord <= 1e-4
    with pytest.raises(ValueError, match=r"chord must be at least .* as rounding moves vertices"):
        tessellated(BOWL, 1e-7, single=True)


@pytest.mark.parametrize(
    ("lens", "chord", "words"),
    [
        *((BOWL, x, "chord must be a finite number of at least 1e-08") for x in (0.0, 1e-9, -1.0, "1", True)),
        *((BOWL, x, "chord must be a finite number of at least 1e-08") for x in (np.nan, np.inf)),
        (BOWL, 1e-8, f"more than {MOST_TRIANGLES:,}; allow a greater one"),
        ("lens", 1e-3, "lens must be a Lens"),
    ],
)
def test_chords_and_other_things_than_lenses_are_refused(lens, chord, words):
    with pytest.raises(ValueError, match=words):
        tessellated(lens, chord)


@pytest.mark.parametrize("write", [stl_bytes, threemf_bytes, obj_bytes, ply_bytes])
def test_the_same_mesh_gives_the_same_bytes(write):
    first, second = (tessellated(BOWL, 1e-2, single=True) for _ in range(2))
    assert write(first) == write(second)


@pytest.mark.parametrize("write", [stl_bytes, threemf_bytes])
def test_formats_of_float32_refuse_other_vertices(write):
    with pytest.raises(ValueError, match="single=True"):
        write(tessellated(BOWL, 1e-2))
