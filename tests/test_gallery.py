"""The gallery: its page, its pictures, and the one result that is kept whole."""

import html
import json
import re

import numpy as np
import pytest
from PIL import Image
from scipy.interpolate import NdBSpline

from benchmarks.rows.pages import own_pages
from benchmarks.rows.quotes import without_marks
from optics.exchange.results import ResultFolder, sha256_of
from optics.interface.api import Design
from optics.interface.commands import parsers
from optics.scene.problem import load_problem
from tests.cases import ROOT
from thbcad.io import parse_brep

PAGE = (ROOT / "docs" / "gallery.md").read_text("utf-8")
FOLDER, RESULT = ROOT / "docs" / "gallery", ROOT / "docs" / "result"
COMMANDS = re.findall(r"^thbcad (.*)$", PAGE, re.MULTILINE)
PROBLEMS = [command.split()[1] for command in COMMANDS if command.startswith("design ")]
LARGEST = 500  # pixels
MEGABYTE = 1 << 20


def test_the_page_is_that_of_the_stored_rows():
    ((path, text),) = own_pages(ROOT, ROOT / "benchmarks" / "gallery" / "gallery.py").items()
    assert path.name == "gallery.md"
    assert without_marks(text) == PAGE


def test_every_lens_has_its_pictures_and_they_are_small():
    named = set(re.findall(r"\(gallery/(\w+)_(scene|light|solid|mesh)\.webp\)", PAGE))
    assert len(named) == 4 * len(PROBLEMS)
    assert {path.name for path in FOLDER.iterdir()} == {f"{name}_{kind}.webp" for name, kind in named}
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < 4 * MEGABYTE
    for path in FOLDER.iterdir():
        with Image.open(path) as picture:
            assert max(picture.size) <= LARGEST


def test_the_lenses_cover_all_kinds_of_sources_targets_and_free_surfaces():
    problems = [load_problem(ROOT / path) for path in PROBLEMS]
    assert len({problem.title for problem in problems}) >= 12
    assert {problem.target.kind for problem in problems} == {"image", "tophat", "function", "zones"}
    assert {problem.source.kind for problem in problems} == {"collimated", "point", "lambertian", "luminaire"}
    free = [(p.optic.front.freeform is not None, bool(p.optic.rear.freeform)) for p in problems]
    assert set(free) == {(False, True), (True, False), (True, True)}


@pytest.mark.parametrize("command", COMMANDS)
def test_the_commands_of_the_page_are_commands(command):
    name, *arguments = command.split()
    parsers()[1][name].parse_args(arguments)
    assert [word for word in arguments if word.startswith("examples/") and not (ROOT / word).exists()] == []


def test_the_kept_result_is_read_by_this_version():
    design = Design.load(RESULT)
    metrics = json.loads((RESULT / "metrics.json").read_text("utf-8"))
    assert design.metrics["rel_l2"] == metrics["rel_l2"]
    assert metrics["step_sha256"] == sha256_of(RESULT / "lens.step")
    ResultFolder(RESULT).require_recorded(["lens.step", "report.html"])


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
