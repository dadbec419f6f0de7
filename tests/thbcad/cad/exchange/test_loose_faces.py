"""Loose spline faces in STEP, IGES and BREP: every number reads back."""

import re

import build123d
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.BRepGProp import BRepGProp
from OCP.BRepTools import BRepTools
from OCP.Geom import Geom_OffsetSurface
from OCP.GProp import GProp_GProps
from OCP.IGESControl import IGESControl_Controller, IGESControl_Writer
from OCP.Interface import Interface_Static

from tests.thbcad.cases import nurbs_surfaces
from thbcad.cad.exchange.loose_faces import FORMATS, read_faces, write_faces
from thbcad.cad.shapes import rational_geom
from thbcad.sags import Conic, meridian
from thbcad.splines import BSplineSurface, KnotVector, NURBSSurface, circular_arc, line, revolved, ruled

KINDS = (".step", ".igs", ".brep")
CUBIC = KnotVector.uniform(3, 3)
WAVE = BSplineSurface(
    CUBIC,
    CUBIC,
    np.stack(
        [
            *np.meshgrid(CUBIC.greville(), CUBIC.greville(), indexing="ij"),
            np.sin(np.arange(36)).reshape(6, 6),
        ],
        -1,
    ),
)
CIRCLE = circular_arc(3.0).transformed([[1, 0], [0, 1], [0, 0]])
SURFACES = {
    "wave": WAVE,
    "lens": revolved(meridian(Conic(-30.0, 0.5), 8.0)),
    "part": revolved(meridian(Conic(9.0, 0.0), 8.0), np.pi),
    "sphere": revolved(circular_arc(5.0, np.pi, -np.pi / 2)),
    "torus": revolved(circular_arc(1.0, centre=(3.0, 0.0))),
    "cylinder": ruled(CIRCLE, CIRCLE.transformed(np.eye(3), [0, 0, 5])),
    "cone": revolved(line([3, 0], [0, 4])),
}


@pytest.fixture(params=KINDS)
def kind(request):
    return request.param


@pytest.fixture
def occt_settings():
    """Put back OCCT's process-wide settings that a test changes."""
    IGESControl_Controller.Init_s()
    before = {
        name: Interface_Static.CVal_s(name)
        for name in ("write.iges.unit", "xstep.cascade.unit", "read.iges.bspline.continuity")
    }
    yield
    for name, value in before.items():
        Interface_Static.SetCVal_s(name, value)


def numbers(surface):
    """Return (points, weights, knots u, knots v)."""
    nurbs = NURBSSurface.from_bspline(surface) if isinstance(surface, BSplineSurface) else surface
    return nurbs.points, nurbs.weights, nurbs.kv_u.knots, nurbs.kv_v.knots


def assert_same(read, written):
    assert len(read) == len(written)
    for a, b in zip(read, written):
        assert (a.kv_u.degree, a.kv_v.degree) == (b.kv_u.degree, b.kv_v.degree)
        # 0.0 and -0.0 are the same place
        assert all((x + 0.0).tobytes() == (y + 0.0).tobytes() for x, y in zip(numbers(a), numbers(b)))


def samples(surface, n=17):
    return surface.grid(*(np.linspace(kv.start, kv.stop, n) for kv in (surface.kv_u, surface.kv_v))).reshape(
        -1, 3
    )


def brep(shape, path):
    assert BRepTools.Write_s(shape, str(path))
    return path


# ---- round trips ----


def test_every_number_of_many_surfaces_reads_back_in_order(kind, tmp_path):
    """Closed, degenerate, rational and polynomial surfaces in one file."""
    path = tmp_path / f"all{kind}"
    write_faces(list(SURFACES.values()), path)
    read = read_faces(path)
    assert_same(read, list(SURFACES.values()))
    assert [type(s) for s in read] == [type(s) for s in SURFACES.values()]


