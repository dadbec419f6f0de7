"""The objective of a stage, and the cells that a stage's lens asks to refine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import gcd

import numpy as np

from optics.base.runtime import Backend, UserError
from optics.designing.optimisation.indicators import (
    mark,
    near_cells,
    promised_decrease,
    refined_once,
    vertex_knots,
)
from optics.designing.optimisation.objective import Objective
from optics.designing.optimisation.stage_plan import PROBES, Stage, last_level
from optics.designing.optimisation.zone_loss import ZoneLoss
from optics.designing.penalties import limited_part, shape_penalty
from optics.designing.starts import TransportStart, summed_over_cells
from optics.light.analysis import nonsequential_light
from optics.light.engines import Engine, Film, JointModel, LightModel, light_within, sharp_engine
from optics.light.measuring import Mirrors
from optics.scene.limits import KEPT_THICKNESS, feature_levels
from optics.scene.problem import Problem, per_level
from optics.scene.receivers import BSplineWindow, GaussianWindow, PixelWindow, with_mirror_images
from optics.scene.system import System
from thbcad.checks import Floats, Integers
from thbcad.surfaces import THBSurface

REPLICATES = 4  # of light by other ways: windows and the optimiser's steps smooth what noise is left
FINISH_DEGREE = 2  # of the B-spline window of the last pass: three pixels wide


def stage_window(problem: Problem, final: bool) -> PixelWindow | BSplineWindow | GaussianWindow:
    """Return the smooth window in which the rays of a stage are measured.

    A pixel window sees what moves across its border only: before the final stage a B-spline takes its place.
    It serves extended sources too where exact cells are asked for.
    """
    name = problem.optimizer.window
    sharp = name in ("cells", "pixel")
    window = window_named(problem, ("pixel" if final else "bspline") if sharp else name)
    assert window is not None
    return window


def window_named(problem: Problem, name: str) -> PixelWindow | BSplineWindow | GaussianWindow | None:
    """Return a window of a problem by its name, None for exact cells.

    Raises UserError : an unknown name.
    """
    o = problem.optimizer
    windows = {
        "cells": None,
        "pixel": PixelWindow(o.blur),
        "bspline": BSplineWindow(o.window_degree),
        "gaussian": GaussianWindow(o.sigma),
    }
    if not isinstance(name, str) or name not in windows:
        raise UserError(f"window must be one of {', '.join(map(repr, windows))}, got {name!r}")
    return windows[name]


def can_cross(system: System) -> list[bool]:
    """Return of every free element whether sags within z_freedom can make its surfaces cross."""
    return [
        base.least_thickness().lower <= sum(f.freedom for f in optic.free.values())
        for optic, base in system.unshaped.free_elements
    ]


def stage_film(
    system: System, stage: Stage, axes: Sequence[int] = (), fresh: tuple[int, ...] | None = None
) -> Film:
    """Return what an engine is to measure on a stage.  axes, fresh : as of `Film`."""
    if stage.exact:
        return Film(stage.screen, stage.rays, None, axes, fresh)
    window = BSplineWindow(FINISH_DEGREE) if stage.finish else stage_window(system.problem, stage.final)
    return Film(stage.screen, stage.rays, window, axes, fresh)


def stage_objective(
    system: System,
    stage: Stage,
    target: Floats,
    engine: Engine,
    axes: Sequence[int] = (),
    fresh: tuple[int, ...] | None = None,
    background: Background | None = None,
) -> Objective:
    """Return the Objective of a stage: its light, its target, and the problem's penalties.

    axes : directions of mirror symmetry, in which half of the rays may do.
    fresh : as of `Film`.
    background : light of other ways.
    """
    axes = [a for a in axes if all(Mirrors(sag.space, axes).keeps(a) for sag in system.sags)]
    engine = sharp_engine(engine) if stage.aimed else engine
    model = engine.model(system, stage_film(system, stage, axes, fresh))
    zones = None if stage.aimed else ZoneLoss.of(system.target, model.screen)
    around = None if background is None else background.image
    if background and background.within:
        model = JointModel(model, background.within, background.before)
    return penalised_objective(system, model, target, around, stage.far_sighted, zones, stage.parts)


@dataclass(frozen=True, eq=False)
class Background:
    """What a lens sends to a screen by other ways than front and rear, measured where a stage begins.

    What of it leaves by the rear follows the rear: its rays within the lens are known, and traced on.

    image : irradiance, (rows, columns), W/mm^2.
    within : of that, what leaves by the rear, as a function of the rear's sag; None where nothing follows it.
    before : image of `within` at the start.
    """

    image: Floats
    within: LightModel | None = None
    before: Floats | float = 0.0


def background(system: System, backend: Backend, film: Film, fixed: bool = True) -> Background | None:
    """Return what a lens sends to a film by other ways than front and rear; None where it is negligible.

    It is averaged with its mirror images in the film's axes.
    fixed : it counts where it cannot follow the rear, too: light in cells or blurred, a rear without a sag.
    """
    sag = system.designed.rear.sag
    follows = sag is not None and film.window is not None and not system.blurred
    if not (system.by_edges and (follows or fixed)):
        return None
    other = nonsequential_light(system, film.screen, backend.with_precision("double"), REPLICATES)
    if other.negligible:
        return None
    image = with_mirror_images(other.light.irradiance, film.axes) / 2 ** len(film.axes)
    if not follows or sag is None or other.onto_rear is None:
        return Background(image)
    within = light_within(backend, system.own_path, other.onto_rear, film)
    return Background(image, within, within.image([sag.coefficients]))


def penalised_objective(
    system: System,
    model: LightModel,
    target: Floats,
    background: Floats | None = None,
    far_sighted: bool = False,
    zones: ZoneLoss | None = None,
    parts: int = 1,
) -> Objective:
    """Return the Objective of a light model with the penalties of a problem."""
    options, limits, shapes = system.problem.optimizer, system.problem.limits, []
    for (optic, shape), crosses in zip(system.free_elements, can_cross(system)):
        kept = crosses and not limits.thickness
        own = replace(limits, thickness=KEPT_THICKNESS * shape.thickness) if kept else limits
        shapes.append(limited_part(optic, shape, own))
    return Objective(
        model,
        target,
        lost_flux_weight=options.lost_flux_weight,
        dark_flux_weight=options.dark_flux_weight,
        shape=shape_penalty(shapes, options.roughness_weight),
        background=background,
        far_sighted=far_sighted,
        zones=zones,
        parts=parts,
    )


def marked_cells(
    system: System, stage: Stage, axes: Sequence[int], indicators: Indicators
) -> list[dict[int, Integers]]:
    """Return the cells of every free surface to refine after a level ({} after the last)."""
    problem = system.problem
    sags = system.sags
    if stage.level == last_level(problem):
        return [{}] * len(sags)
    alpha, out = per_level(problem.refinement.alpha, stage.level), []
    if system.source.several:  # a map of one source does not tell where their light needs detail
        alpha = 0.0
    for surface, sag, finest, indicator in zip(
        system.free_surfaces, sags, feature_levels(problem), indicators(system, stage)
    ):
        indicator, near = Mirrors(sag.space, axes).of_cells(indicator), near_cells(sag.space, surface.outline)
        out.append(mark(sag.space, indicator, alpha, min(stage.level + 1, finest), near))
    return out


@dataclass(frozen=True, eq=False)
class Indicators:
    """The refinement indicators of a design.

    Called with (system, Stage) they return numbers per leaf cell of every free surface.  Only the last one
    has slopes to compare with, after a transport start: "slope" takes vertex gradients for the rest.
    """

    engine: Engine
    target: Floats
    start: TransportStart | None

    def __call__(self, system: System, stage: Stage) -> list[Floats]:
        indicator = system.problem.refinement.indicator
        if indicator == "decrease":
            sags = system.sags
            spaces = [refined_once(sag.space, f.finest) for sag, f in zip(sags, system.freeforms)]
            finer = [
                THBSurface(space, sag.space.prolongation(space) @ sag.coefficients)
                for sag, space in zip(sags, spaces)
            ]
            objective = self._objective(system.with_sags(finer), stage)
            coefficients = [sag.coefficients for sag in finer]
            gradients = objective(coefficients).gradients
            probes = zip(*objective.curvature(coefficients, PROBES, system.problem.run.seed))
            return [
                promised_decrease(sag.space, space, g, p)
                for sag, space, g, p in zip(sags, spaces, gradients, probes)
            ]
        if indicator == "vertex" or not self.start:
            return self.vertex(system, stage)
        misfit = np.sqrt(self.start.misfit(system.sags[-1]))
        return [misfit] if len(system.freeforms) == 1 else [*self.vertex(system, stage)[:-1], misfit]

    def vertex(self, system: System, stage: Stage) -> list[Floats]:
        """Return the sum of the vertex gradients over every leaf cell of every free surface (thesis 6.2)."""
        rectangles = [surface.half_width for surface in system.free_surfaces]
        spans = [f.spans for f in system.freeforms]
        knots = [
            vertex_knots(h, [_vertices(n, s) for n, s in zip(stage.rays, row)])
            for h, row in zip(rectangles, spans)
        ]
        sags = system.sags
        objective = self._objective(system, stage)
        gradients = objective.vertex_gradients([sag.coefficients for sag in sags], knots)
        return [
            summed_over_cells(sag.space, kv_x.greville(), kv_y.greville(), gradient)
            for sag, (kv_x, kv_y), gradient in zip(sags, knots, gradients)
        ]

    def _objective(self, system: System, stage: Stage) -> Objective:
        return stage_objective(system, stage, self.target, self.engine)


def _vertices(rays: int, spans: int) -> int:
    """Return a vertex count near `rays` whose vertices lie on no knot line (mirror symmetry stays)."""
    steps = rays
    while gcd(steps, 2 * spans) > 1:
        steps += 1
    return steps + 1
