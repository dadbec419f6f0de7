"""The light of a STEP file by numpy and scipy, which `thbcad bench pixels` takes as its reference."""

import ast
from fractions import Fraction

import numpy as np
import pytest

from optics.base.runtime import load_backend
from optics.light.analysis import cell_irradiance
from optics.scene.problem import load_problem
from optics.scene.system import System
from oracles import step_light
from oracles.error_measures import relative
from oracles.exact_cells import area_within, signed_area
from oracles.step_light import Beam, Pixels, cell_image, read_rear
from tests.cases import EXAMPLES, ROOT
from tests.optics.cases import target_z
from thbcad import write_step

COUNTS = 128, 256  # cells in each direction


@pytest.fixture(scope="module")
def system():
    changes = {
        "target.pixels": [48, 48],
        "lens.rear.freeform.spans": [5, 5],
        "lens.rear.freeform.max_level": 1,
    }
    return System(load_problem(EXAMPLES / "pearl.toml").with_(**changes))


@pytest.fixture(scope="module")
def lens(system):
    """Return a lens whose rear is refined in a corner and bent by 0.02 mm."""
    sag = system.base.rear.sag.refine({0: [(0, 0), (0, 1), (1, 0), (1, 1)]})
    rng = np.random.default_rng(5)
    return system.base.with_sags([type(sag)(sag.space, 0.02 * rng.standard_normal(sag.space.dim))])


def images(lens, system, path, counts=COUNTS):
    write_step(lens, path)
    source, screen = system.problem.source, system.target.screen()
    beam = Beam(source.half_width, source.flux, lens.index, target_z(system.problem))
    pixels = Pixels(screen.half_width, screen.pixels)
    return [cell_image(read_rear(path), beam, pixels, count) for count in counts]


def test_the_light_of_the_text_is_that_of_mapped_cells(lens, system, tmp_path):
    """Both errors fall with the cells' size squared: left is a third of what doubling them changes."""
    backend, screen = load_backend("double", 1), system.target.screen()
    text = images(lens, system, tmp_path / "lens.step")
    path, source = system.with_lens(lens).path, system.source
    cells = [cell_irradiance(path, screen, source.cells((n, n)), backend)[0] for n in COUNTS]
    left = [relative(*pair) / 3 for pair in (text, cells)]
    assert max(left) < 0.01
    assert relative(text[1], cells[1]) < sum(left)


def test_a_quadrilateral_lights_pixels_by_its_exact_area():
    """Against clipping in rational numbers; areas of unit pixels err by rounding, some 1e-15."""
    rng = np.random.default_rng(2)
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * 2.6 + 0.4 + 0.3 * rng.random((40, 4, 2))
    image = np.zeros((4, 4))
    step_light._lay(image, (corners[..., 0].T, corners[..., 1].T), np.ones(40))
    exact = np.zeros((4, 4))
    for quad in corners:
        points = [(Fraction(row), Fraction(column)) for column, row in quad]
        for i, j in np.ndindex(4, 4):
            exact[i, j] += area_within(points, i, j) / signed_area(points)
    np.testing.assert_allclose(image, exact, rtol=0, atol=40 * 1e-14)


def test_a_lens_that_bends_the_beam_before_its_rear_is_refused(lens, system, tmp_path):
    other = system.problem.with_(**{"lens.front.radius": 200.0, "lens.front.conic": -1.0})
    with pytest.raises(ValueError, match="a plane front"):
        images(System(other).base, system, tmp_path / "lens.step", (8,))


def test_it_shares_no_code_with_what_it_checks():
    tree = ast.parse((ROOT / "oracles" / "step_light.py").read_text("utf-8"))
    froms = {n.module for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    plain = {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    assert not [name for name in froms | plain if name.startswith(("thbcad", "optics", "oracles"))]
