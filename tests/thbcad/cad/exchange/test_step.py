"""STEP files: closed solids of six faces whose splines read back bit for bit."""

import re
import subprocess
import sys

import build123d
import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st
from OCP.BRep import BRep_Tool
from OCP.BRepGProp import BRepGProp
from OCP.Geom import Geom_BSplineCurve
from OCP.GProp import GProp_GProps
from OCP.Interface import Interface_Static

from oracles.spline_definitions import flux_volume
from tests.cases import ROOT
from tests.thbcad.cases import LENSES, assert_same_surface, bits, corner_sag
from thbcad.cad.exchange.step import read_step, step_bytes, write_step
from thbcad.cad.exchange.step_writing import compact
from thbcad.cad.shapes import lens_solid, lens_surfaces
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface


@pytest.fixture(scope="module", params=LENSES)
def written(request, tmp_path_factory):
    """(lens, path, what was read back), written once for each lens."""
    lens = LENSES[request.param]
    path = tmp_path_factory.mktemp("step") / f"{request.param}.step"
    write_step(lens, path)
    return lens, path, read_step(path)


@pytest.fixture(scope="module")
def text(tmp_path_factory):
    """The file of the Table 6.3 lens, as text."""
    path = tmp_path_factory.mktemp("text") / "lens.step"
    write_step(LENSES["table63"], path)
    return path.read_text("ascii")


@pytest.fixture
def occt_settings():
    """Put back OCCT's process-wide settings that a test changes."""
    names = ("write.step.schema", "write.step.unit", "write.step.assembly", "xstep.cascade.unit")
    before = {name: Interface_Static.CVal_s(name) for name in names}
    yield
    for name, value in before.items():
        Interface_Static.SetCVal_s(name, value)


# ---- every lens ----


def test_one_closed_solid_of_six_faces(written):
    _, _, read = written
    assert (read.solids, read.faces, read.free_edges, read.closed, read.valid) == (1, 6, 0, True, True)


def test_poles_and_knots_read_back_bit_for_bit(written):
    lens, _, read = written
    front, rear = lens_surfaces(lens)
    assert_same_surface(read.front, front)
    assert_same_surface(read.rear, rear)


def test_the_file_holds_the_surface_of_the_lens(written):
    """Points on the splines of the file against conic + sag in closed form: 1e-11 mm of interpolation, else
    rounding."""
    lens, _, read = written
    s = np.linspace(0, 1, 41)
    for surface, vertex, freeform in ((read.front, 0.0, lens.front), (read.rear, lens.thickness, lens.rear)):
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
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(solid.wrapped, properties, 1e-6)
    assert properties.Mass() == pytest.approx(lens.volume(), rel=1e-6)
    outward = [(0, 0, -1), (0, 0, 1), (0, -1, 0), (1, 0, 0), (0, 1, 0), (-1, 0, 0)]
    for face, direction in zip(solid.faces(), outward, strict=True):
        assert np.dot(tuple(face.normal_at()), direction) > 0


def test_rims_are_the_boundary_rows_of_the_nets(written):
    """The eight rim curves in the file carry the very poles of the two surfaces."""
    lens, path, _ = written
    wanted = {
        bits(row + 0.0)
        for s in lens_surfaces(lens)
        for c in [s.coefficients]
        for row in (c[0], c[-1], c[:, 0], c[:, -1])
    }
    found = set()
    for edge in build123d.import_step(path).edges():
        curve = BRep_Tool.Curve_s(edge.wrapped, 0.0, 1.0)
        if isinstance(curve, Geom_BSplineCurve) and curve.Degree() > 1:
            found.add(bits([curve.Pole(k).Coord() for k in range(1, curve.NbPoles() + 1)] + np.zeros(3)))
    assert len(wanted) == 8
    assert found == wanted


