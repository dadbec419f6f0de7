"""The problem files of the pearl and of the extended source hold the thesis's tables, misprints apart."""

import numpy as np
import pytest

import optics
from tests.cases import EXAMPLES

FOLDER = EXAMPLES / "thesis"
UNIFORM = (100, 289, 961)  # degrees of freedom of Table 6.2


def beam_edge(problem):
    """Return where the ray at the middle of the beam's edge lands, mm, by Snell's law in the plane y = 0."""
    lens, x = problem.lens, problem.source.half_width[0]
    tilt = np.arctan(x / lens.rear.radius)
    deflection = np.arcsin(lens.index * np.sin(tilt)) - tilt
    drop = problem.target.distance - x * x / (2 * lens.rear.radius)
    return x + drop * np.tan(deflection)


@pytest.mark.parametrize(("name", "edge"), [("pearl", 95.7), ("pearl_as_printed", 123)])
def test_the_pearls_beam_is_smaller_than_the_target_unless_as_printed(name, edge):
    problem = optics.load_problem(FOLDER / f"{name}.toml")
    assert beam_edge(problem) == pytest.approx(edge, rel=5e-3)
    assert (beam_edge(problem) < problem.target.half_width[0]) == (name == "pearl")


def test_a_traced_beam_ends_where_snells_law_says():
    problem = optics.load_problem(FOLDER / "pearl.toml").with_(**{"target.pixels": [50, 50]})
    system = optics.System(problem)
    irradiance = system.model(system.space(), (201, 201), "cells")(np.zeros(100))
    lit = np.flatnonzero(irradiance[25] > 0)
    pixel = 2 * problem.target.half_width[0] / 50
    assert (lit[-1] - lit[0] + 1) * pixel / 2 == pytest.approx(beam_edge(problem), abs=pixel)


def test_both_nets_are_those_of_the_tables():
    pearl, extended = (
        optics.System(optics.load_problem(FOLDER / f"{name}.toml")) for name in ("pearl", "extended")
    )
    assert tuple(pearl.space(level).dim for level in range(3)) == UNIFORM
    assert extended.space().dim == 25
    assert pearl.space(5).dim == 51529
    span = extended.space(5).boxes[0]
    assert span[1] - span[0] == pytest.approx(0.25)  # mm; Table 6.3's text prints 31.25 um


@pytest.mark.parametrize("name", ["pearl", "pearl_as_printed", "extended"])
def test_light_is_measured_in_a_gaussian_of_one_pixel(name):
    problem = optics.load_problem(FOLDER / f"{name}.toml")
    assert (problem.optimizer.window, problem.optimizer.sigma) == ("gaussian", 1.0)
    assert problem.target.pixels == (256, 256)
