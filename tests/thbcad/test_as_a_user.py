"""Ten jobs of a spline researcher, by the public names alone, each checked by independent code."""

import json
from itertools import chain

import numpy as np
import pytest
from scipy import interpolate as sp

import thbcad as tc
from oracles.spline_definitions import DefinitionTHB
from tests.cases import DATA

RNG = np.random.default_rng(0)
ANNULUS = json.loads((DATA / "thb_annulus.json").read_text("utf-8"))
KV = tc.KnotVector.uniform(degree=3, spans=7)
U, V = RNG.uniform(size=(2, 500))


def test_knots_are_inserted_as_scipy_does():
    coefficients, new = RNG.normal(size=(KV.dim, 3)), [0.15, 0.15, 0.5, 6 / 7]
    finer = KV.insert(new)
    twin = sp.BSpline(KV.knots, coefficients, 3)
    for knot in new:
        twin = twin.insert_knot(knot)
    assert finer.knots == pytest.approx(twin.t[: len(finer.knots)], abs=0)
    assert KV.prolongation(finer) @ coefficients == pytest.approx(twin.c[: finer.dim], abs=1e-14)


def test_a_space_is_refined_along_an_annulus():
    """Dimensions and values on which four other codes agree."""
    space = tc.THBSpace(KV, KV)
    for level, cells in enumerate(ANNULUS["marked"]):
        assert space.dim == ANNULUS["dof_after_step"][level]
        space = space.refine([(level, i, j) for i, j in cells])
    level, i, j = space.functions.T
    net = np.sin(1.3 * i + 2.1 * j + 0.7 * level) + 0.3 * np.cos(0.37 * i * j + level)
    u, v = np.array(ANNULUS["points"]).T
    assert tc.THBSurface(space, net)(u, v) == pytest.approx(np.array(ANNULUS["value"]), abs=1e-12)
    points = tc.THBSurface(space, space.greville())
    assert points(u, v) == pytest.approx(np.stack([u, v], axis=1), abs=1e-14)


def test_truncation_takes_from_a_coarse_function_its_share_of_fine_ones():
    space = tc.THBSpace(KV, KV).refine_box(1, (0, 4 / 7), (0, 4 / 7))
    knots = [KV.knots, KV.bisect().knots]
    by = [[sp.BSpline.design_matrix(x, t, 3).toarray() for t in knots] for x in (U, V)]
    share = np.linalg.lstsq(
        *(sp.BSpline.design_matrix(np.linspace(0, 1, 99), t, 3).toarray() for t in knots[::-1])
    )[0]
    fine = space.functions[space.functions[:, 0] == 1, 1:]
    for f in range(0, space.dim - len(fine), 7):
        _, i, j = space.functions[f]
        wanted = by[0][0][:, i] * by[1][0][:, j]
        wanted = wanted - sum(share[a, i] * share[b, j] * by[0][1][:, a] * by[1][1][:, b] for a, b in fine)
        assert space.collocation(U, V)[:, [f]].toarray().ravel() == pytest.approx(wanted, abs=1e-13)
    assert space.collocation(U, V).sum(axis=1) == pytest.approx(1, abs=1e-14)


def test_a_restriction_finds_the_coarse_coefficients_and_changes_nothing_far_away():
    coarse = tc.THBSpace(KV, KV)
    fine = coarse.refine_box(2, (0.5, 1), (0.5, 1))
    net = RNG.normal(size=coarse.dim)
    back = fine.restriction(coarse)
    assert back @ (coarse.prolongation(fine) @ net) == pytest.approx(net, abs=1e-12)
    bump = np.where(fine.functions[:, 0] == 2, 1.0, 0.0)
    far = (U < 1 / 7) & (V < 1 / 7)
    assert (coarse.collocation(U, V) @ (back @ bump))[far] == pytest.approx(0, abs=1e-15)
    samples = coarse.collocation(U, V).toarray()
    assert np.linalg.lstsq(samples, samples @ net)[0] == pytest.approx(net, abs=1e-9)


def test_derivatives_are_those_of_scipy_and_of_the_polynomial():
    space = tc.THBSpace(KV, KV).refine_box(3, (0.2, 0.3), (0.6, 0.9))
    cubic = tc.quasi_interpolate(space, lambda u, v: u**3 * v**2)
    assert cubic(U, V, (2, 1)) == pytest.approx(12 * U * V, abs=1e-10)
    surface = tc.THBSurface(space, RNG.normal(size=space.dim))
    flat = surface.to_bspline()
    twin = sp.NdBSpline((flat.kv_u.knots, flat.kv_v.knots), flat.coefficients, 3)
    for order in ((0, 0), (1, 0), (0, 1), (1, 2)):
        wanted = twin(np.stack([U, V], axis=1), nu=order)
        assert surface(U, V, order) == pytest.approx(wanted, abs=1e-12 * abs(wanted).max())


