"""STEP files: closed solids of six faces whose splines read back bit for bit."""

import re

import build123d
import numpy as np
import pytest
from hypothesis import example, given, strategies as st
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_BSplineCurve

from oracles.spline_definitions import flux_volume
from tests.cases import examples
from tests.thbcad.cad.shapes.cases import assert_whole
from tests.thbcad.cases import LENSES, assert_holds, bits, corner_sag
from thbcad import Product, write_step
from thbcad.cad import LensPart, join
from thbcad.cad.exchange.occt_texts import compact
from thbcad.cad.exchange.solid_file import solid_volume
from thbcad.cad.exchange.step import read_step
from thbcad.cad.shapes import lens_solid
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens, optical_forms, placed_surfaces
from thbcad.sags import Conic, PlacedConic
from thbcad.splines import BSplineSurface, KnotVector
from thbcad.surfaces import THBSurface


@pytest.fixture(scope="module", params=LENSES)
def written(request, tmp_path_factory):
    """(lens, path, what was read back), written once for each lens."""
    lens = LENSES[request.param]
    path = tmp_path_factory.mktemp("step") / f"{request.param}.step"
    write_step(lens, path)
    return lens, path, read_step(path)


# ---- every lens ----


def test_one_closed_solid_of_six_faces(written):
    _, _, read = written
    assert_whole(read, 6)


def test_poles_and_knots_read_back_bit_for_bit(written):
    lens, _, read = written
    assert_holds(read, lens)


def test_the_file_holds_the_surface_of_the_lens(written):
    """Points on the splines of the file against conic + sag in closed form: 1e-11 mm of interpolation, else
    rounding."""
    lens, _, read = written
    s = np.linspace(0, 1, 41)
    for surface, vertex, freeform in ((read.front, 0.0, lens.front), (read.rear, lens.thickness, lens.rear)):
        if isinstance(surface, PlacedConic):
            x, y = (h * (2 * s - 1) for h in freeform.half_width)
            assert surface.half_width == freeform.half_width
            assert abs(surface(x[:, None], y) - vertex - freeform.grid(x, y)).max() <= 1e-13
            continue
        u, v = (kv.start + (kv.stop - kv.start) * s for kv in (surface.kv_u, surface.kv_v))
        x, y, z = np.moveaxis(
            surface.grid(np.clip(u, None, surface.kv_u.stop), np.clip(v, None, surface.kv_v.stop)), -1, 0
        )
        a, b = freeform.half_width
        assert abs(x - a * (2 * s[:, None] - 1)).max() <= 1e-14 * a
        assert abs(y - b * (2 * s[None, :] - 1)).max() <= 1e-14 * b
        assert abs(z - vertex - freeform.grid(a * (2 * s - 1), b * (2 * s - 1))).max() <= 2e-11


def test_the_solid_is_oriented_before_any_reader_heals_it(written):
    """Readers turn faces round; the raw solid must have every normal outside: signed volume and face by
    face."""
    lens, _, _ = written
    solid = build123d.Solid(lens_solid(lens))
    assert solid.is_valid
    assert solid_volume(solid.wrapped, 1e-6) == pytest.approx(lens.volume(), rel=1e-6)
    outward = [(0, 0, -1), (0, 0, 1), (0, -1, 0), (1, 0, 0), (0, 1, 0), (-1, 0, 0)]
    for face, direction in zip(solid.faces(), outward, strict=True):
        assert np.dot(tuple(face.normal_at()), direction) > 0


def test_rims_are_the_boundary_rows_of_the_nets(written):
    """The rim curves of splines carry the very poles of the surfaces, four each."""
    lens, path, _ = written
    splines = [s for s in optical_forms(lens) if isinstance(s, BSplineSurface)]
    wanted = {
        bits(row + 0.0) for s in splines for c in [s.coefficients] for row in (c[0], c[-1], c[:, 0], c[:, -1])
    }
    found = set()
    for edge in build123d.import_step(path).edges():
        curve = BRep_Tool.Curve_s(edge.wrapped, 0.0, 1.0)
        if isinstance(curve, Geom_BSplineCurve) and curve.Degree() > 1:
            found.add(bits([curve.Pole(k).Coord() for k in range(1, curve.NbPoles() + 1)] + np.zeros(3)))
    assert len(wanted) == 4 * len(splines)
    assert found == wanted


def test_front_and_rear_share_their_relative_knots(written):
    """Knots at the same relative place are the same float64: the ruled faces hold no sliver spans."""
    lens, _, _ = written
    for a, b in zip(*([s.kv_u, s.kv_v] for s in placed_surfaces(lens))):
        assert (a.start, a.stop) == (b.start, b.stop)
        assert np.diff(np.unique(np.r_[a.knots, b.knots])).min() > 1e-6 * a.stop


def test_volume(written):
    """OCCT integrates to 1e-6; the closed form agrees with the flux through the faces to the conics' 1e-11
    mm."""
    lens, _, read = written
    assert read.volume == pytest.approx(lens.volume(), rel=1e-6)
    area = max(4 * h[0] * h[1] for h in (lens.front.half_width, lens.rear.half_width))
    assert lens.volume() == pytest.approx(flux_volume(lens), abs=2e-11 * area, rel=1e-12)


