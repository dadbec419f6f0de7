"""The small problem small_system and designed, and objectives over lenses with rough surfaces."""

from types import SimpleNamespace

import numpy as np
import pytest

from optics.designing.optimisation.loop import Listener, shape_lens
from optics.designing.optimisation.objective import Objective
from optics.designing.optimisation.stage_plan import PROBES
from optics.light.engines import ExactEngine, TracedModel
from optics.scene.receivers import BSplineWindow, Screen
from optics.scene.sources import Profile, collimated_beam
from tests.optics.cases import (
    TARGET_Z,
    hollow_lens,
    lambertian_parts,
    picture,
    rough,
    small_lens,
    small_system,
    tracer_to,
)
from thbcad.sags import Conic

FLAT = {"optimizer.start": "flat"}
CUBIC = BSplineWindow(3)
SPHEROID = Conic(45.0, 0.4)  # every second derivative differs from zero
SCREEN = Screen((20.0, 20.0), (48, 48), 8)


def run(folder, backend, changes):
    """Return the small problem designed."""
    return designed(small_system(folder, changes), backend)


def designed(system, backend):
    """Return a system with its design: lens, state, the plan, the progress calls, the checkpoints and the
    notes."""
    calls, checkpoints, plans, notes = [], [], [], []

    def progress(plan, stage, dof, row):
        plans.append(plan)
        calls.append((stage, dof, row))

    shaped, state = shape_lens(
        system, backend, ExactEngine(backend), listener=Listener(progress, checkpoints.append, notes.append)
    )
    lens = shaped.designed
    assert all(plan is plans[0] for plan in plans)
    return SimpleNamespace(
        system=shaped,
        problem=system.problem,
        lens=lens,
        state=state,
        plan=plans[0],
        calls=calls,
        checkpoints=checkpoints,
        notes=notes,
    )


def rows_of(history, level):
    return [row for row in history if row.level == level]


def asked_for(screen=SCREEN):
    """Return an irradiance of 0.92 W without symmetry on the screen's pixels."""
    image = picture(*screen.shape).astype(float)
    return image * 0.92 / (image.sum() * screen.pixel_area)


def make_tracer(backend, front, space, rays=85, source=(9.5, 9.5)):
    beam = collimated_beam(source, 1.0, (10.0, 10.0), (rays, rays))
    return tracer_to(backend, small_lens(front, SPHEROID, space=space), beam, TARGET_Z)


def objective_of(backend, tracer, screen=SCREEN, window=CUBIC, lost_flux_weight=100.0):
    """Return the Objective of traced light before an irradiance without symmetry."""
    model = TracedModel(backend, tracer, screen, window)
    return Objective(model, asked_for(screen), lost_flux_weight)


def make_objective(backend, front, space, window=CUBIC, **options):
    return objective_of(backend, make_tracer(backend, front, space, **options), window=window)


def of_vector(objective, *spaces):
    """Return the objective as a function of one vector: the coefficients of all sags, one after the other."""
    ends = np.cumsum([space.dim for space in spaces])

    def evaluate(vector):
        found = objective(np.split(vector, ends[:-1]))
        return found.loss, np.concatenate(found.gradients)

    return evaluate


def slope_at_0(function, h):
    """Return the derivative by five points, which err by h^4 / 30 of the fifth one."""
    return (8 * (function(h) - function(-h)) - (function(2 * h) - function(-2 * h))) / (12 * h)


def check_adjoint(variables, size, most):
    """Central differences of g . c(w) with h = 1e-4, at weights of a size."""
    rng = np.random.default_rng(2)
    at, direction = (rng.standard_normal(len(variables.zeros())) for _ in range(2))
    at *= size
    made, slopes = variables.coefficients(at)
    g = [rng.standard_normal(len(c)) for c in made]
    gradient = variables.gradient(g, slopes)
    ahead, behind = (np.concatenate(variables.coefficients(at + s * direction)[0]) for s in (1e-4, -1e-4))
    difference = np.concatenate(g) @ (ahead - behind) / 2e-4
    scale = np.linalg.norm(gradient) * np.linalg.norm(direction)
    assert gradient @ direction == pytest.approx(difference, abs=most * scale)


def rough_by(height, seed=5):
    return lambda space: rough(space, height, seed)


REAR, BOTH = hollow_lens(rough_by(0.3), spans=(4, 3)), hollow_lens(rough_by(0.3), rough_by(0.1, 6), (4, 3))
GLOWING = next(lambertian_parts((0.5, 0.5), 2.0, 1.0, 40.0, Profile(), 1 << 12, 0, 1 << 40))
WIDE, ANGLES = Screen((1000.0, 1000.0), (48, 48), 8), Screen((45.0, 45.0), (48, 48), 8)


def check_counts(history):
    """Evaluations are counted one by one, and PROBES more where the optimisation of a level (or what is left
    of it) begins."""
    steps = np.diff([0] + [row.evaluation for row in history])
    assert set(steps) <= {1, 1 + PROBES}
    return int((steps > 1).sum())