@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(nurbs_surfaces(), st.sampled_from([1.0, 1e-3, 1e3]))
def test_every_number_of_random_surfaces_reads_back(kind, tmp_path, surface, size):
    """Random nets, 10 apart so that no two vertices meet, with weights of ratio up to 100 and any clamped
    knots."""
    i, j = np.indices(surface.weights.shape)
    surface = NURBSSurface(
        surface.kv_u,
        surface.kv_v,
        size * (surface.points + np.stack([10 * i, 10 * j, 0 * i], axis=-1)),
        surface.weights,
    )
    write_faces([surface], tmp_path / f"random{kind}")
    assert_same(read_faces(tmp_path / f"random{kind}"), [surface])


@pytest.mark.parametrize("gap", [1e-12, 1e-8])
def test_nearly_closed_surfaces_come_back_closed(kind, gap, tmp_path):
    """OCCT makes them periodic in STEP and IGES: the last row moves by the gap; BREP keeps it."""
    kv = KnotVector.uniform(3, 6)
    t = 2 * np.pi * kv.greville()
    points = np.stack(
        [np.stack([np.cos(t), np.sin(t), np.full_like(t, z)], axis=-1) for z in (0.0, 1.0)], axis=1
    )
    points[-1] = points[0] + [0, gap, 0]
    write_faces([BSplineSurface(kv, KnotVector.uniform(1, 1), points)], tmp_path / f"near{kind}")
    read = read_faces(tmp_path / f"near{kind}")[0].coefficients
    assert (read[:-1] == points[:-1]).all()
    assert (read[-1] == (points[-1] if kind == ".brep" else points[0])).all()


def test_equal_weights_come_back_polynomial(kind, tmp_path):
    path = tmp_path / f"equal{kind}"
    write_faces([NURBSSurface(CUBIC, CUBIC, WAVE.coefficients, 7.0)], path)
    (read,) = read_faces(path)
    assert isinstance(read, BSplineSurface)
    assert_same([read], [WAVE])


@pytest.mark.parametrize("suffix", [*FORMATS, ".STEP", ".IGS", ".Brep"])
def test_suffixes(suffix, tmp_path):
    write_faces([WAVE], tmp_path / f"a{suffix}")
    assert_same(read_faces(tmp_path / f"a{suffix}"), [WAVE])


def test_the_same_surfaces_give_the_same_bytes(kind, tmp_path):
    paths = [tmp_path / f"{k}{kind}" for k in range(3)]
    for path in paths:
        write_faces(list(SURFACES.values()), path)
    assert paths[0].read_bytes() == paths[1].read_bytes() == paths[2].read_bytes()


# ---- other programs ----


@pytest.mark.parametrize("kind", [".step", ".brep"])
def test_build123d_reads_the_faces(kind, tmp_path):
    """OCCT's areas of sphere, torus and cylinder are the closed forms: the seams and poles of the faces are
    right."""
    path = tmp_path / f"faces{kind}"
    write_faces([SURFACES[name] for name in ("sphere", "torus", "cylinder")], path)
    shape = build123d.import_step(path) if kind == ".step" else build123d.import_brep(path)
    assert shape.is_valid
    wanted = [4 * np.pi * 25, 4 * np.pi**2 * 3, 2 * np.pi * 15]
    for face, area in zip(shape.faces(), wanted, strict=True):
        properties = GProp_GProps()
        BRepGProp.SurfaceProperties_s(face.wrapped, properties, 1e-6)
        assert properties.Mass() == pytest.approx(area, rel=1e-5)


