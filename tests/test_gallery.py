"""The gallery: its page, its pictures, and the one result that is kept whole."""

import html
import io
import json
import re

import numpy as np
import pytest
from PIL import Image
from scipy.interpolate import NdBSpline

from benchmarks.gallery import gallery, small_pictures
from benchmarks.gallery.gallery_page import PICTURES, commands
from benchmarks.gallery.lenses import LENSES
from benchmarks.gallery.opened_result import write_opened
from optics.api import Design
from optics.commands import own_pages, parsers
from optics.problem import load_problem
from optics.results import ResultFolder, sha256_of
from tests.cases import EXAMPLES, ROOT
from thbcad import Conic, FreeformSurface, Lens
from thbcad.io import parse_brep
from thbcad.meshes import body_mesh, to_trimesh

FOLDER, RESULT = ROOT / "docs" / "gallery", ROOT / "docs" / "result"
MEGABYTE = 1 << 20
LENS = Lens(FreeformSurface((10, 8)), FreeformSurface((10, 8), Conic(-20.0, -1.0)), 6.0, 1.5)


def test_the_page_is_that_of_the_stored_rows():
    ((path, text),) = own_pages(ROOT / "benchmarks" / "gallery" / "gallery.py").items()
    assert path.read_text("utf-8") == text


def test_every_lens_has_its_pictures_and_they_are_small():
    wanted = {f"{lens.name}_{kind}.webp" for lens in LENSES for kind in PICTURES}
    assert {path.name for path in FOLDER.iterdir()} == wanted
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < 4 * MEGABYTE
    for path in FOLDER.iterdir():
        with Image.open(path) as picture:
            assert picture.size == (small_pictures.SIDE,) * 2


def test_the_lenses_cover_all_kinds_of_sources_and_targets():
    problems = [load_problem(EXAMPLES / lens.problem) for lens in LENSES]
    assert {problem.target.kind for problem in problems} == {"image", "tophat", "function"}
    assert {problem.source.kind for problem in problems} == {"collimated", "point", "lambertian", "luminaire"}
    free = [(p.lens.front.freeform is not None, bool(p.lens.rear.freeform)) for p in problems]
    assert {(False, True), (True, False), (True, True)} == set(free)


@pytest.mark.parametrize("lens", LENSES, ids=lambda lens: lens.name)
def test_the_commands_of_the_page_are_commands(lens):
    for name, *arguments in commands(lens, "out"):
        parsers()[1][name].parse_args(arguments)
    assert all((ROOT / word).exists() for word in lens.body if word.startswith("examples/"))


def test_a_mesh_is_drawn_where_its_lens_is():
    mesh = to_trimesh(body_mesh(LENS, 0.01))
    pictures = small_pictures.lens_picture(LENS), small_pictures.mesh_picture(mesh)
    covered = [np.asarray(shown(data)).min(axis=2) < 250 for data in pictures]
    assert covered[0].mean() > 0.2
    assert (covered[0] != covered[1]).mean() < 0.01  # outlines differ by parts of a pixel


def shown(webp):
    return Image.open(io.BytesIO(webp))


def test_points_of_a_triangle_reach_its_corners_and_its_middle():
    weights = small_pictures.barycentric(4)
    assert weights.sum(axis=1) == pytest.approx(1)
    assert {tuple(row) for row in np.eye(3)} <= {tuple(row) for row in weights}
    assert np.isclose(weights, 1 / 3).all(axis=1).sum() == 1
    assert len(weights) == 10


def test_the_kept_result_is_read_by_this_version():
    design = Design.load(RESULT)
    metrics = json.loads((RESULT / "metrics.json").read_text("utf-8"))
    assert design.metrics["rel_l2"] == metrics["rel_l2"]
    assert metrics["step_sha256"] == sha256_of(RESULT / "lens.step")


def test_the_kept_solid_is_the_kept_lens():
    """scipy evaluates the splines of the STEP text."""
    lens = Design.load(RESULT).lens
    faces = {face.name: face.surface for face in parse_brep(RESULT / "lens.step").faces}
    rng = np.random.default_rng(0)
    for name, surface, vertex in (("front", lens.front, 0.0), ("rear", lens.rear, lens.thickness)):
        x, y, z = scipy_points(faces[name], rng.random((500, 2)))
        assert np.abs(vertex + surface(x, y) - z).max() < 1e-10  # mm


def scipy_points(surface, at):
    """Return points of a B-spline surface at shares of its domain (n, 2), (3, n)."""
    axes = surface.kv_u, surface.kv_v
    spline = NdBSpline(tuple(kv.knots for kv in axes), surface.coefficients, tuple(kv.degree for kv in axes))
    start, stop = (np.array([getattr(kv, end) for kv in axes]) for end in ("start", "stop"))
    return spline(start + at * (stop - start)).T


def test_the_kept_result_is_small_and_asks_no_network():
    assert sum(path.stat().st_size for path in RESULT.iterdir()) < 3 * MEGABYTE
    for name in ("report.html", "view.html"):
        text = (RESULT / name).read_text("utf-8")
        named = re.findall(r'(?:src|href)="(?!data:)([^"]*)"', html.unescape(text))
        assert [link for link in named if not (RESULT / link).exists()] == []


def test_nothing_of_the_kept_result_tells_where_it_was_made():
    for path in RESULT.iterdir():
        assert str(ROOT) not in path.read_bytes().decode("latin-1")


@pytest.mark.slow
def test_a_lens_with_another_outline_is_designed_drawn_and_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(gallery, "BUILD", tmp_path)
    names = [lens.name for lens in LENSES]
    number = 1 + names.index("tophat_circle")
    error, *_, total = gallery.rows(number)
    assert error.value < 0.006
    assert total.name == "all"
    assert set(gallery.pictures_of(LENSES[number - 1])) == set(PICTURES)
    write_opened(tmp_path / "tophat_circle", tmp_path / "kept")
    assert not (tmp_path / "kept" / "figures").exists()
    ResultFolder(tmp_path / "kept").require_recorded(["report.html", "lens.step", "irradiance.npz"])
    assert (tmp_path / "kept" / "report.html").stat().st_size < (
        tmp_path / "tophat_circle" / "report.html"
    ).stat().st_size
