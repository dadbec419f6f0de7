"""The envelope of a problem's last element."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from optics.designing.etendue.envelope import envelope
from optics.designing.etendue.silhouette import greatest_slack, pixel_etendue
from optics.scene.system import designed_part
from tests.optics.cases import HOLLOW, example_system, hollow_lens, small_system

GLOWING = HOLLOW | {"source.kind": "lambertian", "source.half_width": [0.5, 0.5]}


def test_the_envelope_holds_lenses_of_all_shapes(tmp_path):
    """Points of front, rear and the edges between their rims, at both ends of z_freedom."""
    free = {"lens.rear.freeform.z_freedom": 3.0}
    system = small_system(tmp_path, GLOWING | free)
    inside = Delaunay(envelope(system))
    lens = hollow_lens()
    t = np.linspace(-1, 1, 23)
    front, rear = (
        np.stack([*np.meshgrid(h[0] * t, h[1] * t, indexing="ij"), z], axis=-1)
        for h, z in (
            ((5.0, 5.0), lens.front.conic(*np.meshgrid(5 * t, 5 * t, indexing="ij"))),
            ((8.0, 8.0), 5 + lens.rear.conic(*np.meshgrid(8 * t, 8 * t, indexing="ij"))),
        )
    )
    for shift in (-3.0, 0.0, 3.0):
        moved = rear + np.array([0, 0, shift])
        for share in (0.0, 0.5, 1.0):  # the lines between equal relative positions, the edges among them
            points = (front + share * (moved - front)).reshape(-1, 3) * (1 - 1e-9)
            assert (inside.find_simplex(points, tol=1e-9) >= 0).all()
    assert (inside.find_simplex([[0, 0, 8.1], [8.1, 0, 0]]) < 0).all()


@pytest.mark.every(4)
@pytest.mark.parametrize(
    "keys",
    [
        {"lens.body.draft": 5.0},
        {"lens.body.land": -4.0},
        {"lens.outline": "rounded", "lens.corner_radius": 1.5, "lens.rear.radius": -40.0},
        {"lens.front.half_width": [9.0, 9.0], "lens.front.radius": 40.0, "lens.rear.radius": -30.0},
    ],
    ids=["draft", "land", "rounded", "smaller rear"],
)
def test_the_envelope_holds_the_land_of_a_body(tmp_path, keys):
    """The rims of the body that is made, which is wider there than the edges between front and rear."""
    body = {"lens.body.annulus": True, "lens.outline": "round", "lens.rear.freeform.z_freedom": 0.5}
    system = small_system(tmp_path, GLOWING | body | keys)
    inside = Delaunay(envelope(system))
    for outline, z in designed_part(system).made.level_edges:
        for piece in outline.pieces:
            x, y = piece(np.linspace(*piece.ends, 9))
            points = np.stack([x, y, np.full_like(x, z)], axis=1)
            assert (inside.find_simplex(points, tol=1e-9) >= 0).all()
    slack = greatest_slack(system, pixel_etendue(system))
    assert 1 <= slack < 2


@pytest.mark.parametrize("outline", ["round", "rounded"])
def test_the_envelope_ends_at_the_outline_of_a_lens(tmp_path, outline):
    """All of the rims lies within, and what lies 0.2 % beyond them does not."""
    corner = {"lens.corner_radius": 3.0} if outline == "rounded" else {}
    system = small_system(tmp_path, GLOWING | {"lens.outline": outline} | corner)
    inside, lens = Delaunay(envelope(system)), system.base
    for surface, z in ((lens.front, 0.0), (lens.rear, lens.thickness)):
        for piece in surface.outline.pieces:
            x, y = piece(np.linspace(*piece.ends, 99))
            rim = np.stack([x, y, z + surface.conic(x, y)], axis=1)
            assert (inside.find_simplex(rim, tol=1e-9) >= 0).all()
            if surface is lens.rear:
                assert (inside.find_simplex(rim * [1.002, 1.002, 1.0]) < 0).all()


def test_the_envelope_of_an_example_is_its_two_surfaces_with_their_freedom():
    system = example_system("extended_two")
    points = envelope(system)
    # the front reaches -5 mm at its corners and is free by 1 mm, the rear 5 mm and 1.5 mm
    np.testing.assert_allclose(points.min(axis=0), [-8, -8, -6])
    np.testing.assert_allclose(points.max(axis=0), [8, 8, 6.5])
