"""The thesis's method for a lens, run with this project's tracer: batches of Adam steps between refinements.

Every batch minimises the Frobenius norm ||E - T|| (5.4) on all pixels with a Gaussian window of one
pixel; coefficients are kept within z_freedom by an arctangent (4.33); cells are refined by vertex
gradients (6.3).  The step sizes of the thesis are known from figures only: here one that halves
from batch to batch.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from optics.engines import TracedModel
from optics.optimisation import MARGIN, Objective, mark, summed_over_cells, transmitted_flux, vertex_knots
from optics.runtime import Backend
from optics.system import OpticalSystem
from optics.target import GaussianWindow
from optics.tracing import Tracer
from thbcad import Lens, THBSurface

BATCHES, ITERATIONS = 6, 250
RATE, FALL = 0.03, 0.5  # of the squashed coefficients, and how it falls from batch to batch
ALPHA = 0.1
RAYS = (513, 513)
VERTICES = (450, 450)  # of Table 6.3


def adam_batches(system: OpticalSystem, backend: Backend) -> Iterator[Lens]:
    """Yield the lens after every batch of a system with a free rear."""
    lens, screen = system.lens, system.target.screen(1, MARGIN)
    target = system.target.irradiance(screen, transmitted_flux(system, backend))
    rays, freeform = system.source.rays(RAYS), system.problem.lens.rear.freeform
    for batch in range(BATCHES):
        tracer = Tracer(backend, lens, rays, system.target.z)
        objective = Objective(TracedModel(backend, tracer, screen, GaussianWindow(1.0)), target, 0.0)
        sag = _batch(backend, objective, lens.rear.sag, freeform.freedom, RATE * FALL**batch)
        lens = lens.with_sags([sag])
        yield lens
        knots = vertex_knots(lens.rear.half_width, VERTICES)
        (gradient,) = objective.vertex_gradients([sag.coefficients], [knots])
        indicator = summed_over_cells(sag.space, *(kv.greville() for kv in knots), gradient)
        lens = lens.with_sags([sag.refine(mark(sag.space, indicator, ALPHA, batch + 1))])


def _batch(backend: Backend, objective: Objective, sag: THBSurface, bound: float, rate: float) -> THBSurface:
    """Return the best sag of ITERATIONS Adam steps."""
    from drjit.opt import Adam

    dr, Float = backend.dr, backend.Float
    optimizer = Adam(lr=rate)
    optimizer["x"] = backend.array(np.tan(np.clip(sag.coefficients / bound, -0.999, 0.999) * np.pi / 2))
    least, best = np.inf, sag.coefficients
    for _ in range(ITERATIONS):
        x = optimizer["x"].numpy()
        coefficients = bound * 2 / np.pi * np.arctan(x)
        found = objective([coefficients])
        norm, (gradient,) = np.sqrt(found.loss), found.gradients
        if norm < least:
            least, best = norm, coefficients
        dr.set_grad(optimizer["x"], Float(gradient / (2 * norm) * bound * 2 / np.pi / (1 + x * x)))
        optimizer.step()
    return THBSurface(sag.space, best)
