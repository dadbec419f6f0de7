"""Bodies that leave a mould: sound solids whose draft and volume other programs find in their STEP files."""

import json
import os
import subprocess
from shutil import which

import build123d
import numpy as np
import pytest
from OCP.BRepAdaptor import BRepAdaptor_Surface

from tests.thbcad.cad.shapes.cases import assert_whole, rough, same_bits
from thbcad.cad.exchange import SolidState, optical_form, part_step, read_step
from thbcad.cad.shapes import moulded_part
from thbcad.io import brep_of_text, volume
from thbcad.lens import FreeformSurface, Lens, Product, optical_forms
from thbcad.moulds import BodyOptions, MouldedBody
from thbcad.outlines import Outline
from thbcad.sags import Conic


def disk(half, radius, sag=None, constant=0.0):
    return FreeformSurface((half, half), Conic(radius, constant), sag, (half, half))


def brick(radius=np.inf, sag=None, corner=0.0):
    return FreeformSurface((10, 8), Conic(radius, -1.0), sag, (corner, corner))


def oval(radius):
    return FreeformSurface((10, 8), Conic(radius), corners=(10, 8))


DOME = Lens(disk(10, -15.0), disk(24, -36.0), 14, 1.5)
NARROW = Lens(disk(10, 99.0), disk(10.05, -99.0), 6, 1.5)
BODIES = {
    "round": (Lens(disk(10, 80.0), disk(10, -60.0), 6, 1.5), BodyOptions(3, 3.5)),
    "round, freeform": (Lens(disk(10, 80.0), disk(10, -60.0, rough(), -1.0), 6, 1.5), BodyOptions(3)),
    "rectangle": (Lens(brick(), brick(-60.0, rough()), 6, 1.5), BodyOptions(5, 2)),
    "rounded": (Lens(brick(100.0, corner=3), brick(-60.0, rough(), 3), 6, 1.5), BodyOptions(5, 3)),
    "ellipse": (Lens(oval(90.0), oval(-70.0), 6, 1.5), BodyOptions()),
    "dome": (DOME, BodyOptions(annulus=True)),
    "drafted dome": (DOME, BodyOptions(2, annulus=True)),
    "dome parted above its land": (DOME, BodyOptions(2, -1, annulus=True)),
    "freeform dome": (
        Lens(disk(10, -15.0, rough(), -1.0), disk(24, -36.0), 14, 1.5),
        BodyOptions(2, annulus=True),
    ),
    "boss": (Lens(disk(10, 30.0), disk(24, -50.0), 14, 1.5), BodyOptions(2, 4, annulus=True, land=3)),
    "small rear": (Lens(disk(24, 50.0), disk(10, 15.0), 8, 1.5), BodyOptions(2, annulus=True)),
}


@pytest.fixture(scope="module", params=BODIES)
def moulded(request):
    """A body, its part, and the part's STEP file."""
    body = MouldedBody.of(*BODIES[request.param])
    part = moulded_part(body)
    return body, part, part_step(part, Product(), "AP242")


@pytest.mark.every(6)
def test_a_body_is_sound_and_keeps_its_surfaces(moulded):
    body, part, _ = moulded
    assert_whole(SolidState(part.solid), body.face_count)
    for face, form in zip(part.faces, optical_forms(body.lens)):
        assert same_bits(optical_form(face), form)


@pytest.mark.every(4)
def test_the_text_of_its_file_holds_the_volume(moulded):
    """By quadrature without OCCT, to the 1e-9 of edges that lie within 1e-9 mm."""
    body, _, file = moulded
    assert volume(brep_of_text(file.decode("latin-1"))) == pytest.approx(body.volume(), rel=1e-9)


