"""The native files of surfaces and curves: bit-identical round trips of every kind, and refusals."""

import json

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.thbcad.cases import AWKWARD, coefficients, knot_vectors, spaces
from thbcad import BSplineSurface, KnotVector, THBSpace, THBSurface
from thbcad.io.spline_json import (
    curve_from_dict,
    curve_to_dict,
    read_curve,
    read_surface,
    surface_from_dict,
    surface_to_dict,
    write_curve,
    write_surface,
)
from thbcad.splines import BSplineCurve, NURBSCurve, NURBSSurface, circular_arc


def same_bits(a, b):
    return a.shape == b.shape and a.tobytes() == b.tobytes()


def small():
    kv = KnotVector.uniform(2, 3)
    return THBSurface(THBSpace(kv, kv).refine({0: [(0, 0), (0, 1), (1, 0), (1, 1)]}), np.resize(AWKWARD, 37))


@given(st.data(), st.sampled_from([(), (1,), (3,)]))
def test_thb_round_trip(data, components):
    space = data.draw(spaces(scales=(1.0, 0.1)))
    surface = THBSurface(space, data.draw(coefficients(space.dim, *components)))
    again = surface_from_dict(json.loads(json.dumps(surface_to_dict(surface))))
    assert same_bits(again.coefficients, surface.coefficients)
    assert same_bits(again.space.kv_u.knots, space.kv_u.knots)
    assert same_bits(again.space.cells, space.cells)


@given(knot_vectors(max_degree=4), knot_vectors(max_degree=4), st.data())
def test_tensor_product_round_trips(kv_u, kv_v, data):
    net = data.draw(coefficients(kv_u.dim, kv_v.dim, 3))
    weights = 1.5 + data.draw(coefficients(kv_u.dim, kv_v.dim))
    for surface in (
        BSplineSurface(kv_u, kv_v, net),
        BSplineSurface(kv_u, kv_v, net[..., 0]),
        NURBSSurface(kv_u, kv_v, net, weights),
    ):
        again = surface_from_dict(json.loads(json.dumps(surface_to_dict(surface))))
        assert type(again) is type(surface)
        assert same_bits(again.kv_v.knots, kv_v.knots)
        assert same_bits(again.coefficients, surface.coefficients)
        if isinstance(surface, NURBSSurface):
            assert same_bits(again.weights, surface.weights)


@given(knot_vectors(), st.data(), st.sampled_from([1, 2, 3]))
def test_curve_round_trip(kv, data, dimensions):
    net = data.draw(coefficients(kv.dim, dimensions))
    for curve in (NURBSCurve(kv, net, 1.5 + data.draw(coefficients(kv.dim))), BSplineCurve(kv, net)):
        again = curve_from_dict(json.loads(json.dumps(curve_to_dict(curve))))
        assert type(again) is type(curve)
        assert same_bits(again.kv.knots, kv.knots)
        assert same_bits(again.net, curve.net)


def test_a_curve_through_a_file(tmp_path):
    write_curve(circular_arc(2.0), tmp_path / "c.json")
    assert same_bits(read_curve(tmp_path / "c.json").coefficients, circular_arc(2.0).coefficients)
    with pytest.raises(ValueError, match="not a surface file: its schema is not 'thbcad-surface'"):
        read_surface(tmp_path / "c.json")
    write_surface(small(), tmp_path / "s.json")
    with pytest.raises(ValueError, match="not a curve file: its schema is not 'thbcad-curve'"):
        read_curve(tmp_path / "s.json")
    with pytest.raises(ValueError, match="curve must be a BSplineCurve or NURBSCurve, got THBSurface"):
        write_curve(small(), tmp_path / "s.json")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"version": 2}, "curve file version 2 is unknown, this program reads version 1"),
        ({"kind": "thb"}, "the curve file's kind must be 'bspline' or 'nurbs', got 'thb'"),
        ({"colour": "red"}, "the curve file has the unknown key 'colour'"),
        ({"degree": 2.0}, "degree must be an integer"),
        ({"knots": [0, 0, "1", 1]}, "the file's knots must hold numbers only"),
        ({"shape": [7, 3]}, r"the file's coefficients are 14 numbers, which is not the shape \[7, 3\]"),
        ({"weights": [1.0]}, r"weights must be one number or have shape \(7,\), got \(1,\)"),
    ],
)
def test_other_curves_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        curve_from_dict(curve_to_dict(circular_arc(1.0)) | change)


