"""What to expect of a lens before it is designed: size, light, detail, error, time and sensitivity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod, sqrt

import numpy as np
from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter

from optics.base.runtime import Backend
from optics.designing.etendue import bounds_hold, image_half_width, one_blur_tells, usual_efficiency
from optics.designing.optimisation import (
    LimitedShapes,
    Stage,
    StartChoice,
    stages,
    transmitted_flux,
)
from optics.designing.prediction.cost import seconds_and_memory
from optics.designing.prediction.freedom_note import (
    freedom_note,
    gentler_geometries,
    is_gentle,
    narrow_rear_note,
)
from optics.designing.prediction.sensitivity import Sensitivity, sensitivity
from optics.designing.prediction.start_light import blocking, light_before
from optics.designing.starts import STEEP, RearLight, TransportStart
from optics.light.analysis import light_past_elements, past_notes
from optics.light.blur import spot_width
from optics.light.outgoing import Concentration, greatest_concentration, least_half_widths
from optics.scene.limits import LimitCost
from optics.scene.problem import Limits
from optics.scene.system import System, volume_of_made
from thbcad.checks import Floats
from thbcad.lens import mass
from thbcad.surfaces import THBSurface

# of the target in each direction, on which the start is traced: it has as many cells.  A rel_l2 of 0.150 on
# half of 4096 pixels in place of 0.174 changes the one to expect of the design from 0.0202 to 0.0195
MOST_PIXELS = 2048
# pixels to a knot span of the finest mesh, from which on it and not the picture limits the light of textures
# (pearl, 128 pixels: with 2.4 of them 0.104 and the regression 0.027, with 1.2 of them 0.029 and 0.022)
COARSE = 1.5
WIDE = 2.8  # pixels, of the Gaussian that takes the detail of a picture away
SCALE, POWER = 0.092, 0.27
JUMP = 1e-3  # of the norm: smaller jumps between pixels are none
LEAST_ERROR = 0.01  # smaller predictions say no more than that
FARTHEST = 10.0  # times a predicted rel_l2: starts that are worse do not tell where a design ends
TAKEN = 5e-4  # of the light: stops and bodies that take more change what a design can reach
SAMPLES = 129  # of the surfaces in each direction, for the lens's depth


@dataclass(frozen=True)
class Expectation:
    """What to expect of a lens.  Lengths on the target are mm, in the far field degrees.

    size : width, height and depth, mm.  volume : mm^3.  mass : g, None without a density.
    sag : mm, the greatest |c| that the map asks for.  freedom : mm, z_freedom.  note : about them, or "".
    size, volume, mass : of the lens that the design starts from.
    efficiency, stray, blocked : of the transport map's surface, share of the source's flux on the target,
        beside it, and taken by stops, bodies, a plane screen and the clear aperture.
    reflected, totally : the same at the rear, and that of it which no steeper light could leave.
    blocking : what each of these would block alone, by its name.
    nearest : options that change the target so that the rear reflects at most STEEP, where it reflects more,
        and the map tells so.
    least : half-widths of front and rear, mm, in their outline, that would lose no light of that start.
    pixel, net, blur : sizes on the target: a pixel, a knot span of the finest mesh, the image of the source
        (None without extent).
    from_transport : the design starts from the whole transport map.
    rel_l2 : predicted, None where nothing tells it: without the whole map, be it that the bound of the sag
        cuts it off, where rays spread in the lens, on a target that does not lie across the axis, of textures
        on a mesh that is coarse for their pixels, where pictures of several lenses are displaced, where stops
        or bodies take part of the light or some passes by elements, of a poor start, and of a start that is
        FARTHEST times worse.
    start_rel_l2 : of the light of the transport start along the path, None where the source has extent.
    base_rel_l2 : of the sharp light of the base surface, on merged pixels and without stops; None where it is
        not compared with the start: of a source with extent, and where z_freedom cuts off the map's surface.
    gap : of primal and dual of the transport map.  doubt : what is wrong with a poor start, or "".
    past : the sentence on light that passes by elements on its way to the target, or "".
    seconds, memory_mb : of the design.
    limit_costs : what limits of manufacture cost the light of the start, the greatest cost first.
    """

    size: tuple[float, float, float]
    volume: float
    mass: float | None
    sag: float
    freedom: float
    note: str
    efficiency: float
    stray: float
    blocked: float
    blocking: dict[str, float]
    reflected: float
    totally: float
    nearest: list[str]
    least: dict[str, tuple[float, float]]
    pixel: float
    net: float
    blur: float | None
    from_transport: bool
    rel_l2: float | None
    start_rel_l2: float | None
    base_rel_l2: float | None
    gap: float
    doubt: str
    past: str
    seconds: float
    memory_mb: float
    sensitivity: Sensitivity
    concentration: Concentration
    limit_costs: tuple[LimitCost, ...]


def expected(
    system: System, backend: Backend, start: TransportStart | None = None
) -> tuple[Expectation, list[Stage]]:
    """Return what to expect of a system whose numbers are all known, and the plan of its design.

    start : of the system, where it is known already.

    Raises UserError : the design would take too much memory, (almost) nothing passes the lens, the lens that
        it starts from cannot be made as the body that the problem describes.
    """
    stages(system.shaping, from_transport=True)  # refuses sizes before any memory is taken
    transmitted_flux(system.unshaped, backend)
    start = start or TransportStart(system, backend)
    fit = start.finest_fit()
    base = system.unshaped
    started = base.with_sags([*base.sags[:-1], fit.sag])
    flat = system.problem.optimizer.start == "flat"
    choice = None if flat else StartChoice(system.shaping, backend, start)
    first, doubt = (choice.first, choice.doubt) if choice else (None, "")
    mapped = choice is not None and choice.within and not choice.useless
    from_transport = mapped and choice is not None and choice.followed
    _ = (started if from_transport else base).made
    plan = stages(system.shaping, from_transport)
    coarsening = -(-max(system.target.settings.pixels) // MOST_PIXELS)
    fates, error = light_before(started, backend, coarsening)
    flux = system.problem.flux
    # at the last face: earlier ones have losses of their own; a lens alone says of none where light is
    # reflected totally
    at_last = len(system.problem.faces_met) - 1, -1
    kept, totally = (
        sum(lost for fate, lost in fates.flux.items() if fate.what == what and fate.number in at_last) / flux
        for what in ("reflected", "total_internal")
    )
    reflected = kept + totally
    light, _ = start.rear_slopes()
    net, pixel = _net(system, start.half_lit, light), max(system.target.screen().pitch)
    fine = net <= COARSE * pixel or system.target.uniform_region is not None
    past = light_past_elements(started, fates, system.target.screen(coarsening), backend)
    shares = past.shares(fates.on_target + past.light.on_target, flux) if past and past.missed else None
    past_sentences = past_notes({"past_elements": shares})
    undisturbed = fates.blocked < TAKEN * flux and not past_sentences
    surface = "the start" if from_transport else "the map's surface"
    costs = _limit_costs(system, backend, start, coarsening, surface)
    predictable = from_transport and start.within(fit) and fine and _is_known(system)
    optic, (seconds, memory) = system.problem.optic, seconds_and_memory(system, plan)
    shape = (started if mapped else base).designed
    count, more = volume_of_made(optic, shape)
    volume = count * shape.volume() + more
    return Expectation(
        size=_size(started if mapped else base),
        volume=volume,
        mass=mass(volume, optic.density) if optic.density else None,
        sag=max(each.asked for each in (fit, first, start.traced) if each is not None),
        freedom=system.freeforms[-1].freedom,
        note=(first and freedom_note(system, backend, start, [fit, first]))
        or narrow_rear_note(started, backend, fates.missed_rear / flux),
        efficiency=fates.on_target / flux,
        stray=fates.off_target / flux,
        blocked=fates.blocked / flux,
        blocking=blocking(started, backend, coarsening) if fates.blocked else {},
        reflected=reflected,
        totally=totally,
        nearest=gentler_geometries(system, start)
        if system.shaped == "rear" and reflected > STEEP and not is_gentle(system, start)
        else [],
        least=least_half_widths(started, backend),
        pixel=pixel,
        net=net,
        blur=_blur(started, backend),
        from_transport=from_transport,
        rel_l2=_likely(predicted_rel_l2(start.lit, error), error)
        if error and predictable and undisturbed and not costs and not doubt
        else None,
        start_rel_l2=error,
        base_rel_l2=choice.quality.base if choice and choice.quality else None,
        gap=start.gap,
        doubt=doubt,
        past=past_sentences[0] if past_sentences else "",
        seconds=seconds,
        memory_mb=memory,
        sensitivity=sensitivity(started.shaping, backend),
        concentration=greatest_concentration(started, backend),
        limit_costs=costs,
    ), plan


def _limit_costs(
    system: System, backend: Backend, start: TransportStart, coarsening: int, surface: str
) -> tuple[LimitCost, ...]:
    """Return what limits of manufacture cost the light of the map's surface on the whole mesh of the last
    level.  surface : its noun."""
    if system.problem.limits == Limits():
        return ()
    shaping = system.unshaped.shaping
    sags = *shaping.sags[:-1], start.finest_fit().sag
    shapes = LimitedShapes(shaping.with_sags(sags), start.rear_slopes()[0])
    if system.source.extended:
        return tuple(shapes.unknown_costs(sags, surface))

    def misfit(sags: Sequence[THBSurface]) -> float:
        error = light_before(system.with_sags(sags), backend, coarsening)[1]
        assert error is not None, "sources with extent are left out"
        return error

    return tuple(shapes.costs(sags, misfit, surface))


def predicted_rel_l2(target: Floats, start_error: float) -> float:
    """Return the rel_l2 that a design will reach on a picture, from it and the traced error of its start.

        rel_l2 = SCALE |T - G T| / |max_3 T - min_3 T| e^POWER

    T is the target irradiance, G a Gaussian of WIDE pixels, max_3 and min_3 are over 3 x 3 pixels, and e is
    the rel_l2 of the transport start.  The quotient says how wide the detail is compared with the jumps from
    pixel to pixel.  SCALE and POWER are a regression over every second picture of `thbcad bench untuned`.  Of
    all twenty 18 end within 1.5 times (the others 1.6 and 1.8).

    target : (rows, columns), the lit part of the target irradiance.  start_error : rel_l2 of the start.
    """
    norm = np.linalg.norm(target)
    fine = np.linalg.norm(target - gaussian_filter(target, WIDE, mode="nearest"))
    jumps = np.linalg.norm(maximum_filter(target, 3) - minimum_filter(target, 3))
    if jumps <= JUMP * norm:
        return 0.0
    return float(min(SCALE * fine / jumps * start_error**POWER, start_error))


def _likely(predicted: float, start_error: float) -> float | None:
    """Return a predicted rel_l2; None of a start that is so much worse that it tells nothing."""
    return predicted if start_error <= FARTHEST * max(predicted, LEAST_ERROR) else None


def _is_known(system: System) -> bool:
    """Return whether the regression of `predicted_rel_l2` was made of such light."""
    zones = system.target.settings.kind == "zones"
    summed = system.blurred or zones or system.displaced
    return system.parallel and not summed and system.target.receiver.across_axis


def _size(system: System) -> tuple[float, float, float]:
    """Return width, height and depth, mm; of a plate with its land."""
    lens = system.designed
    array = system.problem.optic.array
    wide, high = (2 * max(h) for h in zip(lens.front.half_width, lens.rear.half_width))
    heights = []
    for surface in (lens.front, lens.rear):
        x, y = (np.linspace(-h, h, SAMPLES) for h in surface.half_width)
        if surface.outline.is_rectangle:
            heights.append(surface.grid(x, y))
        else:
            heights.append(surface(*surface.outline.filled(*np.meshgrid(x, y))))
    front, rear = heights
    if array is not None:
        wide, high = (n * pitch for n, pitch in zip((array.columns, array.rows), array.pitches))
    return wide, high, float(lens.thickness + rear.max() - front.min())


def _net(system: System, half: Sequence[float], light: RearLight) -> float:
    """Return the mean size on the target of a knot span of the finest mesh.

    half : half-widths of the lit part of the target.
    """
    surface, freeform = getattr(system.base, system.shaped), system.freeforms[-1]
    lit = light.weight > light.weight.max() / 10
    seen = (light.x, lit.any(axis=1)), (light.y, lit.any(axis=0))
    half_lit = [float(np.ptp(at[where]) + at[1] - at[0]) / 2 for at, where in seen]
    magnification = sqrt(prod(half) / prod(half_lit))
    span = max(2 * h / (n << freeform.finest) for h, n in zip(surface.half_width, freeform.spans))
    return span * magnification


def _blur(system: System, backend: Backend) -> float | None:
    """Return the width of the images of the source: the least one that is possible, of what etendue bounds,
    else what the start makes.  None of a source without extent."""
    if bounds_hold(system) and one_blur_tells(system) and not system.blurred:
        return 2 * max(image_half_width(system.unshaped, usual_efficiency(system), 1.0))
    return spot_width(system, backend) if system.source.extended or system.blurred else None