def test_build123d_reads_a_valid_solid_in_millimetres(written):
    lens, path, _ = written
    shape = build123d.import_step(path)
    assert len(shape.solids()) == 1
    assert shape.is_valid
    assert (len(shape.faces()), len(shape.edges()), len(shape.vertices())) == (6, 12, 8)
    # GProp's default quadrature is off by some 2.5e-4
    assert shape.volume == pytest.approx(lens.volume(), rel=1e-3)
    box = shape.bounding_box()
    low, high, size = (np.array(tuple(v)) for v in (box.min, box.max, box.size))
    widest = [2 * max(a, b) for a, b in zip(lens.front.half_width, lens.rear.half_width)]
    assert size[:2] == pytest.approx(widest, abs=1e-5)
    s = np.linspace(-1, 1, 201)
    z = [
        vertex + f.grid(s * f.half_width[0], s * f.half_width[1])
        for f, vertex in ((lens.front, 0), (lens.rear, lens.thickness))
    ]
    bottom, top = min(a.min() for a in z), max(a.max() for a in z)
    # the box holds the solid; OCCT may bound splines by their nets, which reach further than the surface
    assert low[2] <= bottom + 1e-6
    assert high[2] >= top - 1e-6
    assert size[2] <= 1.5 * (top - bottom)


def test_nothing_is_printed(tmp_path, capfd):
    path = tmp_path / "lens.step"
    write_step(LENSES["ruled"], path)
    read_step(path)
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(ValueError, match="not a readable STEP file"):
        read_step(path)
    captured = capfd.readouterr()
    assert captured.out == ""


def test_reals_are_the_shortest_texts_that_read_back(text):
    """Python's repr is the shortest by construction; ISO 10303-21 wants a point and an E."""
    reals = re.findall(r"(?<=[(,\n])-?\d+\.\d*(?:E-?\d+)?(?=[),])", text.split("DATA;")[1])
    assert len(reals) > 300
    for real in reals:
        mantissa, _, exponent = repr(float(real)).partition("e")
        mantissa = mantissa.removesuffix("0") if mantissa.endswith(".0") else mantissa
        assert real == mantissa + ("" if "." in mantissa else ".") * bool(exponent) + (
            f"E{int(exponent)}" if exponent else ""
        )


@examples(300)
@given(x=st.floats(allow_nan=False, allow_infinity=False))
@example(1e-7)
@example(-5e-324)
@example(1.7976931348623157e308)
@example(0.1 + 0.2)
def test_any_float64_keeps_its_bits(x):
    """OCCT writes 17 digits; what stays is the shortest text with the same bits, and it follows the
    grammar."""
    written = compact(
        f"#1 = CARTESIAN_POINT('',({x:#.17G},{-x:#.17G},\n    {x:#.17G}));\n#2 = VECTOR('',#3,{x:#.17G});\n"
    )
    found = re.fullmatch(
        r"#1=CARTESIAN_POINT\(''(?:,\(?(\S+?),(\S+?),(\S+?))\)\);\n#2=VECTOR\('',#3,(\S+)\);\n", written
    ).groups()
    assert all(re.fullmatch(r"-?\d+\.\d*(E-?\d+)?", real) for real in found)
    assert [float(real) for real in found] == [x, -x, x, x]
    assert all(len(real) <= len(repr(x)) + 2 for real in found)


def test_no_line_is_long(text):
    assert max(map(len, text.splitlines())) <= 120


# ---- front and rear ----


def test_front_and_rear_are_told_apart_by_place_not_by_pole_density(tmp_path):
    """A meniscus whose front has most poles on its high corner and whose rear has them in its low middle."""
    kv = KnotVector.uniform(3, 4)
    middle = THBSpace(kv, kv)
    for level in range(3):
        n = 4 << level
        middle = middle.refine(
            {level: [(i, j) for i in range(n // 2 - 2, n // 2 + 2) for j in range(n // 2 - 2, n // 2 + 2)]}
        )
    front = FreeformSurface((20, 20), Conic(25.0, -1.0), corner_sag(steps=3, amplitude=0, right=True))
    rear = FreeformSurface((20, 20), Conic(25.0, -1.0), THBSurface(middle, np.zeros(middle.dim)))
    lens = Lens(front, rear, 2.0, 1.5)
    write_step(lens, tmp_path / "lens.step")
    read = read_step(tmp_path / "lens.step")
    assert_holds(read, lens)


@pytest.mark.parametrize("degrees", [((3, 3), (4, 4)), ((3, 3), (2, 3)), ((2, 4), (2, 4))])
@pytest.mark.parametrize("rear_size", [(5, 4), (8, 8)])
def test_lenses_of_mixed_degrees(degrees, rear_size, tmp_path):
    """Every lens that can be made can be written."""
    sags = [corner_sag(p, steps=1) for p in degrees]
    lens = Lens(
        FreeformSurface((5, 4), Conic(), sags[0]),
        FreeformSurface(rear_size, Conic(-99.0, -1.0), sags[1]),
        4.0,
        1.5,
    )
    write_step(lens, tmp_path / "lens.step")
    read = read_step(tmp_path / "lens.step")
    assert_whole(read, 6)
    assert read.volume == pytest.approx(lens.volume(), rel=1e-6)


def test_a_part_elsewhere_keeps_the_names_of_its_faces_and_its_own(tmp_path):
    lens = Lens(FreeformSurface((10, 8)), FreeformSurface((10, 8), Conic(-60.0, -1.0)), 5.0, 1.49)
    arms = (
        build123d.Pos(12, 0, 1) * build123d.Box(8, 16, 4),
        build123d.Pos(8, 0, -3) * build123d.Box(16, 4, 4),
    )
    part = join(join(LensPart(lens), arms[0], "arm"), arms[1], "plate")
    for moved in (part, build123d.Pos(100, 20, 0) * part):
        write_step(moved, tmp_path / "part.step", Product("x"), lens=lens)
        read = read_step(tmp_path / "part.step")
        assert ("front" in read.face_names, read.front.vertex, read.product) == (True, 0.0, "x")
