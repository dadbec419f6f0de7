"""The small problem loaded and designed, and objectives over lenses with rough surfaces."""

from types import SimpleNamespace

import numpy as np

from optics.designing.optimisation.loop import Listener, shape_lens
from optics.designing.optimisation.objective import Objective
from optics.designing.optimisation.stage_plan import PROBES
from optics.light.engines import ExactEngine, TracedModel
from optics.scene.problem import load_problem
from optics.scene.receivers import BSplineWindow, Screen
from optics.scene.sources import Profile, collimated_beam, lambertian_parts
from optics.scene.system import OpticalSystem
from tests.optics.cases import TARGET_Z, hollow_lens, picture, rough, small_lens, tracer_to, write_problem
from thbcad.sags import Conic

FLAT = {"optimizer.start": "flat"}
CUBIC = BSplineWindow(3)
SPHEROID = Conic(45.0, 0.4)  # every second derivative differs from zero
SCREEN = Screen((20.0, 20.0), (48, 48), 8)


def loaded(folder, changes=None, **options):
    """Return the OpticalSystem of the small problem with changes."""
    return OpticalSystem(load_problem(write_problem(folder, changes, **options)))


def run(folder, backend, changes):
    """Return the small problem designed: problem, light, lens, state, the plan, the progress calls, the
    checkpoints and the notes."""
    system = loaded(folder, changes)
    calls, checkpoints, plans, notes = [], [], [], []

    def progress(plan, stage, dof, row):
        plans.append(plan)
        calls.append((stage, dof, row))

    lens, state = shape_lens(
        system, backend, ExactEngine(backend), listener=Listener(progress, checkpoints.append, notes.append)
    )
    assert all(plan is plans[0] for plan in plans)
    return SimpleNamespace(
        system=system,
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


def make_objective(backend, front, space, window=CUBIC, **options):
    return Objective(
        TracedModel(backend, make_tracer(backend, front, space, **options), SCREEN, window),
        asked_for(),
        100.0,
    )


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
