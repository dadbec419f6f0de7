"""Surfaces as loose faces in STEP, IGES and BREP: round trips, other programs, units."""

import re

import build123d
import numpy as np
import pytest
from hypothesis import HealthCheck, given, strategies as st
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.BRepTools import BRepTools
from OCP.Geom import Geom_OffsetSurface
from OCP.IGESControl import IGESControl_Writer
from OCP.Interface import Interface_Static

from tests.cases import examples
from tests.thbcad.cad.exchange.cases import CUBIC, REFINED, SURFACES, WAVE, assert_same
from tests.thbcad.cases import nurbs_surfaces
from thbcad.cad.exchange.loose_splines import FORMATS, read_faces, write_faces
from thbcad.cad.exchange.solid_file import solid_area
from thbcad.cad.shapes import rational_geom
from thbcad.splines import BSplineSurface, KnotVector, NURBSSurface


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


def test_heights_are_written_as_their_graph(kind, tmp_path):
    """Of a scalar surface u and v are x and y."""
    path = tmp_path / f"heights{kind}"
    write_faces(BSplineSurface(CUBIC, CUBIC, WAVE.coefficients[..., 2]), path)
    assert_same(read_faces(path), [WAVE])


@examples(20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(nurbs_surfaces(), st.sampled_from([1.0, 1e-3, 1e3]))
def test_every_number_of_random_surfaces_reads_back(kind, tmp_path, surface, size):
    """Random nets, 10 apart so that no two vertices meet, with weights of ratio up to 100 and any clamped
    knots."""
    i, j = np.indices(surface.weights.shape)
    surface = NURBSSurface(
        surface.kv_u,
        surface.kv_v,
        size * (surface.coefficients + np.stack([10 * i, 10 * j, 0 * i], axis=-1)),
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


def test_a_thb_surface_is_written_as_the_one_face_of_to_faces(kind, tmp_path):
    write_faces(REFINED, tmp_path / f"thb{kind}")
    write_faces(REFINED.to_faces(np.inf), tmp_path / f"face{kind}")
    assert (tmp_path / f"thb{kind}").read_bytes() == (tmp_path / f"face{kind}").read_bytes()


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
        assert solid_area(face.wrapped, 1e-6) == pytest.approx(area, rel=1e-5)


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
    assert np.allclose(read.coefficients, 25.4 * SURFACES["part"].coefficients, rtol=1e-15, atol=0)
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