def test_conversions_are_the_same_surface():
    space = tc.THBSpace(KV, KV).refine_box(2, (0, 0.3), (0.4, 1))
    surface = tc.THBSurface(space, RNG.normal(size=(space.dim, 3)))
    pieces = [surface.to_bspline()], surface.to_patches(), surface.to_faces(price=5)
    assert [len(kind) for kind in pieces] == [1, 5, 2]
    for piece in chain(*pieces):
        u = piece.kv_u.start + (piece.kv_u.stop - piece.kv_u.start) * U
        v = piece.kv_v.start + (piece.kv_v.stop - piece.kv_v.start) * V
        twin = sp.NdBSpline((piece.kv_u.knots, piece.kv_v.knots), piece.coefficients, 3)
        assert surface(u, v) == pytest.approx(twin(np.stack([u, v], axis=1)), abs=1e-12)


def test_closed_curves_and_tubes_are_smooth_across_the_seam():
    kv = tc.KnotVector.periodic(degree=3, breaks=np.arange(13.0))
    points, u = RNG.normal(size=(12, 2)), np.arange(12.0)
    net = np.linalg.solve((kv.collocation(u) @ kv.wrapping()).toarray(), points)
    curve = tc.BSplineCurve(kv, kv.wrapping() @ net)
    twin = sp.make_interp_spline(np.arange(13), [*points, points[0]], 3, bc_type="periodic")
    assert curve(12 * U) == pytest.approx(twin(12 * U), abs=1e-12)
    space = tc.THBSpace(kv, KV).refine_box(1, (-np.inf, np.inf), (2 / 7, 6 / 7))
    tube = tc.THBSurface(space, space.wrapping() @ RNG.normal(size=(space.wrapping().shape[1], 3)))
    for order in ((0, 0), (1, 0), (2, 0)):
        assert tube(np.full(500, 12.0), V, order) == pytest.approx(tube(np.zeros(500), V, order), abs=1e-11)
    assert tube.space.dim > len(space.wrapping().T @ np.ones(space.dim)) > 12 * KV.dim


@pytest.mark.slow
def test_50_000_scattered_points_are_fitted_to_a_tolerance():
    u, v = np.random.default_rng(1).uniform(size=(2, 50_000))

    def hill(u, v):
        return np.exp(-200 * ((u - 0.3) ** 2 + (v - 0.6) ** 2)) + u * v

    found = tc.fit(tc.THBSpace(KV, KV), tc.Samples(u, v, hill(u, v)), 1e-3)
    assert found.outcome == "reached"
    assert abs(found.surface(U, V) - hill(U, V)).max() <= 1e-3
    knots = KV.bisect().bisect().breaks[1:-1]
    twin = sp.LSQBivariateSpline(u, v, hill(u, v), knots, knots)
    assert found.surface.space.dim < len(twin.get_coeffs())


def test_files_hold_every_bit_in_plain_numbers(tmp_path):
    space = tc.THBSpace(KV, KV).refine_box(2, (0, 0.3), (0.4, 1))
    surface = tc.THBSurface(space, RNG.normal(size=(space.dim, 3)))
    tc.write_surface(surface, tmp_path / "surface.json")
    assert tc.read_surface(tmp_path / "surface.json")(U, V).tobytes() == surface(U, V).tobytes()
    data = json.loads((tmp_path / "surface.json").read_text("utf-8"))
    twin = DefinitionTHB(KV, KV, [set(map(tuple, cells)) for cells in data["refined"]])
    net = np.reshape(data["coefficients"], data["shape"])
    assert twin.collocation(U, V) @ net == pytest.approx(surface(U, V), abs=1e-13)


def test_a_parametric_surface_is_the_torus_it_was_taken_from():
    """Its area is 4 pi^2 R r; the NURBS surface is the torus itself."""

    def torus(u, v):
        a, b = 2 * np.pi * u, 2 * np.pi * v
        return np.stack([(3 + np.cos(a)) * np.cos(b), (3 + np.cos(a)) * np.sin(b), np.sin(a)], axis=1)

    kv = tc.KnotVector.uniform(degree=5, spans=24)
    surface = tc.quasi_interpolate(tc.THBSpace(kv, kv), torus)
    assert abs(surface(U, V) - torus(U, V)).max() <= (2 * np.pi / 24) ** 6
    u, v, weights, _ = surface.space.quadrature()
    normals = np.cross(surface(u, v, (1, 0)), surface(u, v, (0, 1)))
    assert weights @ np.linalg.norm(normals, axis=1) == pytest.approx(12 * np.pi**2, rel=1e-5)
    x, y, z = tc.revolved(tc.circular_arc(1.0, centre=(3, 0)))(U, V).T
    assert (np.hypot(x, y) - 3) ** 2 + z**2 == pytest.approx(1, abs=1e-14)