@pytest.mark.every(3)
def test_build123d_finds_the_draft_in_the_file(moulded, tmp_path):
    """Every wall face to 1e-6 degrees: cones by their half-angle, planes by their normal."""
    body, part, file = moulded
    (tmp_path / "body.step").write_bytes(file)
    solid = build123d.import_step(str(tmp_path / "body.step"))
    angles = []
    for face in solid.faces():
        adaptor = face.geom_adaptor()
        if face.geom_type == build123d.GeomType.CONE:
            angles.append(abs(adaptor.Cone().SemiAngle()))
        elif face.geom_type == build123d.GeomType.CYLINDER:
            angles.append(0.0)
        elif face.geom_type == build123d.GeomType.PLANE and abs(face.normal_at().Z) < 0.9:
            angles.append(abs(np.arcsin(face.normal_at().Z)))
    walls = [name for name in part.names if name.startswith(("edge", "step"))]
    draft = body.walls[0].draft
    if body.outline.is_circle or not body.outline.is_ellipse:  # else extrusions of ellipses
        assert len(angles) == len(walls)
    assert np.degrees(angles) == pytest.approx(draft, abs=1e-6)


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("lens", "options", "words"),
    [
        (DOME, {}, "ruled wall of their own draft: add annulus"),
        (BODIES["round"][0], {"annulus": True}, "front and rear have one size"),
        (BODIES["round"][0], {"draft": 3, "parting": 9}, "must lie below the rear's rim"),
        (BODIES["round"][0], {"draft": 3, "parting": -2}, "must lie above the front's rim"),
        (BODIES["ellipse"][0], {"draft": 1}, "need a rectangle, a circle or round corners"),
        (BODIES["round"][0], {"draft": 50}, "at most 45 degrees, got 50"),
        (Lens(disk(10, -15.0), disk(24, 50.0), 1, 1.5), {"annulus": True, "land": 3}, "outside of the rear"),
        (DOME, {"annulus": True, "land": 6}, "must lie below the rear's rim"),
        (DOME, {"annulus": True, "parting": -6}, "must lie above the land"),
        (BODIES["freeform dome"][0], {"annulus": True, "land": -3.34}, "crosses the rim of the front"),
        (DOME, {"land": 1}, "a land needs annulus"),
        (DOME, {"annulus": "no"}, "lens.body.annulus must be true or false, got 'no'"),
        (DOME, {"draft": 50}, "lens.body.draft must be at most 45 degrees"),
        (NARROW, {"annulus": True, "draft": 5, "parting": 4}, "no width"),
        (BODIES["rounded"][0], {"draft": 45, "parting": 4.5}, "has nothing left"),
    ],
    ids=str,
)
def test_a_body_that_cannot_be_is_refused_in_a_sentence(lens, options, words):
    with pytest.raises(ValueError, match=words):
        MouldedBody.of(lens, BodyOptions(**options))


def test_a_draft_that_eats_the_clear_aperture_is_refused():
    """The front's rim lies at z = 0.61 mm, 2.89 mm below the parting line: 0.1515 mm inside at 3 degrees."""
    lens, options = BODIES["round"]
    inset = MouldedBody.of(lens, options, (Outline.ellipse((9.84, 9.84)),) * 2).least_inset[0]
    assert inset == pytest.approx(0.1515, abs=1e-4)
    with pytest.raises(ValueError, match="eats the clear aperture"):
        MouldedBody.of(lens, options, (Outline.ellipse((9.85, 9.85)),) * 2)


ROUNDED = {
    "round, freeform": BodyOptions(3, edge_radius=0.3),
    "rounded": BodyOptions(5, 3, edge_radius=0.3),
    "ellipse": BodyOptions(edge_radius=0.4),
    "drafted dome": BodyOptions(2, annulus=True, edge_radius=0.3),
}


def radii(points):
    """Radii of the circles through three points each, (3, n, 3)."""
    a, b, c = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=2)
    return a * b * c / (2 * np.linalg.norm(np.cross(points[1] - points[0], points[2] - points[0]), axis=1))


