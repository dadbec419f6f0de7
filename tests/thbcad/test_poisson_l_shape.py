"""examples/poisson_l_shape.py: its errors are those of nutils, its rates those of the theory."""

import importlib.util

import numpy as np
import pytest

from tests.cases import EXAMPLES

PATH = EXAMPLES / "poisson_l_shape.py"
PATCHES = [[[0, 3], [1, 4]], [[1, 4], [2, 5]]]
CORNERS = [(0, -1), (0, 0), (1, 0), (-1, -1), (-1, 1), (1, 1)]


@pytest.fixture(scope="module")
def solutions():
    spec = importlib.util.spec_from_file_location("poisson_l_shape", PATH)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.solutions


def test_the_script_is_short():
    assert len(PATH.read_text("utf-8").splitlines()) <= 40


@pytest.mark.slow
def test_the_error_on_refined_cells_is_that_of_nutils(solutions):
    """Only the values on the boundary are interpolated otherwise: by L2 projection."""
    mesh, function, solver = (pytest.importorskip(f"nutils.{n}") for n in ("mesh", "function", "solver"))
    *_, (space, error) = solutions(2, 100, True)
    topology, place = mesh.multipatch(patches=PATCHES, patchverts=CORNERS, nelems=1)
    for level in range(space.levels - 1):
        x, y = topology.sample("gauss", 1).eval(place).T  # centres
        v = np.maximum(-x, y)
        u = np.where(-x > y, y + 1, x + 1 + 2 * v) / (1 + v)
        topology = topology.refined_by(np.flatnonzero(space.cells[space.locate(u, v), 0] > level))
    basis = topology.basis("th-spline", degree=2)
    assert (len(topology), len(basis)) == (len(space.cells), space.dim)
    x, y = place
    exact = (x**2 + y**2) ** (1 / 3) * np.cos(2 / 3 * np.arctan2(x + y, y - x))  # the angle from the diagonal
    area, trial = function.J(place), basis @ function.Argument("c", basis.shape)
    slope = [function.grad(f, place) for f in (trial, trial - exact)]
    on_edge = topology.boundary.integral((trial - exact) ** 2 * area, degree=10)
    fixed = solver.optimize("c", on_edge, droptol=1e-12)
    c = solver.optimize("c", topology.integral(slope[0] @ slope[0] * area, degree=5), constrain=fixed)
    square = topology.refined.integral(slope[1] @ slope[1] * area, degree=5)
    assert error == pytest.approx(np.sqrt(square.eval({"c": c})), rel=0.01)


def test_uniform_cells_have_the_rate_of_the_corner(solutions):
    """h^(2/3), and dof ~ h^-2."""
    *_, coarse, fine = (error for _, error in solutions(2, 700, False))
    assert np.log2(coarse / fine) == pytest.approx(2 / 3, abs=0.02)


@pytest.mark.every(2)
@pytest.mark.parametrize("degree", [2, 3])
def test_adapted_cells_have_the_rate_of_the_degree(solutions, degree):
    rows = np.log([(space.dim, error) for space, error in solutions(degree, 400, True) if space.dim > 60])
    assert -np.polyfit(*rows.T, 1)[0] >= degree / 2
