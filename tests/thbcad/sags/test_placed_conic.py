"""Conics as CAD files hold them: patches, sections and parameters lie on the conic, and are recognised."""

import numpy as np
import pytest
from hypothesis import assume, example, given, strategies as st

from thbcad.sags import (
    NOT_BOUNDED,
    Conic,
    PlacedConic,
    conic_of_patch,
    conic_of_plane,
    conic_of_sphere,
    rectangle_around,
)
from thbcad.splines import NURBSSurface

ROUNDING = 1e-12  # of the size: some operations on numbers up to a thousand half-widths
SIDES = [(axis, sign) for axis in (0, 1) for sign in (-1, 1)]


CONSTANTS = st.floats(-6, 3)


@st.composite
def placed_conics(draw, constants=CONSTANTS):
    """A conic of an exact form over a rectangle of 1 to 20 mm, radii from nearly a hemisphere to 300 mm."""
    half_width = draw(st.tuples(*[st.floats(1, 20)] * 2))
    constant = draw(constants)
    least = 1.02 * np.hypot(*half_width) * np.sqrt(max(1 + constant, 0.01))
    radius = draw(st.sampled_from([-1, 1])) * draw(st.floats(least, max(300, least)))
    conic = PlacedConic(Conic(radius, constant), draw(st.floats(-20, 20)), half_width)
    assume(conic.exact)
    return conic


@given(placed_conics())
@example(PlacedConic(Conic(30.0, 0.0), 5.0, (20.0, 20.0)))
@example(PlacedConic(Conic(-40.0, 0.8), 0.0, (9.0, 8.0)))
@example(PlacedConic(Conic(12.0, -4.0), 0.0, (9.0, 8.0)))
def test_sections_run_along_the_rims(conic):
    """In their plane, on the conic, from side to side, at increasing x or y."""
    size = ROUNDING * (abs(conic.centre) + 20)
    for axis, sign in SIDES:
        offset = sign * conic.half_width[1 - axis]
        section = conic.section(axis, offset)
        points = section.points(np.linspace(*section.ends, 33))
        assert abs(points[:, 1 - axis] - offset).max() <= size
        x, y = (np.clip(points[:, k], -h, h) for k, h in enumerate(conic.half_width))
        slope = 1 / np.sqrt(1 - (1 + conic.conic.constant) * ((x**2 + y**2) / conic.conic.radius**2).max())
        assert abs(points[:, 2] - conic(x, y)).max() <= size * max(slope.max(), 1)
        ends = points[[0, -1], axis] / conic.half_width[axis]
        np.testing.assert_allclose(ends, [-1, 1], rtol=0, atol=size)
        assert (np.diff(points[:, axis]) > 0).all()


@given(placed_conics(), st.integers(0, 2**32 - 1))
def test_the_parameters_of_points_lead_to_them(conic, seed):
    rng = np.random.default_rng(seed)
    x, y = (rng.uniform(-h, h, 50) for h in conic.half_width)
    points = np.column_stack([x, y, conic(x, y)])
    u, v = conic.parameters(points).T
    if conic.kind == "QUADRIC":
        patch = conic.patch
        assert patch.coefficients.shape == (3, 3, 3)
        assert patch.weights.min() > 0
        found = np.array([patch([a], [b])[0] for a, b in zip(u, v)])
    else:
        centre, axis, first = conic.sphere
        across = np.cos(u)[:, None] * first + np.sin(u)[:, None] * np.cross(axis, first)
        found = centre + abs(conic.conic.radius) * (np.cos(v)[:, None] * across + np.sin(v)[:, None] * axis)
        assert abs(v).max() < np.pi / 2
        assert abs(u - np.pi).max() < np.pi / 2
    assert abs(found - points).max() <= ROUNDING * (abs(conic.centre) + 20)


@given(placed_conics(st.one_of(st.floats(-6, -1.01), st.floats(-0.99, 3).filter(bool))))
def test_a_patch_is_recognised(conic):
    """K from differences of weights: what is lost there changes no height."""
    found = conic_of_patch(conic.patch, conic.half_width)
    x, y = np.meshgrid(*(np.linspace(-h, h, 9) for h in conic.half_width))
    assert abs(found(x, y) - conic(x, y)).max() <= 1e-12 * (abs(conic.vertex) + max(conic.half_width))
    assert (found.numbers == conic.numbers).all()


@pytest.mark.parametrize("number", range(27 + 9))
def test_a_patch_with_another_number_is_no_conic(number):
    """Every pole and weight counts to 1e-12; those on the axes of symmetry are zero."""
    patch = PlacedConic(Conic(-40.0, 0.8), 3.0, (9.0, 8.0)).patch
    rows = np.concatenate([patch.coefficients.ravel(), patch.weights.ravel()])
    rows[number] += 1e-9
    other = NURBSSurface(patch.kv_u, patch.kv_v, rows[:27].reshape(3, 3, 3), rows[27:].reshape(3, 3))
    assert conic_of_patch(other) is None


def test_spheres_and_planes_are_recognised():
    sphere = conic_of_sphere(np.array([[0, 0, 35.0], [0, 1, 0], [0, 0, -1]]), 30.0, True)
    assert (sphere.conic, sphere.vertex, sphere.kind) == (Conic(30.0, 0.0), 5.0, "SPHERE")
    above = conic_of_sphere(np.array([[0, 0, -25.0], [0, 1, 0], [0, 0, 1]]), 30.0, False)
    assert (above.conic, above.vertex) == (Conic(-30.0, 0.0), 5.0)
    plane = conic_of_plane(np.array([[7.0, 0, 5], [0, 0, -1], [0, 1, 0]]))
    assert (plane.conic.is_plane, plane.vertex, plane.kind) == (True, 5.0, "PLANE")
    assert conic_of_plane(np.array([[0, 0, 5], [0, 1e-9, 1], [1, 0, 0]])) is None
    assert conic_of_sphere(np.array([[1e-9, 0, 35.0], [0, 1, 0], [0, 0, -1]]), 30.0, True) is None


def test_rectangles_around_the_axis():
    corners = np.array([[x, y, 0.0] for x in (-3, 3) for y in (-2, 2)])
    assert rectangle_around(np.concatenate([corners, corners])) == (3, 2)
    for other in (corners[:3], corners + np.eye(3)[0], corners[:0], np.array([[3.0, 0, 0], [-3, 0, 0]])):
        assert rectangle_around(other) == NOT_BOUNDED


@pytest.mark.parametrize(
    ("radius", "constant", "half_width"),
    [
        (50.0, -1.0, (9.0, 8.0)),  # a paraboloid is a spline
        (1e6, 0.0, (9.0, 8.0)),  # the centre is far away
        (50.0, -1 - 1e-5, (9.0, 8.0)),
        (10.0, -40.0, (9.0, 8.0)),  # weights near zero
    ],
)
def test_what_no_file_would_hold_exactly_is_told(radius, constant, half_width):
    assert not PlacedConic(Conic(radius, constant), 0.0, half_width).exact
