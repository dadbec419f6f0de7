"""`thbcad export` for a mould: enlarged lenses in every format, read by programs that did not write them."""

import json

import numpy as np
import pytest

from optics.exchange.export import MESHES, SOLIDS
from optics.exchange.export.body import Body
from optics.scene.problem import load_problem
from optics.scene.system import System
from tests.optics.cases import rough, small_lens, small_space, store_result, write_problem
from tests.optics.exchange.export.cases import names, ply_faults
from tests.optics.interface.commands.cases import refused, run
from thbcad import write_lens
from thbcad.cad.exchange import read_step
from thbcad.lens import placed_surfaces
from thbcad.moulds import BodyOptions
from thbcad.surfaces import THBSurface

LENS = small_lens(sag=rough(small_space()))
FACTORS = (1.004, 0.99, 1.012)


@pytest.fixture
def native(tmp_path):
    write_lens(LENS, tmp_path / "lens.json")
    return tmp_path / "lens.json"


@pytest.mark.parametrize("name", [*SOLIDS, *MESHES, "dat", "xyz", "x3p", "npz", "svg", "dxf"])
def test_every_format_holds_the_enlarged_lens(capsys, native, tmp_path, name):
    """Its checks compare the file with the enlarged lens, and the report says the factors."""
    out = tmp_path / f"body.{name}"
    done = run(capsys, "export", native, "--out", out, "--chord", 0.02, "--shrinkage", 0.4, -1, 1.2)
    assert (done.code, done.err) == (0, "")
    assert "enlarged for shrinkage, by 1.004 in x, 0.99 in y and 1.012 in z" in done.out
    stored = json.loads((tmp_path / f"body.{name}.json").read_text())
    assert stored["shrinkage_percent"] == [0.4, -1, 1.2]
    assert stored["factors"] == pytest.approx(FACTORS, rel=1e-15)


def test_poles_of_an_enlarged_file_are_those_of_the_design_times_the_factors(capsys, native, tmp_path):
    """An aperture is enlarged with the lens; OCCT reads the poles, within 1e-15 of the greatest."""
    options = ["--aperture", 4.5, 4.0, "--shrinkage", 0.5]
    assert run(capsys, "export", native, "--out", tmp_path / "body.step", *options).code == 0
    poles = read_step(tmp_path / "body.step").rear.coefficients
    wanted = placed_surfaces(LENS)[1].coefficients * 1.005
    assert (abs(poles - wanted) <= 1e-15 * abs(wanted).max(axis=(0, 1))).all()


@pytest.mark.parametrize("name", ["step", "stl"])
def test_no_shrinkage_changes_no_byte(capsys, native, tmp_path, name):
    for word, options in (("plain", []), ("zero", ["--shrinkage", 0])):
        assert run(capsys, "export", native, "--out", tmp_path / f"{word}.{name}", *options).code == 0
    assert (tmp_path / f"plain.{name}").read_bytes() == (tmp_path / f"zero.{name}").read_bytes()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--shrinkage", 0.5, 0.4], "--shrinkage: shrinkage must be one number, or three"),
        (["--shrinkage", "nan"], "--shrinkage: shrinkage must be a finite number"),
        (["--shrinkage", 100], "at most 50 per cent in size, got 100"),
        (["--shrinkage", 1, 2, 3, "--flange", 2, 0.5, 1], "as wide along x as along y"),
        (["--shrinkage", 1, "--mount", "mount.toml"], "--shrinkage"),
        (["--cavity", "front", "--back", 0], "must lie below z = 0 mm, which the front reaches, got 0 mm"),
        (["--cavity", "rear", "--back", 7], "insert must lie above z = 8.51581793 mm"),
        (["--cavity", "rear", "--back", "nan"], "back must be a finite number"),
        (["--cavity", "rear", "--flange", 2, 0.5, 1], "an insert is one solid within an outline"),
        (["--back", 7], "--back is that of an insert"),
    ],
    ids=str,
)
def test_what_a_mould_cannot_be_is_refused_in_a_sentence(capsys, native, tmp_path, options, words):
    assert words in refused(capsys, "export", native, "--out", tmp_path / "body.step", *options)
    assert names(tmp_path) == ["lens.json"]


OUTLINES = {
    "its own": [],
    "aperture": ["--aperture", 4.5, 4.0],
    "polygon": ["--polygon", -4, -3, 4, -3, 0, 4],
}


@pytest.mark.parametrize(
    ("outline", "word", "name"),
    [*(("its own", "rear", name) for name in SOLIDS), *((o, "front", "step") for o in OUTLINES)],
)
def test_an_insert_is_the_negative_of_its_surface(capsys, native, tmp_path, outline, word, name):
    """The checks compare its poles bit for bit; front, lens and rear fill a block to the last cubic mm."""
    out = tmp_path / f"insert.{name}"
    options = ["--cavity", word, "--back", -4 if word == "front" else 12, *OUTLINES[outline]]
    done = run(capsys, "export", native, "--out", out, *options)
    assert (done.code, done.err) == (0, "")
    stored = json.loads((tmp_path / f"insert.{name}.json").read_text())
    assert stored["ok"]
    assert any(f"{word} poles and knots" in check["name"] for check in stored["checks"])
    assert any("back poles and knots" in check["name"] for check in stored["checks"])
    assert (name == "step") == any("text of the file" in check["name"] for check in stored["checks"])