def test_front_and_rear_share_their_relative_knots(written):
    """Knots at the same relative place are the same float64: the ruled faces hold no sliver spans."""
    lens, _, _ = written
    for a, b in zip(*([s.kv_u, s.kv_v] for s in lens_surfaces(lens))):
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


@settings(max_examples=300)
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


# ---- the same bytes ----


@pytest.mark.parametrize("name", ["freeform", "table63"])
def test_the_same_lens_gives_the_same_bytes(name, tmp_path):
    files = [tmp_path / f"{k}.step" for k in range(3)]
    for file in files:
        write_step(LENSES[name], file)
    assert files[0].read_bytes() == files[1].read_bytes() == files[2].read_bytes()


def test_another_process_gives_the_same_bytes_and_prints_nothing(tmp_path):
    program = (
        "from thbcad import *; import sys\n"
        "lens = Lens(FreeformSurface((5, 5), Conic(-5.0, -1.0)), FreeformSurface((8, 8), Conic(-10.0, "
        "-1.0)), 5.0, 1.5)\n"
        "write_step(lens, sys.argv[1])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path / "a.step")],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert (done.stdout, done.stderr) == ("", "")
    write_step(LENSES["table63"], tmp_path / "b.step")
    assert (tmp_path / "a.step").read_bytes() == (tmp_path / "b.step").read_bytes()


def test_settings_of_other_programs_do_not_change_the_file(tmp_path, occt_settings):
    """OCCT's settings are process-wide; a file must not depend on who wrote before."""
    write_step(LENSES["table63"], tmp_path / "before.step")
    Interface_Static.SetCVal_s("write.step.schema", "AP203")
    Interface_Static.SetCVal_s("write.step.unit", "M")
    write_step(LENSES["table63"], tmp_path / "after.step")
    unnamed = [
        re.sub(r"PRODUCT\('[^']*','[^']*'", "PRODUCT(", (tmp_path / f).read_text())
        for f in ("before.step", "after.step")
    ]
    assert unnamed[0] == unnamed[1]


# ---- only needed knots ----


def test_a_refined_corner_exports_only_its_knots(tmp_path):
    """4 x 4 spans, twice refined over the first 4 cells: 4 new knots per level and direction in the file."""
    lens = LENSES["freeform"]
    write_step(lens, tmp_path / "lens.step")
    rear = read_step(tmp_path / "lens.step").rear
    wanted = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16]) / 16
    for kv, half in ((rear.kv_u, 10), (rear.kv_v, 8)):
        assert abs(kv.breaks - half * (2 * wanted - 1)).max() <= 1e-14 * half
        assert kv.dim == 12 + 3
    assert read_step(tmp_path / "lens.step").front.coefficients.shape == (4, 4, 3)


def test_a_lens_refined_in_one_quarter_is_a_small_file():
    """32^2 spans, of which one quarter is refined to 256^2: poles in lines through the quarter, (16 + 128)^2
    of 256^2."""
    space = THBSpace(*[KnotVector.uniform(3, 32)] * 2)
    for level in range(3):
        space = space.refine({level: np.argwhere(np.ones((16 << level, 16 << level)))})
    full = THBSpace(*[KnotVector.uniform(3, 256)] * 2)
    rng = np.random.default_rng(0)
    sizes = []
    for each in (space, full):
        sag = THBSurface(each, 1e-3 * rng.standard_normal(each.dim))
        sizes.append(
            len(
                step_bytes(
                    Lens(
                        FreeformSurface((50, 50)),
                        FreeformSurface((50, 50), Conic(-150.0, -1.0), sag),
                        20.0,
                        1.5,
                    )
                )
            )
        )
    assert sizes[0] <= sizes[1] / 3


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
    assert_same_surface(read.front, lens_surfaces(lens)[0])
    assert_same_surface(read.rear, lens_surfaces(lens)[1])


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
    assert (read.solids, read.faces, read.free_edges, read.closed, read.valid) == (1, 6, 0, True, True)
    assert read.volume == pytest.approx(lens.volume(), rel=1e-6)


