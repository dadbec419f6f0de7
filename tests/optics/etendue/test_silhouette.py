"""The silhouette of a problem's envelope, seen from the target."""

from __future__ import annotations

from math import atan, pi, sqrt

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.spatial import ConvexHull, Delaunay

from optics.etendue.silhouette import envelope, pixel_etendue, projected_solid_angle
from optics.problem import load_problem
from optics.system import OpticalSystem
from tests.cases import ROOT
from tests.optics.cases import HOLLOW, hollow_lens

GLOWING = HOLLOW | {"source.kind": "lambertian", "source.half_width": [0.5, 0.5]}
BOX = np.array([[i, j, k] for i in (-3.0, 2.0) for j in (-1.0, 4.0) for k in (-2.0, 5.0)])


def looked_at(points, x, rays, rng):
    """Return P of a convex hull seen from x by random directions, and its standard error.

    Directions are uniform over the unit disk of (p, q), so that P is pi times the share of hits.  A line
    meets the hull where the part of it between all half-spaces is not empty.
    """
    r, phi = np.sqrt(rng.uniform(size=rays)), rng.uniform(0, 2 * pi, rays)
    d = np.stack([r * np.cos(phi), r * np.sin(phi), -np.sqrt(1 - r * r)])
    planes = ConvexHull(points).equations
    speed, gap = planes[:, :3] @ d, -(planes[:, :3] @ x + planes[:, 3])
    with np.errstate(divide="ignore"):
        at = gap[:, None] / speed
    enter = np.where(speed < 0, at, 0.0).max(axis=0)
    leave = np.where(speed > 0, at, np.inf).min(axis=0)
    share = float((enter < leave).mean())
    return pi * share, pi * sqrt(share * (1 - share) / rays)


def test_a_square_right_below_has_its_closed_form():
    """4 a / w atan(a / w) with w = sqrt(1 + a^2) for the half-width a at distance 1 (Howell, B-3, four times
    a quarter)."""
    for a in (1e-4, 0.3, 2.0):
        points = np.array([[i * a, j * a, k] for i in (-1, 1) for j in (-1, 1) for k in (-1e-9, 0.0)])
        wide = sqrt(1 + a * a)
        assert projected_solid_angle(points, np.zeros(1), np.zeros(1), 1.0)[0] == pytest.approx(
            4 * a / wide * atan(a / wide), rel=1e-6
        )


@settings(max_examples=5, deadline=None)
@given(st.floats(-20, 20), st.floats(-20, 20), st.floats(5.5, 30))
def test_a_body_is_seen_as_by_random_directions(x, y, z):
    rng = np.random.default_rng(7)
    points = np.concatenate([BOX, rng.uniform(-3, 4, (10, 3))])
    expected, error = looked_at(points, np.array([x, y, z]), 40_000, rng)
    found = projected_solid_angle(points, np.array([x]), np.array([y]), z)[0]
    assert abs(found - expected) <= 5 * error + 1e-3


@pytest.mark.parametrize(
    "target",
    [
        {"target.distance": 40.0, "target.half_width": [60.0, 45.0], "target.pixels": [14, 9]},
        {"target.distance": float("inf"), "target.half_width": [60.0, 45.0], "target.pixels": [14, 9]},
    ],
)
def test_no_point_of_a_pixel_sees_more(problem_file, target):
    """Random points of every pixel; the far field is seen from 10^7 mm."""
    system = OpticalSystem(load_problem(problem_file(GLOWING | target)))
    screen, points, rng = system.target.screen(), envelope(system), np.random.default_rng(0)
    bound = pixel_etendue(system) / screen.pixel_area
    x, y = np.meshgrid(*screen.centres)
    for _ in range(20):
        at = [c + p * rng.uniform(-0.5, 0.5, c.shape) for c, p in zip((x, y), screen.pitch)]
        if screen.angular:
            z = 1e7
            a, b = (np.tan(np.radians(u)) for u in at)
            seen = projected_solid_angle(points, (z * a).ravel(), (z * b).ravel(), z).reshape(x.shape)
            # mm^2 sr of a square degree: P dA over du dv
            seen *= z**2 * (1 + a * a) * (1 + b * b) * (pi / 180) ** 2
        else:
            seen = projected_solid_angle(points, at[0].ravel(), at[1].ravel(), system.target.z).reshape(
                x.shape
            )
        assert (seen <= bound).all()
    assert bound.max() < (1.2 if screen.angular else 4) * seen.max()  # near pixels are 5 mm wide


def test_the_envelope_holds_lenses_of_all_shapes(problem_file):
    """Points of front, rear and the edges between their rims, at both ends of z_freedom."""
    free = {"lens.rear.freeform.z_freedom": 3.0}
    system = OpticalSystem(load_problem(problem_file(GLOWING | free)))
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


def test_the_envelope_of_an_example_is_its_two_surfaces_with_their_freedom():
    system = OpticalSystem(load_problem(ROOT / "examples" / "extended_two.toml"))
    points = envelope(system)
    # the front reaches -5 mm at its corners and is free by 1 mm, the rear 5 mm and 1.5 mm
    np.testing.assert_allclose(points.min(axis=0), [-8, -8, -6])
    np.testing.assert_allclose(points.max(axis=0), [8, 8, 6.5])
