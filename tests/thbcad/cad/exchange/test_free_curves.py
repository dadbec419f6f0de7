"""Curves as edges of no face in STEP, IGES and BREP: round trips, other programs, limits."""

import re

import build123d as bd
import numpy as np
import pytest
from hypothesis import HealthCheck, given, strategies as st
from OCP.BRepAdaptor import BRepAdaptor_Curve

from tests.cases import examples
from tests.thbcad.cad.exchange.cases import CUBIC, CURVES, TWISTED, WAVE, assert_same
from tests.thbcad.cases import random_knot_vector, seeds
from thbcad.cad.exchange.loose_splines import read_curves, write_curves, write_faces
from thbcad.splines import KnotVector, NURBSCurve, circular_arc


def test_every_number_of_many_curves_reads_back_in_order(kind, tmp_path):
    """Closed, kinked, straight, rational and polynomial curves in one file."""
    write_curves(list(CURVES.values()), tmp_path / f"all{kind}")
    assert_same(read_curves(tmp_path / f"all{kind}"), list(CURVES.values()))


@examples(20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seeds(), st.integers(1, 10), st.sampled_from([1.0, 1e-3, 1e3]))
def test_every_number_of_random_curves_reads_back(kind, tmp_path, rng, degree, size):
    kv = random_knot_vector(rng, degree, max_spans=5)
    curve = NURBSCurve(kv, size * rng.uniform(-1, 1, (kv.dim, 3)), rng.uniform(0.1, 10, kv.dim))
    write_curves(curve, tmp_path / f"random{kind}")
    assert_same(read_curves(tmp_path / f"random{kind}"), [curve])


@pytest.mark.parametrize(("gap", "closes"), [(9e-9, True), (5e-8, False)])
def test_nearly_closed_curves_come_back_closed_in_step(kind, gap, closes, tmp_path):
    """OCCT makes them periodic: the last point moves by the gap."""
    points = np.concatenate([TWISTED[:-1], TWISTED[:1] + np.array([0, gap, 0])])
    write_curves(NURBSCurve(CUBIC, points), tmp_path / f"near{kind}")
    (read,) = read_curves(tmp_path / f"near{kind}")
    assert (read.coefficients[:-1] == points[:-1]).all()
    assert (read.coefficients[-1] == points[0 if closes and kind == ".step" else -1]).all()


def edges():
    spline = bd.Edge.make_spline([(0, 0, 0), (1, 1, 0), (2, 0, 1)])
    ring = bd.Edge.make_spline([(0, 0, 0), (1, 1, 0), (2, 0, 1)], periodic=True)
    return {
        "line": bd.Edge.make_line((0, 0, 0), (1, 2, 3)),
        "bezier": bd.Edge.make_bezier((0, 0, 0), (1, 1, 0), (2, 0, 1)),
        "piece": spline.trim(0.2, 0.7),
        "periodic": ring,
        "piece of a periodic": ring.trim(0.6, 0.9),
        "moved": bd.Pos(1, 2, 3) * spline,
    }


def test_curves_of_other_programs_have_the_points_that_occt_finds(tmp_path):
    """Numbers up to 10 after a few operations."""
    bd.export_brep(bd.Compound(list(edges().values())), tmp_path / "edges.brep")
    for edge, curve in zip(edges().values(), read_curves(tmp_path / "edges.brep"), strict=True):
        occt = BRepAdaptor_Curve(edge.wrapped)
        t = np.linspace(0, 1, 9)
        here, there = (
            a + t * (b - a)
            for a, b in ((curve.kv.start, curve.kv.stop), (occt.FirstParameter(), occt.LastParameter()))
        )
        assert abs(curve(here) - [occt.Value(x).Coord() for x in there]).max() < 100 * np.finfo(float).eps


@pytest.mark.parametrize("kind", [".step", ".brep"])
def test_conics_of_other_programs_are_exact(kind, tmp_path):
    circle, ellipse = bd.Edge.make_circle(2, start_angle=30, end_angle=250), bd.Edge.make_ellipse(3, 1)
    path = tmp_path / f"conics{kind}"
    (bd.export_step if kind == ".step" else bd.export_brep)(bd.Compound([circle, ellipse]), path)
    for curve, (a, b) in zip(read_curves(path), ((2, 2), (3, 1)), strict=True):
        x, y, _ = curve(np.linspace(curve.kv.start, curve.kv.stop, 33)).T
        assert abs(np.hypot(x / a, y / b) - 1).max() < 10 * np.finfo(float).eps


def test_edges_of_faces_are_no_curves(kind, tmp_path):
    write_faces(WAVE, tmp_path / f"wave{kind}")
    with pytest.raises(ValueError, match=re.escape(f"wave{kind} holds no free edges")):
        read_curves(tmp_path / f"wave{kind}")


@pytest.mark.parametrize(
    ("name", "curves", "message"),
    [
        ("a.stl", CURVES["line"], "a.stl must end in .step, .stp, .iges, .igs or .brep"),
        ("a.step", [], "curves must hold at least one curve"),
        (
            "a.step",
            [CURVES["line"], WAVE],
            r"curves\[1\] must be a BSplineCurve or NURBSCurve, got BSplineSurface",
        ),
        (
            "a.step",
            circular_arc(1.0),
            r"curves\[0\] must have points \(x, y, z\), got a net of shape \(7, 2\)",
        ),
        (
            "a.igs",
            NURBSCurve(CUBIC, TWISTED, [1, 1e-10, 1, 1, 1, 1]),
            r"curves\[0\] must have weights of at least 1e-09 in IGES, got 1e-10",
        ),
        (
            "a.igs",
            NURBSCurve(KnotVector(3, [0] * 4 + [1e-10] + [1] * 4), TWISTED[:5]),
            r"curves\[0\] must have knots at least 1e-09 apart in IGES, got a span of 1e-10",
        ),
    ],
)
def test_curves_are_refused(name, curves, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        write_curves(curves, tmp_path / name)
    assert list(tmp_path.iterdir()) == []
