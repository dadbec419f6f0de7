"""What a design aims at in the zones of its target, corrected by fresh light.

A blur that is one convolution, and the rays of an extended source, make other light than the lens does: at
the border of a wide beam a tenth more.  Where that is seen, rows aim at a (model / fresh) in place of a.
"""

from __future__ import annotations

from dataclasses import replace

from optics.designing.optimisation.level_objective import stage_objective
from optics.designing.optimisation.stage_plan import stages
from optics.designing.optimisation.state import State
from optics.light.analysis import fresh_light
from optics.light.engines import Engine
from optics.scene.system import System

ROUNDS = 3  # a beam of 1 degree before UB2: 14 %, then 26, 28 and 29 % of the 30 % that are aimed at
CLOSE = 0.02  # of a limit that is aimed at: nearer light is not worth a round


def re_aimed(system: System, shaping: System, state: State, engine: Engine) -> tuple[System, State] | None:
    """Return the system whose light a design traces with corrected aims, and the state before its last stage,
    or before the rough one that leads to it.

    None where fresh light keeps what is aimed at, and where it is that of the model.

    system : whose light counts.  shaping : whose light engine makes, with the state's sags at the end.
    """
    if not system.target.settings.zones or not (system.blurred or system.source.extended):
        return None
    shaped = shaping.with_sags(state.sags)
    plan = stages(shaping, state.started_from_transport)
    screen, target = plan[-1].screen, shaped.target
    objective = stage_objective(shaped, plan[-1], target.irradiance(screen, 1.0), engine)
    model = objective.image([sag.coefficients for sag in state.sags]) / screen.projection()
    fresh = fresh_light(system.with_shapes(shaped.shapes), system.backend)
    corrections, missed = [], False
    for row, seen in zip(target.zone_rows(screen), system.target.zone_rows(system.target.screen())):
        value = seen.reading(fresh[None]).value
        least, greatest = seen.aims(fresh)
        missed |= value < (1 - CLOSE) * least or value > (1 + CLOSE) * greatest
        corrections.append(row.reading(model[None]).value / value if value > 0 else 1.0)
    if not missed:
        return None
    # the light is asked for as before
    other = shaping.with_target(replace(target, corrections=tuple(corrections), given=target.light))
    again = 2 if any(stage.rough for stage in plan) else 1
    return other, replace(state, stage=len(plan) - again)