@pytest.mark.slow
@pytest.mark.parametrize("name", ROUNDED)
def test_rounded_edges_have_their_radius_and_lie_outside_of_what_is_proven_clear(name, tmp_path):
    """In the file, read by build123d: arcs across every rounding through three points to 1e-7 mm, and every
    point beyond the aperture; front and rear have the same numbers as before."""
    lens, options = BODIES[name][0], ROUNDED[name]
    body = MouldedBody.of(lens, options)
    clear = body.lens.front.outline.scaled([0.92 * h for h in lens.front.half_width])
    body.require_clear((clear, clear))
    part = moulded_part(body)
    for face, form in zip(part.faces, optical_forms(lens)):
        assert same_bits(optical_form(face), form)
    (tmp_path / "body.step").write_bytes(part_step(part, Product(), "AP242"))
    solid = build123d.import_step(str(tmp_path / "body.step"))
    state, names = SolidState(solid.wrapped), read_step(tmp_path / "body.step").face_names
    assert (state.valid, state.closed, state.free_edges, state.faces) == (True, True, 0, len(part.faces))
    assert state.tolerance <= 1e-6
    rounded = [face for face, name in zip(solid.faces(), names) if name.startswith("radius")]
    assert len(rounded) == sum(len(rim.pieces) for k, rim in enumerate(body.feet) if k in body.rounded)
    for face in rounded:
        adaptor = BRepAdaptor_Surface(face.wrapped)
        u = np.linspace(adaptor.FirstUParameter(), adaptor.LastUParameter(), 9)
        v = np.linspace(adaptor.FirstVParameter(), adaptor.LastVParameter(), 3)
        points = np.array([[adaptor.Value(a, b).Coord() for a in u] for b in v])
        assert radii(points) == pytest.approx(options.edge_radius, abs=1e-7)
        assert not clear.contains(*points[..., :2].T).any()


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("rectangle", {"edge_radius": 0.3}, "without sharp corners"),
        ("round", {"edge_radius": 3}, "beyond the rounding of the rear at .* take 2.5 mm, which fits"),
        ("round", {"edge_radius": 1000}, "no ball of this radius touches .* take 2.5 mm, which fits"),
        ("round", {"edge_radius": 4, "draft": 2}, "beyond the parting line .* mm, which fits"),
        ("round", {"edge_radius": -1}, "edge_radius must be"),
    ],
)
def test_a_radius_that_cannot_be_is_refused_in_a_sentence(name, options, words):
    with pytest.raises(ValueError, match=words):
        MouldedBody.of(BODIES[name][0], BodyOptions(**options))


def test_a_radius_that_comes_near_the_clear_aperture_is_refused():
    lens = BODIES["round"][0]
    with pytest.raises(ValueError, match="eats the clear aperture"):
        MouldedBody.of(lens, BodyOptions(edge_radius=0.5), (Outline.ellipse((9.6, 9.6)),) * 2)


FREECAD = """
import json, os, Part
found, folder = {}, os.environ["STEP_FOLDER"]
for name in os.listdir(folder):
    shape, rows = Part.Shape(), []
    shape.read(os.path.join(folder, name))
    for face in shape.Faces:
        a, b, c, d = face.ParameterRange
        rows.append([[[*face.valueAt(a + (b - a) * i / 8, c + (d - c) * j / 8),
                       *face.normalAt(a + (b - a) * i / 8, c + (d - c) * j / 8)]
                      for j in range(9)] for i in range(9)])
    found[name] = {"sound": shape.isValid() and len(shape.Solids) == 1, "faces": rows}
print("\\n" + json.dumps(found))
"""


@pytest.mark.slow
@pytest.mark.skipif(not which("freecadcmd"), reason="freecadcmd is not installed: apt-get install freecad")
def test_freecad_measures_draft_and_radii_of_the_files(tmp_path):
    """Of walls the normals to 1e-6 degrees, of roundings the arcs through three points to 1e-7 mm."""
    (tmp_path / "bodies").mkdir()
    given = [*BODIES.values(), *((BODIES[name][0], options) for name, options in ROUNDED.items())]
    for k, body in enumerate(given):
        file = part_step(moulded_part(MouldedBody.of(*body)), Product(), "AP242")
        (tmp_path / "bodies" / f"{k}.step").write_bytes(file)
    (tmp_path / "measure.py").write_text(FREECAD)
    told = subprocess.run(
        ["freecadcmd", tmp_path / "measure.py"],
        env={**os.environ, "STEP_FOLDER": str(tmp_path / "bodies")},
        check=True,
        capture_output=True,
        text=True,
    )
    found = json.loads(told.stdout.strip().splitlines()[-1])
    for k, (_, options) in enumerate(given):
        names, seen = read_step(tmp_path / "bodies" / f"{k}.step").face_names, found[f"{k}.step"]
        assert seen["sound"]
        for name, face in zip(names, seen["faces"], strict=True):
            points, normals = np.split(np.array(face), 2, axis=-1)
            if name.startswith(("edge", "step")):
                draft = np.degrees(np.arcsin(abs(normals[..., 2])))
                assert draft == pytest.approx(options.draft, abs=1e-6)
            if name.startswith("radius"):
                assert radii(points[:, ::4].swapaxes(0, 1)) == pytest.approx(options.edge_radius, abs=1e-7)
