"""The light of a finished lens while its place, its index, its source and its target change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import reduce
from math import inf, isfinite
from numbers import Real
from operator import add

from optics.base.runtime import Backend, UserError
from optics.light.analysis import unit_mean
from optics.light.blur import spot_rms
from optics.scene.problem import Problem
from optics.scene.system import System, solvable_system
from optics.tolerancing.perturbations import (
    NOMINAL,
    LightJudge,
    LightNumbers,
    PerturbedLight,
    tolerances_of,
)
from thbcad.checks import Floats
from thbcad.lens import Lens

DIVERGENCE, WIDEST = "source.divergence", 1.0  # degrees: four times that of the sun
# how far the others go: of the front's half-width, degrees, 1, %, of the distance of the target
ACROSS, TURNED, INDEX, SIZE, AWAY = 0.1, 5.0, 0.05, 50.0, 0.25
LEAST_PIXELS = 2  # of a target, in each direction


@dataclass(frozen=True)
class Knob:
    """A number of a scene that goes from low to high, in a unit.  value : of the design."""

    name: str
    unit: str
    value: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class ExploredLight:
    """Light on the target beside what is asked for, (rows, columns), both of mean 1, and its numbers."""

    irradiance: Floats = field(repr=False)
    target: Floats = field(repr=False)
    numbers: LightNumbers


class Explorer:
    """The map from values of knobs to the light of a lens, traced exactly on fewer pixels.

    Knobs are tolerances, see `tolerances_of`, that are added to the design, and the half-angle of a beam.

    backend : of double precision.  pixels : of the longer side of the target, at most.

    Raises UserError : see `PerturbedLight`.
    """

    def __init__(self, system: System, backend: Backend, pixels: int) -> None:
        problem, source = system.problem, system.problem.source
        part = min(1.0, pixels / max(problem.target.pixels))
        fewer = tuple(max(LEAST_PIXELS, round(part * n)) for n in problem.target.pixels)
        self._problem = problem.with_(**{"target.pixels": fewer})
        self._shapes, self._backend = system.shapes, backend
        self._divergence = source.half_divergence
        self._judge = self._judge_at(self._divergence)
        beam = system.source.from_afar  # whose width the lens cuts off: its divergence is its size
        reaches = _reaches(problem, system.designed, 0.0 if beam else SIZE)
        self._tolerances = {t.name: t for t in tolerances_of(system) if reaches.get(t.name)}
        known = [Knob(n, t.unit, 0.0, -reaches[n], reaches[n]) for n, t in self._tolerances.items()]
        if beam and not (source.others or problem.element):
            widest = max(WIDEST, 2 * self._divergence)
            known.append(Knob(DIVERGENCE, "degrees", self._divergence, 0.0, widest))
        self.knobs = tuple(known)

    def __call__(self, values: Mapping[str, float]) -> ExploredLight:
        """Return the light where knobs have these values, and the others those of the design.

        Raises UserError : a name of no knob, a value that is no finite number, or a divergence below 0.
        """
        self._require_values(values)
        divergence = values.get(DIVERGENCE, self._problem.source.half_divergence)
        if divergence != self._divergence:  # the last one
            self._divergence, self._judge = divergence, self._judge_at(divergence)
        errors = [t.at(values[name]) for name, t in self._tolerances.items() if values.get(name)]
        traced = self._judge.light
        light, _ = traced.estimate(reduce(add, errors, NOMINAL))
        image = unit_mean(light.irradiance / traced.screen.projection())
        return ExploredLight(image, self._judge.target, self._judge.numbers(light))

    def _require_values(self, values: Mapping[str, float]) -> None:
        known = {knob.name: knob for knob in self.knobs}
        for name, value in values.items():
            if name not in known:
                raise UserError(f"there is no knob {name!r}; there are {', '.join(known)}")
            number = isinstance(value, Real) and not isinstance(value, bool) and isfinite(value)
            if not number or (name == DIVERGENCE and value < 0):
                low, high = known[name].low, known[name].high
                raise UserError(
                    f"{name} must be a finite number, usually from {low:.4g} to {high:.4g} "
                    f"{known[name].unit}, got {value!r}"
                )

    def _judge_at(self, divergence: float) -> LightJudge:
        """Return what judges the light of a source with a divergence, degrees."""
        problem = self._problem
        if divergence != problem.source.half_divergence:
            profile = problem.source.divergence_profile if divergence else "uniform"
            changes = {DIVERGENCE: divergence, "source.divergence_profile": profile}
            problem = problem.with_(**changes)
        system = solvable_system(problem).with_shapes(self._shapes)
        light = PerturbedLight(system, self._backend)
        blur = 0.0 if light.by_cells else spot_rms(system, self._backend)
        screen = system.target.screen()
        target = system.target.irradiance(screen, problem.flux) / screen.projection()
        return LightJudge(unit_mean(target), light, blur)


def _reaches(problem: Problem, lens: Lens, size: float) -> dict[str, float]:
    """Return how far tolerances go that are explored, by name.  size : that of the source's size."""
    part, own = problem.optic.called, f"{problem.optic.called}." if problem.element else ""
    across = ACROSS * min(lens.front.half_width)
    return {
        f"{part}.decentre_x": across,
        f"{part}.decentre_y": across,
        f"{part}.tilt_x": TURNED,
        f"{part}.tilt_y": TURNED,
        f"{own}index": INDEX,
        "source.size": size,
        "target.defocus": AWAY * problem.throw if problem.throw < inf else 0.0,
    }
