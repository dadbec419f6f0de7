"""Lenses as other programs write them: found with the right surfaces, outline and volume, or refused for the
reason that is true of them."""

import re
from dataclasses import replace
from itertools import product

import build123d as bd
import numpy as np
import pytest
from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert

from tests.cases import slow_unless
from tests.thbcad.cad.foreign.cases import Meridian, RoundLens
from tests.thbcad.io.cases import written
from thbcad import read_lens_solid

FLAT = Meridian()
BICONVEX = RoundLens(Meridian(40.0), Meridian(-60.0), 6.0, 10.0)
PLANO_CONVEX = RoundLens(FLAT, Meridian(-60.0), 4.0, 10.0)
PLANO_CONCAVE = RoundLens(Meridian(-40.0), FLAT, 2.0, 10.0)
BICONCAVE = RoundLens(Meridian(-40.0), Meridian(60.0), 2.0, 10.0)
MENISCUS = RoundLens(Meridian(30.0), Meridian(45.0), 3.0, 10.0)
PARABOLIC = RoundLens(Meridian(30.0, -1.0), FLAT, 4.0, 8.0)
EVEN = RoundLens(Meridian(30.0, -1.0, (1e-5, -2e-8)), FLAT, 5.0, 8.0)  # a polynomial in r
ASPHERIC = RoundLens(FLAT, Meridian(-25.0, -0.6, (2e-6, 3e-9, -1e-11)), 6.0, 9.0)
BIASPHERIC = RoundLens(EVEN.front, ASPHERIC.rear, 7.0, 8.0)
HYPERBOLIC = RoundLens(Meridian(20.0, -2.5), Meridian(-90.0), 6.0, 8.0)
CHAMFERED = replace(BICONVEX, wall=((10.4, 1.671), (10.4, 4.76)))
FLANGED = replace(PLANO_CONVEX, wall=((10.0, 1.0), (13.0, 1.0), (13.0, 2.0), (10.0, 2.0)))
STEPPED = replace(BIASPHERIC, wall=((9.5, 1.5), (9.5, 4.0), (8.4, 4.0)))
LENSES = {
    "biconvex": BICONVEX,
    "plano-convex": PLANO_CONVEX,
    "plano-concave": PLANO_CONCAVE,
    "biconcave": BICONCAVE,
    "meniscus": MENISCUS,
    "parabola": PARABOLIC,
    "even asphere": EVEN,
    "asphere": ASPHERIC,
    "two aspheres": BIASPHERIC,
    "hyperbola": HYPERBOLIC,
    "chamfered": CHAMFERED,
    "flanged": FLANGED,
    "stepped": STEPPED,
}
PARTS = {"one face": (1, 0.0), "a seam turned": (1, 37.0), "halves": (2, 0.0), "quarters turned": (4, 20.0)}


def require_lens(path, lens, tolerance=1e-6):
    """A file must hold a round lens: its surfaces, outline and volumes, by formulas; return the refit."""
    found = read_lens_solid(path)
    refit = found.refit(1.5, tolerance)
    assert found.thickness == pytest.approx(lens.thickness, abs=1e-8 * lens.radius)
    # a spline through points of a meridian is off it by 1e-10 of the volume
    assert refit.solid_volume == pytest.approx(lens.solid_volume, rel=1e-9)
    assert refit.volume == pytest.approx(lens.volume, rel=1e-7)
    for name, deviation in zip(("front", "rear"), refit.deviation):
        made = getattr(refit.lens, name)
        assert made.outline.is_circle
        assert made.half_width[0] == pytest.approx(lens.radius, rel=1e-8)
        r = np.linspace(0, lens.radius * (1 - 1e-9), 41)
        for turn in (0.0, 0.3, 2.0, 4.1):
            apart = made(r * np.cos(turn), r * np.sin(turn)) - getattr(lens, name)(r)
            assert np.abs(apart).max() <= 1.5 * deviation + 1e-9 * lens.radius
    return refit


def is_one_each(case):
    """Whether it is the one case of a lens that is run often, each lens in another number of faces."""
    name, parts = case
    return [*LENSES].index(name) % len(PARTS) == [*PARTS].index(parts)


@pytest.mark.parametrize("case", slow_unless(is_one_each, product(LENSES, PARTS)))
def test_a_revolved_lens_is_read_in_however_many_faces_it_comes(tmp_path, case):
    name, parts = case
    lens = LENSES[name]
    refit = require_lens(written(lens.solid(*PARTS[parts]).wrapped, tmp_path / "lens.step"), lens)
    spheres = all(not m.terms and m.constant in (0.0, -1.0) for m in (lens.front, lens.rear))
    assert ("fitted spline" in refit.how) == (not spheres)
    assert ("outside the outline" in repr(refit)) == bool(lens.wall)


