"""The lens as Mitsuba meshes: closed, on the surfaces, and differentiable down to the THB coefficients."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mitsuba")

from optics.exchange.mitsuba.loading import load_mitsuba
from optics.exchange.mitsuba.mesh import FACES, LensMesh
from tests.optics.cases import coefficients, hollow_lens, rough, small_lens, small_space
from thbcad.lens import Lens

EPS = 2.0**-23  # of float32


@pytest.fixture(scope="module")
def mi():
    return load_mitsuba()


def two_free_lens():
    """Return a lens whose faces are both free and of different size."""
    return hollow_lens(lambda space: rough(space, 0.3), lambda space: rough(space, 0.1, 6), (4, 3))


def rounded_lens(share):
    """Return that lens with corners of a share of the half-widths."""
    lens = two_free_lens()
    surfaces = (replace(s, corners=tuple(share * h for h in s.half_width)) for s in (lens.front, lens.rear))
    return Lens(*surfaces, lens.thickness, lens.index)


def stored(mi, owner, name=None):
    """Return (positions, normals, triangles) of a mesh, or of a mesh in a scene; of the edges there are no
    normals."""
    parameters, prefix = mi.traverse(owner), "" if name is None else f"{name}."
    return tuple(
        np.array(parameters[prefix + key]).reshape(-1, 3)
        for key in ("vertex_positions", "vertex_normals", "faces")
    )


def corners(parts):
    """Return the corners of all triangles of meshes, (m, 3, 3) float32."""
    return np.concatenate([positions[triangles] for positions, _, triangles in parts])


def require_closed(triangles):
    """Every edge is run through once in each direction: closed, and oriented one way."""
    edges = Counter()
    for triangle in triangles:
        names = [corner.tobytes() for corner in triangle]
        edges.update(zip(names, names[1:] + names[:1]))
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)


def volume(triangles):
    """Return the volume within a closed mesh: positive where its triangles run counter-clockwise seen from
    outside."""
    a, b, c = np.moveaxis(triangles.astype(float), 1, 0)
    return float((a * np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize(
    "lens",
    [small_lens(sag=rough(small_space())), two_free_lens(), rounded_lens(0.4), rounded_lens(1.0)],
    ids=["plane front", "both free", "rounded", "round"],
)
def test_the_faces_close_outward_and_enclose_the_volume(mi, lens):
    """The volume of the mesh errs by the chords, h^2: from one grid to one twice as fine the error falls by
    4."""
    errors = []
    for n in (33, 65, 129):
        shapes = LensMesh.uniform(lens, (n, n + 2)).shapes(mi)
        parts = [stored(mi, shapes[name]) for name in FACES]
        if n == 33:
            require_closed(corners(parts))
        errors.append(abs(volume(corners(parts)) - lens.volume()))
    assert errors[0] < 1e-3 * lens.volume()
    assert errors[1] < errors[0] / 3
    assert errors[2] < errors[1] / 3


@pytest.mark.parametrize("lens", [two_free_lens(), rounded_lens(0.4)], ids=["rectangle", "rounded"])
def test_vertices_and_normals_are_those_of_the_surfaces(mi, lens):
    mesh = LensMesh.uniform(lens, (33, 29))
    shapes = mesh.shapes(mi)
    for name, surface, vertex, side in (
        ("front", lens.front, 0.0, -1),
        ("rear", lens.rear, lens.thickness, 1),
    ):
        positions, normals, triangles = stored(mi, shapes[name])
        x, y = mesh.surfaces[name].positions
        assert (
            np.abs(positions - np.stack([x, y, vertex + surface(x, y)], axis=1)).max() <= 8 * EPS
        )  # half a unit of numbers below 16
        normal = side * np.stack([-surface(x, y, (1, 0)), -surface(x, y, (0, 1)), np.ones_like(x)], axis=1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        assert np.abs(normals - normal).max() <= EPS
        a, b, c = np.moveaxis(positions[triangles].astype(float), 1, 0)
        assert ((np.cross(b - a, c - a) * normal[triangles[:, 0]]).sum(axis=1) > 0).all()
    assert stored(mi, shapes["edges"])[1].size == 0


def test_the_chord_error_is_kept(mi):
    """The mesh's triangles are straight between their corners; in the middles the surface is within the chord
    error."""
    lens, chord = two_free_lens(), 1e-3
    positions, _, triangles = stored(mi, LensMesh.within(lens, chord).shapes(mi)["rear"])
    middle = positions[triangles].astype(float).mean(axis=1)
    error = np.abs(lens.thickness + lens.rear(middle[:, 0], middle[:, 1]) - middle[:, 2]).max()
    assert chord / 100 < error < chord


@pytest.mark.parametrize("lens", [two_free_lens(), rounded_lens(0.4)], ids=["rectangle", "rounded"])
@pytest.mark.parametrize("name", ["front", "rear"])
def test_the_matrices_give_the_surface(name, lens):
    vertices, sag = LensMesh.uniform(lens, (21, 18)).surfaces[name], getattr(lens, name).sag
    # sums of a few hundred products of numbers up to 10, and slopes of them
    np.testing.assert_allclose(vertices.jet(sag.coefficients), vertices.jet(), rtol=0, atol=1e-12)
    rng = np.random.default_rng(1)
    c, g = rng.standard_normal(sag.space.dim), rng.standard_normal((3, 21 * 18))
    assert np.vdot(vertices.push_forward(c), g) == pytest.approx(vertices.pull_back(g) @ c, rel=1e-12)
    knots = [
        kv.rescale(-h, h) for kv, h in zip((sag.space.kv_u, sag.space.kv_v), vertices.surface.half_width)
    ]
    assert vertices.pull_back(g, knots).ravel() == pytest.approx(vertices.pull_back(g), rel=1e-10, abs=1e-12)


@pytest.mark.parametrize("name", ["front", "rear"])
def test_derivatives_of_positions_and_normals(mi, name):
    """Central differences with h = 1e-5 err by h^2 of the third derivative and by 1e-16 / h."""
    import drjit as dr

    lens = two_free_lens()
    mesh, rng = LensMesh.uniform(lens, (21, 18)), np.random.default_rng(2)
    sag, weights = getattr(lens, name).sag, rng.standard_normal((6, 21 * 18))
    direction = rng.standard_normal(sag.space.dim)
    rows = mesh.surfaces[name]

    def numbers(c):
        z, zx, zy = rows.jet(c)
        normal = (
            np.stack([-zx, -zy, np.ones_like(z)]) / np.sqrt(1 + zx**2 + zy**2) * (1 if name == "rear" else -1)
        )
        return np.concatenate([np.stack([*rows.positions, z]), normal])

    def dual(c):
        positions, normals = mesh.vertices(mi, name, mesh.jet(mi, name, c))
        return [mi.Float64(a) for a in (*positions, *normals)]

    c = mi.Float64(sag.coefficients)
    dr.enable_grad(c)
    dr.backward(sum(dr.sum(a * mi.Float64(w)) for a, w in zip(dual(c), weights)))
    backward = dr.grad(c).numpy() @ direction
    c = mi.Float64(sag.coefficients)
    dr.enable_grad(c)
    dr.set_grad(c, mi.Float64(direction))
    out = dual(c)
    dr.forward_to(out)
    forward = sum(np.vdot(dr.grad(a).numpy() * np.ones(21 * 18), w) for a, w in zip(out, weights))
    h = 1e-5
    change = (numbers(sag.coefficients + h * direction) - numbers(sag.coefficients - h * direction)) / (2 * h)
    # the meshes hold float32: derivatives are rounded to it on their way, by EPS of the sum of their sizes
    scale = np.abs(change * weights).sum()
    assert backward == pytest.approx(np.vdot(change, weights), abs=EPS * scale)
    assert forward == pytest.approx(backward, abs=EPS * scale)


def test_a_scene_follows_the_coefficients_and_stays_closed(mi):
    lens = two_free_lens()
    mesh = LensMesh.uniform(lens, (9, 8))
    scene = mi.load_dict({"type": "scene", **mesh.shapes(mi)})
    moved = [c + 0.01 * np.arange(len(c)) / len(c) for c in coefficients(lens)]
    mesh.update(mi, mi.traverse(scene), [mi.Float64(c) for c in moved])
    wanted = lens.with_sags([type(sag)(sag.space, c) for sag, c in zip(lens.sags, moved)])
    fresh = LensMesh.uniform(wanted, (9, 8)).shapes(mi)
    parts = [stored(mi, scene, name) for name in FACES]
    require_closed(corners(parts))
    for part, name in zip(parts, FACES):
        positions, normals, _ = stored(mi, fresh[name])
        # both are rounded to float32, coordinates of up to 16
        assert np.abs(part[0] - positions).max() <= 16 * EPS
        assert np.abs(part[1] - normals).max(initial=0.0) <= 2 * EPS


@pytest.mark.parametrize("row", [[-1.0, 0.5], [1.0, -1.0], [-1.0, 0.0, 0.0, 1.0], [1.0], [[-1.0, 1.0]]])
def test_rows_that_do_not_rise_are_refused(row):
    with pytest.raises(ValueError, match="s must be one row of numbers that rise from -1 to 1"):
        LensMesh(small_lens(), row, [-1.0, 1.0])