# ---- units and damaged files ----


def test_lengths_are_converted_to_millimetres(text, tmp_path):
    path = tmp_path / "metres.step"
    metres = text.replace("SI_UNIT(.MILLI.,.METRE.)", "SI_UNIT($,.METRE.)")
    assert metres != text
    path.write_text(metres)
    read = read_step(path)
    front, rear = lens_surfaces(LENSES["table63"])
    assert np.allclose(read.front.coefficients, 1000 * front.coefficients, rtol=1e-15, atol=0)
    assert np.allclose(read.rear.coefficients, 1000 * rear.coefficients, rtol=1e-15, atol=0)
    assert read.volume == pytest.approx(1e9 * LENSES["table63"].volume(), rel=1e-6)


def test_settings_of_other_programs_do_not_change_what_is_read(text, tmp_path, occt_settings):
    path = tmp_path / "lens.step"
    path.write_text(text)
    Interface_Static.SetCVal_s("xstep.cascade.unit", "M")
    assert read_step(path).volume == pytest.approx(LENSES["table63"].volume(), rel=1e-6)


@pytest.mark.parametrize("share", [0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.999])
def test_truncated_files_are_refused(text, tmp_path, share):
    path = tmp_path / "short.step"
    path.write_text(text[: int(share * len(text))])
    with pytest.raises(ValueError, match=re.escape(f"{path} is not a readable STEP file")):
        read_step(path)


@pytest.mark.parametrize(
    "data", [b"", b"hello\n", b"\x00\xff" * 500, b"ISO-10303-21;\n", b'{"schema": "thbcad-lens"}']
)
def test_files_that_are_no_step_are_refused(data, tmp_path):
    path = tmp_path / "other.step"
    path.write_bytes(data)
    with pytest.raises(ValueError, match="is not a readable STEP file"):
        read_step(path)


def test_missing_files_are_os_errors(tmp_path):
    for path in (tmp_path / "none.step", tmp_path):
        with pytest.raises(OSError, match=re.escape(str(path))):
            read_step(path)


def without_face(text, number):
    """Return the file with one face taken out of the shell: 0 front, 1 rear, 2 to 5 the edges."""
    shell = re.search(r"CLOSED_SHELL\('',\(([^)]*)\)", text)
    faces = shell.group(1).split(",")
    assert len(faces) == 6
    return text.replace(shell.group(1), ",".join(faces[:number] + faces[number + 1 :]))


@pytest.mark.parametrize("number", [0, 1])
def test_a_missing_optical_face_is_refused(text, tmp_path, number):
    path = tmp_path / "open.step"
    path.write_text(without_face(text, number))
    with pytest.raises(ValueError, match="holds 1 curved spline faces where a lens has 2"):
        read_step(path)


@pytest.mark.parametrize("number", [2, 3, 4, 5])
def test_a_missing_edge_face_is_reported(text, tmp_path, number):
    """OCCT calls the open shell valid: the counts tell."""
    path = tmp_path / "open.step"
    path.write_text(without_face(text, number))
    read = read_step(path)
    assert (read.faces, read.free_edges, read.closed, read.solids) == (5, 4, False, 0)


def test_other_solids_are_refused(tmp_path):
    path = tmp_path / "box.step"
    build123d.export_step(build123d.Box(1, 2, 3), path)
    with pytest.raises(ValueError, match="holds 0 curved spline faces where a lens has 2"):
        read_step(path)


# ---- writing ----


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "lens.step"
    path.write_text("old")

    def fail(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", fail)
    with pytest.raises(OSError, match="No space left"):
        write_step(LENSES["plano"], path)
    monkeypatch.undo()
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("lens.step", "old")]


def test_a_missing_folder_is_an_os_error(tmp_path):
    with pytest.raises(FileNotFoundError):
        write_step(LENSES["plano"], tmp_path / "nowhere" / "lens.step")