@pytest.mark.parametrize("key", ["kind", "degree", "knots", "shape", "coefficients", "weights"])
def test_missing_keys_of_curves_are_named(key):
    data = curve_to_dict(circular_arc(1.0))
    del data[key]
    with pytest.raises(ValueError, match=f"the curve file lacks the key '{key}'"):
        curve_from_dict(data)


def test_through_a_file(tmp_path):
    surface = small()
    write_surface(surface, tmp_path / "s.json")
    again = read_surface(tmp_path / "s.json")
    assert same_bits(again.coefficients, surface.coefficients)
    assert [p.name for p in tmp_path.iterdir()] == ["s.json"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema": "thbcad-lens"}, "not a surface file: its schema is not 'thbcad-surface'"),
        ({"version": 2}, "surface file version 2 is unknown, this program reads version 1"),
        ({"version": True}, "surface file version True is unknown"),
        ({"version": 1.0}, "surface file version 1.0 is unknown"),
        ({"kind": "mesh"}, "the surface file's kind must be 'thb', 'bspline' or 'nurbs', got 'mesh'"),
        ({"kind": None}, "the surface file's kind must be"),
        ({"shape": [38]}, r"the file's coefficients are 37 numbers, which is not the shape \[38\]"),
        ({"shape": [37.0]}, "which is not the shape"),
        ({"shape": [-37, -1]}, "which is not the shape"),
        ({"shape": 37}, "the file's shape must be a list"),
        ({"coefficients": [0.0] * 36 + [True]}, "the file's coefficients must hold numbers only"),
        ({"degree": [2]}, "a surface has 2 degrees and 2 knot vectors, the file has 1 and 2"),
        ({"degree": [2, "2"]}, "degree must be an integer"),
        ({"refined": [[[0, 9]]]}, r"cell \(0, 9\) lies outside level 0"),
        ({"refined": [[[0, True]]]}, r"the file's refined must hold lists of cells \[i, j\] of integers"),
        ({"refined": [[[0, 1], [True, 0]]]}, "lists of cells"),
        ({"refined": [[True]]}, "lists of cells"),
        ({"refined": [None]}, "lists of cells"),
        ({"refined": {}}, "the file's refined must be a list"),
        ({"refined": []}, r"coefficients must have shape \(25,\) or \(25, d\), got \(37,\)"),
        ({"knots": [[0, 0, 0, 1, 1, 1], [0, 0, 0, np.inf]]}, "finite|numbers"),
    ],
)
def test_other_content_is_refused(change, message):
    data = json.loads(json.dumps(surface_to_dict(small()) | change))
    with pytest.raises(ValueError, match=message):
        surface_from_dict(data)


@pytest.mark.parametrize(
    "key", ["schema", "version", "kind", "degree", "knots", "refined", "shape", "coefficients"]
)
def test_missing_keys_are_named(key):
    data = surface_to_dict(small())
    del data[key]
    with pytest.raises(ValueError, match=f"lacks the key '{key}'|not a surface file|version None is unknown"):
        surface_from_dict(data)


def test_sizes_are_checked_before_memory_is_taken(tmp_path):
    data = surface_to_dict(small())
    row = [0.0, 0.0, *np.linspace(0, 1, 2001).tolist(), 1.0, 1.0]
    data |= {"knots": [row, row], "degree": [2, 2], "refined": []}
    (tmp_path / "s.json").write_text(json.dumps(data))
    with pytest.raises(ValueError, match="2000 x 2000 cells on level 0, more than 1000000"):
        read_surface(tmp_path / "s.json")


@pytest.mark.parametrize("content", ["", "{", "[]", "[" * 100_000])
def test_damaged_files_are_refused(tmp_path, content):
    (tmp_path / "s.json").write_text(content)
    with pytest.raises(ValueError, match="not a surface file"):
        read_surface(tmp_path / "s.json")
