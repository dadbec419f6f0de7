"""Designs of lenses with an outline: meshes, variables and gradients keep to it."""

from dataclasses import replace

import numpy as np
import pytest

from optics.designing.optimisation.bounded_variables import BoundedVariables
from optics.designing.optimisation.indicators import mark, near_cells
from optics.light.analysis import cell_irradiance
from optics.scene.sources import collimated_beam, point_rays
from tests.optics.cases import PLANE, TARGET_Z, coefficients, rough, small_lens, small_space, tracer_to
from tests.optics.designing.optimisation.cases import SCREEN, SPHEROID, WIDE, objective_of, run, slope_at_0
from thbcad.lens import Lens
from thbcad.outlines import Outline
from thbcad.surfaces import THBSurface

ROUND = {"lens.outline": "round"}
SHAPES = {"round": 1.0, "rounded": 0.4}


def outlined(lens, share):
    """Return a lens with corners of this share of the half-widths."""
    front, rear = (
        replace(s, corners=tuple(share * h for h in s.half_width)) for s in (lens.front, lens.rear)
    )
    return Lens(front, rear, lens.thickness, lens.index)


@pytest.mark.parametrize("share", SHAPES.values(), ids=SHAPES.keys())
@pytest.mark.parametrize("kind", ["beam", "point"])
def test_the_gradient_holds_where_light_crosses_the_outline(backend, kind, share):
    """Five-point differences with h = 1e-3 mm err by h^4 / 30 of the fifth derivative and by rounding,
    1e-16 L / h, as long as no ray crosses the outline within the step: rays that would are taken out."""
    space = small_space()
    lens = outlined(small_lens(PLANE, SPHEROID, rough(space, 0.02), space=space), share)
    screen = SCREEN if kind == "beam" else WIDE
    rays = collimated_beam((10.0, 10.0), 1.0, (10.0, 10.0), (65, 63)).rays(-5.0)
    if kind == "point":
        rays = point_rays(20.0, 1.0, 32.0, 1.0, (65, 63), (0.0, 0.0))
    (hits,), _ = tracer_to(backend, lens, rays, TARGET_Z).trace(coefficients(lens))
    gauge = lens.rear.outline.gauge(hits.x.numpy(), hits.y.numpy())
    rays = replace(rays, flux=np.where(abs(gauge - 1) < 1e-3, 0.0, rays.flux + np.zeros(gauge.size)))
    seen = gauge[rays.flux > 0]
    assert 0.03 < (seen > 1).mean() < 0.6
    tracer = tracer_to(backend, lens, rays, TARGET_Z)
    objective = objective_of(backend, tracer, screen)
    at, rng, errors = coefficients(lens)[0], np.random.default_rng(3), []
    (gradient,) = objective([at]).gradients
    for _ in range(8):
        d = rng.standard_normal(at.size)
        d /= np.linalg.norm(d)
        errors.append(abs(slope_at_0(lambda h, d=d: objective([at + h * d]).loss, 1e-3) - gradient @ d))
    assert max(errors) < 1e-8 * np.linalg.norm(gradient)


def test_functions_that_see_light_are_as_fine_as_their_cells():
    """Every function of the finest level whose Greville point lies inside is active, and no cell far outside
    is refined."""
    outline, space = Outline((10.0, 10.0), (10.0, 10.0)), small_space(refined=False)
    whole = space.uniform(3)
    for _ in range(3):
        space = space.refine(near_cells(space, outline))
    u, v = whole.greville().T
    inside = outline.contains(u, v)
    have = {tuple(f) for f in space.functions.tolist()}
    assert all(tuple(f) in have for f in whole.functions[inside].tolist())
    assert space.dim < whole.dim
    u0, u1, v0, v1 = space.boxes.T
    nearest = outline.gauge(np.minimum(abs(u0), abs(u1)), np.minimum(abs(v0), abs(v1)))
    fine = space.cells[:, 0] == 3
    assert nearest[fine].max() < 1 + 4 * 1.25 / 10  # of four cells beside it, of 1.25 mm


def test_cells_far_outside_are_not_marked():
    space = small_space(refined=False).uniform(3)
    near = near_cells(space, Outline((10.0, 10.0), (10.0, 10.0)))
    marked = mark(space, np.ones(len(space.cells)), 0.5, 9, near)
    assert sum(map(len, marked.values())) == near.sum() < len(space.cells)


def test_variables_beside_the_outline_follow_and_their_gradient_is_exact():
    space, rng = small_space(), np.random.default_rng(4)
    sag = THBSurface(space, rough(space, 0.3))
    found = BoundedVariables([sag], [0.7], (), [Outline((10.0, 10.0), (10.0, 10.0))])
    w, d, g = rng.standard_normal((3, found.zeros().size))
    g = g[: space.dim]

    def at(weights):
        return found.coefficients(weights)[0][0]

    exact = found.gradient([g], found.coefficients(w)[1]) @ d
    assert (at(w + 1e-4 * d) - at(w - 1e-4 * d)) @ g / 2e-4 == pytest.approx(exact, rel=1e-7)
    assert abs(at(100 * w)).max() <= 0.7


@pytest.mark.slow
def test_a_round_lens_is_designed_with_all_light_of_its_round_beam(tmp_path, backend):
    """The beam, a disk of 9.5 mm, fits within: what the rear sends on is 0.96^2 of it, as from a square."""
    made = run(tmp_path, backend, ROUND | {"source.profile": "round"})
    assert made.lens.rear.outline.is_ellipse
    cells = made.system.source.cells((101, 101))
    _, fates = cell_irradiance(made.system.path, made.system.target.screen(), cells, backend)
    assert fates.by_name["beside_lens"] + fates.missed_rear < 1e-12
    assert fates.transmitted > 0.9
    assert made.state.history[-1].fit < 0.5 * made.state.history[0].fit