SOLIDS = {
    "box": (build123d.Box(1, 2, 3), lambda x: np.prod(abs(x) - [0.5, 1, 1.5], axis=1)),
    "cylinder": (build123d.Cylinder(2, 3), lambda x: (np.hypot(*x[:, :2].T) - 2) * (abs(x[:, 2]) - 1.5)),
    "cone": (
        build123d.Cone(2, 1, 3),
        lambda x: (np.hypot(*x[:, :2].T) - 1.5 + x[:, 2] / 3) * (abs(x[:, 2]) - 1.5),
    ),
    "sphere": (build123d.Sphere(2), lambda x: np.linalg.norm(x, axis=1) - 2),
    "torus": (build123d.Torus(5, 1), lambda x: np.hypot(np.hypot(*x[:, :2].T) - 5, x[:, 2]) - 1),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_elementary_surfaces_come_as_exact_nurbs(kind, name, tmp_path):
    """Points of every face of a shifted solid satisfy its equation, up to products of three numbers below 10,
    to rounding."""
    solid, equation = SOLIDS[name]
    placed, path = build123d.Pos(1, 2, 3) * solid, tmp_path / f"solid{kind}"
    if kind == ".step":
        build123d.export_step(placed, path)
    elif kind == ".brep":
        build123d.export_brep(placed, path)
    else:
        writer = IGESControl_Writer("MM", 0)
        assert writer.AddShape(placed.wrapped)
        assert writer.Write(str(path))
    read = read_faces(path)
    assert len(read) == len(solid.faces())
    # OCCT's own STEP writer keeps the angle of a cone to 13 digits
    bound = 1e-11 if (kind, name) == (".step", "cone") else 100 * np.finfo(float).eps
    for surface in read:
        assert abs(equation(samples(surface) - [1, 2, 3])).max() <= bound


def test_periodic_and_unclamped_surfaces_of_other_programs(tmp_path):
    """A periodic OCCT surface is cut and clamped: the same points at the same parameters."""
    geom = rational_geom(SURFACES["torus"])
    geom.SetUPeriodic()
    geom.SetVPeriodic()
    path = brep(BRepBuilderAPI_MakeFace(geom, 1e-7).Face(), tmp_path / "periodic.brep")
    (read,) = read_faces(path)
    u = np.linspace(0, 1, 13)
    want = [[geom.Value(a, b).Coord() for b in u.tolist()] for a in u.tolist()]
    assert abs(read.grid(u, u) - want).max() <= 1e-14


def test_trimmed_splines_come_whole(tmp_path):
    geom = rational_geom(SURFACES["part"])
    path = brep(BRepBuilderAPI_MakeFace(geom, 0.2, 0.7, 0.1, 0.4, 1e-7).Face(), tmp_path / "trimmed.brep")
    assert_same(read_faces(path), [SURFACES["part"]])


def test_offset_surfaces_are_refused(tmp_path):
    """They are no NURBS: OCCT would approximate."""
    offset = Geom_OffsetSurface(rational_geom(SURFACES["part"]), 0.5)
    path = brep(BRepBuilderAPI_MakeFace(offset, 1e-7).Face(), tmp_path / "offset.brep")
    with pytest.raises(
        ValueError,
        match=re.escape(f"face 0 of {path} cannot be read: it is no surface that NURBS hold exactly"),
    ):
        read_faces(path)


def test_degrees_above_10_are_refused(tmp_path):
    geom = rational_geom(SURFACES["part"])
    geom.IncreaseDegree(11, 2)
    path = brep(BRepBuilderAPI_MakeFace(geom, 1e-7).Face(), tmp_path / "high.brep")
    with pytest.raises(
        ValueError, match=r"face 0 of .* cannot be read: degree must be an integer from 1 to 10, got 11"
    ):
        read_faces(path)


def test_files_without_faces_are_refused(tmp_path):
    edge = build123d.Edge.make_line((0, 0, 0), (1, 0, 0))
    path = brep(edge.wrapped, tmp_path / "edge.brep")
    with pytest.raises(ValueError, match=re.escape(f"{path} holds no faces")):
        read_faces(path)


# ---- units and settings ----


def test_metres_become_millimetres(tmp_path):
    path = tmp_path / "wave.step"
    write_faces([WAVE], path)
    metres = path.read_text().replace("SI_UNIT(.MILLI.,.METRE.)", "SI_UNIT($,.METRE.)")
    assert metres != path.read_text()
    path.write_text(metres)
    assert np.allclose(read_faces(path)[0].coefficients, 1000 * WAVE.coefficients, rtol=1e-15, atol=0)


def test_inches_become_millimetres(tmp_path):
    path = tmp_path / "part.igs"
    write_faces([SURFACES["part"]], path)
    inches = path.read_bytes().replace(b",1.,2,2HMM,", b",1.,1,2HIN,")
    assert inches != path.read_bytes()
    path.write_bytes(inches)
    (read,) = read_faces(path)
    assert np.allclose(read.points, 25.4 * SURFACES["part"].points, rtol=1e-15, atol=0)
    assert (read.weights == SURFACES["part"].weights).all()


def test_settings_of_other_programs_change_nothing(kind, tmp_path, occt_settings):
    before, after = tmp_path / f"before{kind}", tmp_path / f"after{kind}"
    write_faces([WAVE, SURFACES["lens"]], before)
    changed = {"write.iges.unit": "INCH", "xstep.cascade.unit": "M", "read.iges.bspline.continuity": "1"}
    for name, value in changed.items():
        assert Interface_Static.SetCVal_s(name, value)
    write_faces([WAVE, SURFACES["lens"]], after)
    assert before.read_bytes() == after.read_bytes()
    assert_same(read_faces(after), [WAVE, SURFACES["lens"]])
    assert Interface_Static.CVal_s("xstep.cascade.unit") == "M"


def test_nothing_is_printed(kind, tmp_path, capfd):
    path = tmp_path / f"quiet{kind}"
    write_faces([WAVE], path)
    read_faces(path)
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(ValueError, match="is not a readable"):
        read_faces(path)
    assert capfd.readouterr().out == ""


# ---- refused ----


@pytest.mark.parametrize("share", [0, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.999])
def test_truncated_files_are_refused(kind, share, tmp_path):
    path = tmp_path / f"short{kind}"
    write_faces([WAVE, SURFACES["torus"]], path)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(
        ValueError,
        match=re.escape(f"{path} is not a readable {kind[1:].upper().replace('IGS', 'IGES')} file"),
    ):
        read_faces(path)


@pytest.mark.parametrize("cut", [2, 3, 4, 5, 6, 8])
def test_a_brep_without_its_last_reference_is_refused(cut, tmp_path):
    """The last line names the shape that the file is about; the table above it is whole."""
    path = tmp_path / "short.brep"
    write_faces([WAVE], path)
    path.write_bytes(path.read_bytes().rstrip()[:-cut])
    with pytest.raises(ValueError, match=re.escape(f"{path} is not a readable BREP file")):
        read_faces(path)


@pytest.mark.parametrize(
    "data", [b"", b"hello\n", b"\x00\xff" * 500, b"ISO-10303-21;\n", b"CASCADE Topology V1\nTShapes 0\n"]
)
def test_other_files_are_refused(kind, data, tmp_path):
    path = tmp_path / f"other{kind}"
    path.write_bytes(data)
    with pytest.raises(ValueError, match="is not a readable"):
        read_faces(path)


def test_missing_files_are_os_errors(kind, tmp_path):
    with pytest.raises(FileNotFoundError):
        read_faces(tmp_path / f"none{kind}")
    with pytest.raises(FileNotFoundError):
        write_faces([WAVE], tmp_path / "nowhere" / f"a{kind}")


@pytest.mark.parametrize("call", [read_faces, lambda path: write_faces([WAVE], path)])
def test_other_suffixes_are_refused(call, tmp_path):
    path = tmp_path / "a.stl"
    with pytest.raises(ValueError, match=re.escape(f"{path} must end in .step, .stp, .iges, .igs, .brep")):
        call(path)


def test_surfaces_are_refused(tmp_path):
    with pytest.raises(ValueError, match="at least one surface"):
        write_faces([], tmp_path / "a.step")
    plane = NURBSSurface(CUBIC, CUBIC, WAVE.coefficients[..., :2])
    with pytest.raises(
        ValueError, match=r"surfaces\[1\] must have points \(x, y, z\), got a net of shape \(6, 6, 2\)"
    ):
        write_faces([WAVE, plane], tmp_path / "a.step")
    small = NURBSSurface(CUBIC, CUBIC, WAVE.coefficients, np.where(np.arange(36).reshape(6, 6), 1.0, 1e-10))
    with pytest.raises(ValueError, match="weights must be at least 1e-09 in IGES, got 1e-10"):
        write_faces([small], tmp_path / "a.igs")
    write_faces([small], tmp_path / "a.step")
    assert_same(read_faces(tmp_path / "a.step"), [small])


def test_knots_too_near_for_occt_are_refused(kind, tmp_path):
    near = KnotVector(1, [0.0, 0.0, 1.0, np.nextafter(1.0, 2.0), 2.0, 2.0])
    with pytest.raises(RuntimeError, match=r"OCCT could not make a face of surfaces\[1\]: .*[Kk]nots"):
        write_faces(
            [WAVE, BSplineSurface(near, near, np.arange(48.0).reshape(4, 4, 3))], tmp_path / f"a{kind}"
        )
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_the_old_file(kind, tmp_path, monkeypatch):
    path = tmp_path / f"a{kind}"
    path.write_text("old")

    def fail(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", fail)
    with pytest.raises(OSError, match="No space left"):
        write_faces([WAVE], path)
    monkeypatch.undo()
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [(path.name, "old")]


# ---- short spans, small faces, damaged shapes ----


def flat(kv_u, kv_v, size_u=1.0, size_v=1.0):
    i, j = np.indices((kv_u.dim, kv_v.dim))
    return BSplineSurface(kv_u, kv_v, np.stack([size_u * i, size_v * j, 0 * i], axis=-1))


@pytest.mark.parametrize("length", [1e-9, 1e-10, 1e-13])
def test_short_spans_read_back(kind, length, tmp_path):
    surface = flat(KnotVector(3, [0] * 4 + [length] + [1] * 4), CUBIC)
    write_faces([surface], tmp_path / f"short{kind}")
    assert_same(read_faces(tmp_path / f"short{kind}"), [surface])


@pytest.mark.parametrize("size", [1.0, 0.1])
def test_small_faces_are_kept_or_refused(kind, size, tmp_path):
    """The diagonal of the box is sqrt(2) and sqrt(0.02) times 1e-6 mm."""
    surface, path = flat(CUBIC, CUBIC, size * 2e-7, size * 2e-7), tmp_path / f"small{kind}"
    if size == 1 or kind == ".brep":
        write_faces([surface], path)
        assert_same(read_faces(path), [surface])
    else:
        with pytest.raises(
            ValueError, match=r"surfaces\[1\] is 1.4e-07 mm large, below the 1e-06 mm that STEP and IGES keep"
        ):
            write_faces([WAVE, surface], path)
        assert not path.exists()


def test_a_brep_of_shapes_that_do_not_fit_is_refused(tmp_path):
    """A wire made a shell: OCCT cannot put edges into it."""
    path = tmp_path / "wave.brep"
    write_faces([WAVE], path)
    path.write_bytes(path.read_bytes().replace(b"\nWi\n", b"\nSh\n"))
    with pytest.raises(ValueError, match=r"wave.brep is not readable: TopoDS_Builder::Add"):
        read_faces(path)


@pytest.mark.parametrize(
    ("surfaces", "message"),
    [
        (WAVE, "surfaces must be a list of surfaces, got BSplineSurface"),
        (None, "surfaces must be a list of surfaces, got NoneType"),
        ([WAVE, 5], r"surfaces\[1\] must be a BSplineSurface or NURBSSurface, got int"),
    ],
)
def test_what_is_no_list_of_surfaces_is_refused(surfaces, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        write_faces(surfaces, tmp_path / "a.step")