@pytest.mark.every(3)
@pytest.mark.parametrize("options", OUTLINES.values(), ids=OUTLINES)
def test_inserts_and_lens_fill_a_block(capsys, native, tmp_path, options):
    """16 mm high over the outline, each volume by OCCT to the 1e-6 that is asked of its integral."""
    volumes = []
    for piece in ([], ["--cavity", "front", "--back", -4], ["--cavity", "rear", "--back", 12]):
        assert run(capsys, "export", native, "--out", tmp_path / "s.step", *piece, *options).code == 0
        volumes.append(read_step(tmp_path / "s.step").volume)
    area = {0: 400, 3: np.pi * 4.5 * 4, 7: 28}[len(options)]
    assert sum(volumes) == pytest.approx(16 * area, rel=2e-6)


DOME = {
    "lens.outline": "round",
    "lens.thickness": 14.0,
    "lens.front.half_width": [10.0, 10.0],
    "lens.front.radius": -15.0,
    "lens.rear.half_width": [24.0, 24.0],
    "lens.rear.radius": -36.0,
    "lens.rear.conic": -1.0,
    "lens.clear_aperture": [22.8, 22.8],  # 9.5 of the front
    "lens.body.draft": 2.0,
    "lens.body.annulus": True,
}


@pytest.fixture
def dome(tmp_path):
    """A result whose rear has a sag, and whose problem asks for a body."""

    def stored(height=0.0, **keys):
        problem = load_problem(write_problem(tmp_path, DOME | keys))
        lens = System(problem).base
        sag = THBSurface(lens.rear.sag.space, rough(lens.rear.sag.space, height))
        store_result(tmp_path / "result", problem, lens.with_sags([sag]))
        return tmp_path / "result"

    return stored


@pytest.mark.slow
@pytest.mark.parametrize(("radius", "name"), [(radius, name) for radius in (0.0, 0.3) for name in SOLIDS])
def test_the_body_of_a_result_is_exported_and_read_back(capsys, dome, tmp_path, name, radius):
    """Also enlarged: front and rear bit for bit, and the volume of the closed form."""
    result = dome(0.02, **{"lens.body.edge_radius": radius})
    done = run(capsys, "export", result, "--out", tmp_path / f"body.{name}", "--shrinkage", 0.5)
    assert (done.code, done.err) == (0, "")
    stored = json.loads((tmp_path / f"body.{name}.json").read_text())
    assert stored["ok"]
    if name == "step":
        named = read_step(tmp_path / "body.step").face_names
        assert {"front", "rear", "land"} < set(named)
        assert any(word.startswith("radius") for word in named) == bool(radius)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "radius"), [("stl", 0.0), ("glb", 0.3)])
def test_the_mesh_of_a_result_is_that_of_its_body(capsys, dome, tmp_path, name, radius):
    """trimesh finds it closed, on front and rear and on walls and land within the chord, and its volume."""
    result = dome(0.02, **{"lens.body.edge_radius": radius})
    done = run(capsys, "export", result, "--out", tmp_path / f"body.{name}", "--chord", 0.05)
    assert (done.code, done.err) == (0, "")
    assert "volume against the closed form" in done.out
    stored = json.loads((tmp_path / f"body.{name}.json").read_text())
    assert stored["checks"][-1]["name"].startswith("edges against the exact surfaces")


@pytest.mark.slow
def test_a_mesh_of_another_body_shows(tmp_path):
    """Half a degree of draft is 0.009 mm for each mm from the parting line."""
    lens = small_lens()
    body, other = (Body(moulded=BodyOptions(draft)) for draft in (3.0, 3.5))
    mesh = other.mesh(lens, 0.01, single=False)
    assert ply_faults(tmp_path, lens, mesh, 0.01, body) == ["edges against the exact surfaces"]


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("keys", "options", "words"),
    [
        ({}, ["--aperture", 5, 5], "lens.body makes the walls of the solid"),
        ({}, ["--shrinkage", 1, 1, 2], "the draft of lens.body needs one --shrinkage"),
        ({"lens.clear_aperture": [23.9998, 23.9998], "lens.body.land": -4.5}, [], "eats the clear aperture"),
        ({"lens.body.parting": 6.0}, [], "must lie below the rear's rim"),
        ({"lens.body.edge_radius": 9.0}, [], "make lens.body.draft or edge_radius smaller"),
        ({}, ["--format", "svg"], "a drawing shows the lens without lens.body"),
    ],
    ids=str,
)
def test_a_body_that_a_mould_cannot_make_is_refused(capsys, dome, tmp_path, keys, options, words):
    out = tmp_path / f"body.{options[1] if '--format' in options else 'step'}"
    assert words in refused(capsys, "export", dome(**keys), "--out", out, *options)
