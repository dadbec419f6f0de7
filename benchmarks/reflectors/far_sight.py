"""The last steps of a mirror, by a loss of the script's own that sees how far light must move.

    L(c) = ||E - T||^2 / ||T||^2 + w (D, A^-1 D) + b B^2 + a B,    D = (E - T) / sum of T,
    A = -div(P grad),    P = T / sum of T,    B = -sum of D, the share of light beside the window

With P as its weight the norm of H^-1 tends to the Wasserstein distance as E nears T.  It sees a little
light that lies far away, where T is small, which the norm of pixels does not.  Sums are over the pixels, and
lengths are those of the chart.

Source: R. Peyre, Comparison between W2 distance and H^-1 norm, and localization of Wasserstein distance,
ESAIM: COCV 24 (2018).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import csc_array, diags_array, eye_array, kron, vstack

import optics
from thbcad.checks import Floats
from thbcad.hierarchy import MultilevelBasis
from thbcad.surfaces import THBSurface

WEIGHT = 200.0  # of an rms distance: 1e-3 in u, v weighs like 1.4 % of light
DARKEST = 1e-3  # of the greatest P, from which on A has it: no cell is cut off
BESIDE = 200.0  # of light beside the window, squared; more of it leaves the pixels less close
AT_ALL = 0.3  # of the same: with the square alone a few rays go far out
FINEST = 4  # spans of half a pixel where light is brightest; finer ones gather light within pixels
CELLS = 1024, 1024  # corners of the source's
PROBES, LEAST = 8, 1e-6  # of the curvature; of its mean


def far_sighted(design: optics.Design, steps: Sequence[int]) -> optics.Design:
    """Return a design of own source and receiver after more steps, by this loss.

    steps : on its own mesh and, if there is a second number, on the mesh of level FINEST everywhere.
    """
    own, sag = design.system.own, design.lens.front.sag
    system = optics.System(design.asked, own.source, own.receiver)
    sag = _shaped(system, THBSurface(sag.space, sag.coefficients), steps[0])
    for more in steps[1:]:
        sag = _shaped(system, sag.uniform(FINEST), more)
    return replace(
        design, system=design.system.with_lens(system.lens(sag.space, sag.coefficients)), read=None
    )


def _shaped(system: optics.System, sag: THBSurface, steps: int) -> THBSurface:
    """Return a sag after steps by this loss.

    Its variables are the B-splines of all levels, scaled by the curvature of the first term (as
    `Objective.curvature`): by coefficients alone light moves far only after many steps.
    """
    basis, model = MultilevelBasis(sag.space), system.model(sag.space, rays=CELLS, window="cells")
    target, total = model.target, model.target.sum()
    share, moved = 1 / np.sum(target**2), squared_distance(target, system.problem.target.half_width)

    def loss(weights: Floats) -> tuple[float, Floats]:
        light, pull = model.vjp(sag.coefficients + basis.coefficients(scale * weights))
        off = light - target
        distance, slope = moved(off / total)
        beside = -off.sum() / total
        value = share * float(np.sum(off**2)) + WEIGHT * distance + beside * (BESIDE * beside + AT_ALL)
        slope = 2 * share * off + (WEIGHT * slope - 2 * BESIDE * beside - AT_ALL) / total
        return value, scale * basis.adjoint(pull(slope))

    rng, (_, pull) = np.random.default_rng(0), model.vjp(sag.coefficients)
    signs = rng.choice((-1.0, 1.0), (PROBES, *target.shape))
    curvature = np.mean([basis.adjoint(pull(each)) ** 2 for each in signs], axis=0)
    scale = 1 / np.sqrt(np.maximum(curvature, LEAST * curvature.mean()))
    scale /= np.sqrt(np.mean(scale**2))
    found = optics.minimise(loss, np.zeros(basis.size), iterations=steps)
    return THBSurface(sag.space, sag.coefficients + basis.coefficients(scale * found.coefficients))


def squared_distance(target: Floats, half_width: Sequence[float]) -> Callable[[Floats], tuple[float, Floats]]:
    """Return the function from D, (rows, columns), to (D, A^-1 D) and its gradient.

    What lies beside the pixels is taken as spread like T.
    """
    from scipy.sparse.linalg import splu

    share = target / target.sum()
    rows, columns = share.shape
    steps = [2 * half / n for half, n in zip(half_width, (columns, rows))]
    along = [
        diags_array([-np.ones(n - 1), np.ones(n - 1)], offsets=[0, 1], shape=(n - 1, n)) / step
        for n, step in zip((columns, rows), steps)
    ]
    slopes = vstack([kron(eye_array(rows), along[0]), kron(along[1], eye_array(columns))], format="csc")
    density = np.maximum(share, DARKEST * share.max())
    weights = np.concatenate(
        [((density[:, 1:] + density[:, :-1]) / 2).ravel(), ((density[1:] + density[:-1]) / 2).ravel()]
    )
    laplace = csc_array(slopes.T @ diags_array(weights) @ slopes)
    # potentials are those over the first pixel's, in place of which the system has no solution
    solved = splu(csc_array(laplace[1:, 1:]))

    def moved(off: Floats) -> tuple[float, Floats]:
        even = off - share * off.sum()
        potential = np.concatenate([[0.0], solved.solve(even.ravel()[1:])]).reshape(off.shape)
        potential -= np.sum(share * potential)
        return float(np.sum(even * potential)), 2 * potential

    return moved
