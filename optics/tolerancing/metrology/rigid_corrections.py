"""Which rigid re-positioning of a made lens, and of its target, gets most of the light back.

With E and T scaled to unit mean, and the derivatives J of E along the motions, the best motion is

    p = argmin |E - T + J p|^2,

by steps of Gauss and Newton: each is traced, and halved where it does not help.  J is that of two exact
traces, to both sides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optics.base.runtime import Backend
from optics.light.analysis import rel_l2, unit_mean
from optics.scene.system import System
from optics.tolerancing.perturbations import NOMINAL, Perturbation, PerturbedLight, Tolerance, tolerances_of
from thbcad.checks import Floats

MOST_STEPS = 6  # lenses that lie some pixels beside their place settle in four; tilt and decentre part slowly
HALVINGS = 3
WORTH = 0.01  # of rel_l2: what the last step must still bring
REACH = 0.5  # of a pixel: how far light moves for the derivatives
FARTHEST = 10.0  # times the usual tolerance: what light hardly shows is not moved further for a derivative
STILL = 1e-6  # of a pixel per unit: what moves no light
SAME = 1e-2  # of the greatest singular value: motions that light hardly tells apart


@dataclass(frozen=True)
class Move:
    """One motion.  amount : its part of the best re-positioning, in `unit`.

    alone, rel_l2_alone : how much of this motion alone is best to first order, and rel_l2 that it leaves.
    """

    name: str
    unit: str
    amount: float
    alone: float
    rel_l2_alone: float


@dataclass(frozen=True, eq=False)
class RigidCorrection:
    """The best re-positioning.

    moves : best alone first.  before, after : rel_l2, traced exactly.  perturbation : of all moves together.
    """

    moves: tuple[Move, ...]
    before: float
    after: float
    perturbation: Perturbation


def rigid_correction(system: System, target: Floats, backend: Backend) -> RigidCorrection:
    """Return the RigidCorrection of a made lens.

    target : the light asked for, (rows, columns), at any scale.  backend : of double precision.
    """
    light = PerturbedLight(system, backend)
    trial = _Trial(light, unit_mean(target))
    motions = _motions(light)
    total, here = NOMINAL, trial.image(NOMINAL)
    before = now = rel_l2(here, target)
    amounts = np.zeros(len(motions))
    alone = [(0.0, before)] * len(motions)
    for step in range(MOST_STEPS if motions else 0):
        derivative = trial.derivative(motions, total)
        residual = (here - trial.target).ravel()
        if step == 0:
            alone = [trial.alone(residual, column) for column in derivative.T]
        # the p of least |residual + J p|, and of two motions with the same effect half of each
        norms = np.linalg.norm(derivative, axis=0)
        norms[norms == 0] = 1.0
        wanted: Floats = np.linalg.lstsq(derivative / norms, -residual, rcond=SAME)[0] / norms
        taken, image, value = trial.searched(motions, amounts, wanted, now)
        gained, now = now - value, value
        if gained <= 0:
            break
        amounts, here, total = taken, image, _sum(motions, taken)
        if gained < WORTH * now:
            break
    moves = [
        Move(t.name, t.unit, size * amount, size * single, left)
        for (t, size), amount, (single, left) in zip(motions, amounts.tolist(), alone)
    ]
    return RigidCorrection(tuple(sorted(moves, key=lambda m: m.rel_l2_alone)), before, now, total)


def _motions(light: PerturbedLight) -> list[tuple[Tolerance, float]]:
    """Return the motions with amounts that move light by REACH, or FARTHEST where that is less.

    Parallel light does not see where along z a lens on the axis stands but by the distance of the target.
    """
    problem, motions = light.system.problem, ["decentre_x", "decentre_y", "tilt_x", "tilt_y", "tilt_z"]
    if problem.element or not light.system.source.collimated:
        motions.append("defocus")
    wanted = ["target.defocus", *(f"{problem.optic.called}.{motion}" for motion in motions)]
    pixel = float(np.mean(light.screen.pitch))
    rows = []
    for tolerance in tolerances_of(light.system):
        if tolerance.name in wanted:
            moved = light.moved_by(tolerance.at(tolerance.amount)) / tolerance.amount
            if moved > STILL * pixel:
                rows.append((tolerance, min(REACH * pixel / moved, FARTHEST * tolerance.amount)))
    return rows


def _sum(motions: list[tuple[Tolerance, float]], amounts: Floats) -> Perturbation:
    pairs = zip(motions, amounts.tolist())
    return sum((tolerance.at(size * amount) for (tolerance, size), amount in pairs), NOMINAL)


@dataclass(frozen=True, eq=False)
class _Trial:
    """A made lens that is moved.  target : of unit mean."""

    light: PerturbedLight
    target: Floats

    def image(self, perturbation: Perturbation) -> Floats:
        """Return the light, scaled to unit mean."""
        return unit_mean(self.light(perturbation)[0])

    def derivative(self, motions: list[tuple[Tolerance, float]], here: Perturbation) -> Floats:
        """Return J, (pixels, motions), by the amounts of the motions."""
        columns = []
        for tolerance, size in motions:
            ahead, behind = (self.image(here + tolerance.at(sign * size)) for sign in (1, -1))
            columns.append((ahead - behind).ravel() / 2)
        return np.stack(columns, axis=1)

    def alone(self, residual: Floats, column: Floats) -> tuple[float, float]:
        """Return the best amount of one motion, and the rel_l2 that it leaves, to first order."""
        amount = -float(column @ residual) / (float(column @ column) or 1.0)
        left = float(np.linalg.norm(residual + amount * column) / np.linalg.norm(self.target))
        return amount, left

    def searched(
        self, motions: list[tuple[Tolerance, float]], amounts: Floats, step: Floats, now: float
    ) -> tuple[Floats, Floats, float]:
        """Return (amounts, light, rel_l2) at the end of a step, halved until it helps."""
        for halving in range(HALVINGS + 1):
            taken = amounts + step / 2**halving
            image = self.image(_sum(motions, taken))
            value = rel_l2(image, self.target)
            if value < now:
                break
        return taken, image, value