@pytest.mark.parametrize(
    ("unit", "size"), [("INCH", 25.4), pytest.param("M", 1000.0, marks=pytest.mark.slow)]
)
def test_units_scale_a_lens_of_halves(tmp_path, unit, size):
    solid = ASPHERIC.scaled(1 / 4).solid(2)
    require_lens(written(solid.wrapped, tmp_path / "lens.step", unit), ASPHERIC.scaled(size / 4), 1e-6 * size)


def test_a_unit_edited_in_the_text_scales_a_lens(tmp_path):
    path = written(BICONVEX.solid(2).wrapped, tmp_path / "lens.step")
    text, count = re.subn(r"SI_UNIT\(\.MILLI\.,\.METRE\.\)", "SI_UNIT(.CENTI.,.METRE.)", path.read_text())
    assert count
    path.write_text(text)
    require_lens(path, BICONVEX.scaled(10.0))


PLACES = {
    "tilted": bd.Pos(3, -4, 5) * bd.Rot(20, 35, 50),
    "far away": bd.Pos(400, 300, -200) * bd.Rot(10, 0, 0),
    "along x": bd.Rot(0, 90, 0),
}


@pytest.mark.parametrize(
    "case",
    slow_unless(
        {("biconvex", "along x"), ("two aspheres", "tilted"), ("flanged", "far away")}.__contains__,
        product(("biconvex", "two aspheres", "flanged"), PLACES),
    ),
)
def test_a_placed_lens_of_halves_is_read(tmp_path, case):
    name, place = case
    solid = PLACES[place] * LENSES[name].solid(2, 10.0)
    require_lens(written(solid.wrapped, tmp_path / "lens.step"), LENSES[name])


@pytest.mark.parametrize("name", ["meniscus", "two aspheres"])
def test_a_mirrored_lens_has_its_other_side_in_front(tmp_path, name):
    solid = bd.mirror(LENSES[name].solid(2), bd.Plane.XY)
    require_lens(written(solid.wrapped, tmp_path / "lens.step"), LENSES[name].turned())


@pytest.mark.parametrize("name", ["meniscus", "two aspheres"])
def test_a_turned_record_has_front_and_rear_exchanged(tmp_path, name):
    lens, path = LENSES[name], tmp_path / "lens.step"
    found = read_lens_solid(written((bd.Pos(1, 2, 3) * lens.solid()).wrapped, path)).turned()
    other = lens.turned()
    assert found.frame.shift == pytest.approx((1, 2, 3 + lens.thickness), abs=1e-9)
    assert np.linalg.det(found.frame.rotation) == pytest.approx(1)
    made = found.refit(1.5).lens
    r = np.linspace(0, 7.9, 21)
    assert made.front(r, 0 * r) == pytest.approx(other.front(r), abs=1e-6)
    assert made.rear(0 * r, r) == pytest.approx(other.rear(r), abs=1e-6)
    assert made.thickness == pytest.approx(lens.thickness, abs=1e-8)


def test_a_lens_in_nested_assemblies_is_read(tmp_path):
    inner = bd.Compound(label="cell", children=[bd.Rot(15, 0, 0) * EVEN.solid(2)])
    outer = bd.Compound(label="mount", children=[bd.Pos(5, 6, 7) * inner])
    bd.export_step(bd.Pos(-1, 0, 2) * bd.Compound(label="all", children=[outer]), tmp_path / "lens.step")
    require_lens(tmp_path / "lens.step", EVEN)


def test_a_lens_united_with_a_barrel_is_read(tmp_path):
    """The barrel ends 2 mm before the front's vertex and 1 mm behind the rear's."""
    tube = bd.Pos(0, 0, 2.5) * (bd.Cylinder(12, 9) - bd.Cylinder(10, 9))
    solid = (BICONVEX.solid() + tube).solids()[0]
    lens = replace(BICONVEX, wall=((10.0, -2.0), (12.0, -2.0), (12.0, 7.0), (10.0, 7.0)))
    require_lens(written(solid.wrapped, tmp_path / "lens.step"), lens)


@pytest.mark.parametrize("name", slow_unless("asphere".__eq__, ["biconvex", "even asphere", "asphere"]))
def test_a_lens_of_rational_splines_is_read(tmp_path, name):
    """All surfaces as NURBS, as some exporters write them."""
    shape = BRepBuilderAPI_NurbsConvert(LENSES[name].solid(2).wrapped, True).Shape()
    require_lens(written(shape, tmp_path / "lens.step"), LENSES[name])
