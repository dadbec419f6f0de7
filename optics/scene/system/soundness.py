"""Whether a problem can be solved, and which settings do not suit it, before any tracing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from math import ceil, prod
from pathlib import Path

import numpy as np

from optics.base.runtime import UserError, speaking_of
from optics.scene.limits import limit_advice, require_limits
from optics.scene.problem import OF_PICTURES, OF_UNIFORM, Problem, freedom_of, load_problem, require_free
from optics.scene.system.lens_material import require_one_glass, with_material
from optics.scene.system.made_parts import volume_of_made
from optics.scene.system.reach import (
    require_apart,
    require_clear_of_lens,
    require_met,
    require_reachable,
)
from optics.scene.system.source import Own, source_of
from optics.scene.system.stops import require_places
from optics.scene.system.system import System

# poles of a face, and times as many as its sag has, from where a note is due; and what one takes in a file
MANY_POLES, MORE, STEP_BYTES = 10_000, 2, 76
NOTHING = Own()
SAME_FLUX = 1e-9  # relative, of rounding
CONIC_SLOPE = 2e-9  # about the slope error of a conic's spline that is within 1e-11 mm in height


def load_system(
    path: str | Path, changes: Mapping[str, object] | None = None, to_design: bool = True
) -> System:
    """Return the System of a problem file that can be designed, or traced.

    changes : {dotted key: value}, in place of what the file says.

    Raises UserError : see `load_problem`, `solvable_system` and `traceable_system`; it names the file.
    """
    problem = load_problem(path, changes)
    with speaking_of(path):
        return solvable_system(problem) if to_design else traceable_system(problem)


def solvable_system(problem: Problem, own: Own = NOTHING) -> System:
    """Return the System of a problem that can be designed.  own : see there.

    Raises UserError : as `traceable_system`; no free surface, limits of light that is not requested, a target
        that no lens can light.
    """
    require_free(problem.optic)
    system = traceable_system(problem, own)
    require_judged(system)
    require_reachable(system)
    return system


def traceable_system(problem: Problem, own: Own = NOTHING) -> System:
    """Return the System of a problem that can be traced; it may have no free surface.  own : see there.

    Raises UserError : limits that contradict each other, a prescription that makes no lens, a picture that
        cannot be read, a source or a target that lies in the lens, a material that is not known, a lens with
        two indices, a stop in the lens, before the source or behind the target, blur of a row of elements.
    """
    made_of = with_material(problem)
    require_one_glass(made_of)
    require_limits(made_of)
    if own.source and not np.isclose(own.source.flux, problem.flux, rtol=SAME_FLUX, atol=0.0):
        raise UserError(
            f"the flux of the script's source, {own.source.flux:g}, must be that of the problem, "
            f"{problem.flux:g}, by which shares of light are counted; give both the same"
        )
    told = source_of(problem).told
    system = System(problem.with_(**told) if told else problem, own=own)
    _ = (
        system.target.light,
        system.base,
        system.source.profile,
        system.wavelengths,
    )  # built now, so that errors come now
    require_room(system)
    start = system.unshaped.path.before if system.source.collimated else -np.inf
    require_places(problem, system.unshaped.elements, system.stops, start)
    require_light(system)
    require_sharp(system)
    return system


def require_light(system: System) -> None:
    """Refuse a beam whose picture is dark wherever it meets the front.

    Raises UserError : names the picture and the half-widths.
    """
    source, front = system.problem.source, system.base.front
    if not system.source.collimated:
        return
    met = (np.array([-1.0, 1.0]) * min(1.0, f / s) for s, f in zip(source.half_width, front.half_width))
    if not system.source.profile.shares(*met).any():
        raise UserError(
            "source.image is dark wherever it meets the lens; make source.half_width smaller or "
            f"{system.problem.optic.key('front.half_width')} larger"
        )


def require_judged(system: System) -> None:
    """Refuse limits of uniform light where a formula varies, and limits of a picture where it does not.

    Raises UserError : names the key.
    """
    if system.problem.target.kind != "function":
        return
    uniform, limits = system.target.uniform_region is not None, system.problem.verify
    shape = "is uniform where it is lit" if uniform else "varies over the target"
    for f in fields(limits):
        idle = OF_PICTURES if uniform else OF_UNIFORM
        if f.metadata.get("only") == idle and getattr(limits, f.name) != f.default:
            raise UserError(
                f"verify.{f.name} has no effect with target.formula, whose light {shape}; leave it out, "
                f"which is {f.default:g}"
            )


def require_sharp(system: System) -> None:
    """Refuse blur of light that meets more than one lens or one mirror.

    Raises UserError : names the faces that light meets.
    """
    if system.blurred and not system.lone_lens and len(system.problem.faces_met) > 1:
        raise UserError(
            "the blur of a diverging beam and of rough surfaces is known of one lens or one mirror, and "
            f"light meets {', '.join(system.problem.face_names)}; take a source without "
            "divergence, which sunlight has, and set every slope_rms to 0"
        )


def require_room(system: System) -> None:
    """Refuse a source that lies in the lens, and a target plane that cuts it.

    Raises UserError : names the planes and the extent of the surfaces.
    """
    problem, lens, source = system.problem, system.base, system.problem.source
    if problem.element:
        require_met(system)
        require_apart(system)
        if not system.target.far_field:
            require_clear_of_lens(system)
        return
    x, y = (min(s, h) for s, h in zip(source.half_width, lens.front.half_width))
    front = min(0.0, float(lens.front.conic(x, y)))
    if source.lone and system.source.extended and front <= -source.distance:
        raise UserError(
            f"the source touches the lens or lies in it: its plane is z = {0.0 - source.distance:g} mm "
            f"and the front reaches to z = {front:.4g} mm there; "
            "make source.distance larger or source.half_width smaller"
        )
    starts = system.source.starts()
    if starts is not None:
        (u, v, z), (a, b) = starts, lens.front.half_width
        within = (np.abs(u) <= a) & (np.abs(v) <= b)
        depth = (z[within] - lens.front.conic(u[within], v[within])).max(initial=-np.inf)
        if depth >= 0:
            raise UserError(
                f"the source starts up to {depth:.4g} mm behind the front; "
                "make source.distance larger, or move source.position to -z"
            )
    conic = max(0.0, float(lens.rear.conic(*lens.rear.half_width)))
    top = conic + freedom_of(problem.optic.rear)
    distance = problem.target.distance
    if distance is not None and system.target.receiver.across_axis:
        if distance <= top:
            less = f"; or make z_freedom less than {distance - conic:.4g} mm" * (distance > conic)
            raise UserError(
                f"target.distance must be greater than {top:.4g} mm, to where the rear surface may reach, "
                f"got {distance:g}{less}"
            )
    elif not system.target.far_field:
        require_clear_of_lens(system)


def advice(system: System) -> list[str]:
    """Return sentences about settings that do not suit the problem, and about missed limits.

    The limits are those that the lens misses before optimisation.
    """
    problem = system.problem
    options, sentences = problem.optimizer, [*system.source.assumed]
    if system.source.emitter and (options.window in ("cells", "pixel") or options.lost_flux_weight > 1):
        sentences.append(
            "an extended source blurs its light anyway: --set optimizer.window=bspline "
            "--set optimizer.lost_flux_weight=0 suit it better, and merged pixels save time: "
            "--set optimizer.merge=2"
        )
    if problem.target.zones:
        sentences += _zone_advice(system)
    free = system.unshaped.free_elements
    bent = not all(s.conic.is_paraboloid for _, shape in free for s in (shape.front, shape.rear))
    thrown = CONIC_SLOPE * system.unshaped.path.lever
    if bent and not system.target.far_field and thrown > system.traced_within.landing:
        sentences.append(
            "STEP holds conics other than paraboloids as splines, which may move landing points by "
            f"{thrown:.1g} mm at this distance; verify.landing = {problem.verify.landing:g} mm may be "
            "refused then: use conic = -1, or raise it if that will do"
        )
    if bent:
        sentences += _many_poles(system)
    return sentences + [
        sentence
        for optic, shape in free
        for sentence in limit_advice(problem.about(optic), shape, volume_of_made(optic, shape))
    ]


def _many_poles(system: System) -> list[str]:
    """Return a sentence where a conic gives a face many more poles than the finest level of its sag has."""
    free = system.freeforms[-1]
    poles = max(graph.coefficients.size for graph in system.base.graphs())
    needed = prod((n << free.finest) + free.degree for n in free.spans)
    if poles <= MANY_POLES or poles <= MORE * needed:
        return []
    key = system.problem.optic.key(system.shaped)
    return [
        f"a conic other than a paraboloid needs {poles:,} poles as a spline in the STEP file, about "
        f"{poles * STEP_BYTES / 1e6:.0f} MB, where the sag has at most {needed:,}: {key}.conic = -1 needs no "
        "extra poles, and the free surface makes up the difference; a higher "
        f"{key}.freeform.degree needs fewer"
    ]


def _zone_advice(system: System) -> list[str]:
    """Return sentences about rows that the light aimed at misses, which is no bound, since a lens may keep
    them, and about pixels too wide to see what zones are read over."""
    target, screen = system.target, system.target.screen()
    remedies = {
        "lower": "raise source.flux, or make target.half_width smaller",
        "upper": "make the zone smaller, or try a larger target.half_width or a lower source.flux",
    }
    sentences = [
        f"the smoothest light of the {system.passing:.4g} lm that pass all faces, which a design starts to "
        f"aim at, misses the {limit} limit of {', '.join(missed)}, and the design may miss it too; {remedy}"
        for limit, remedy in remedies.items()
        if target.settings.kind == "zones" and (missed := target.missed(limit == "lower"))
    ]
    sharp = not (system.blurred or system.source.extended)
    if sharp and max(screen.pitch) > target.aperture > 0:
        enough = [ceil(2 * half / target.aperture) for half in screen.half_width]
        sentences.append(
            f"zones are read over {target.aperture:g} {screen.unit}, and pixels are wider: a design does not "
            f"see what they read; --set target.pixels={enough}"
        )
    return sentences
