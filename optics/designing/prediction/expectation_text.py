"""What to expect of a lens or a mirror, in words."""

from __future__ import annotations

from math import isinf

from optics.base.runtime import plain_number
from optics.designing.prediction.expectation import COARSE, LEAST_ERROR, TAKEN, Expectation
from optics.designing.prediction.sensitivity import DECENTRE, INDEX, PERIOD, RIPPLE
from optics.designing.starts import INSIDE
from optics.light.outgoing import concentration_sentence
from optics.scene.system import System

FULL = 0.999  # of a face: light that misses it does not tell how far beside it
MAPPED, SAME = "by the transport map's surface, where this design does not start", "by that surface"
MM3_PER_CM3 = 1000
NET = "a knot span of the finest mesh"


def expectation_lines(system: System, expected: Expectation) -> list[str]:
    """Return one line for each thing to expect."""
    wide, high, deep = expected.size
    heavy = "" if expected.mass is None else f", {expected.mass:.3g} g"
    shaped = getattr(system.base, system.shaped).conic
    when = "at the start of the design" if expected.from_transport else MAPPED
    again = when if expected.from_transport else SAME
    return [
        f"expected {system.problem.optic.noun}: {wide:.4g} x {high:.4g} x {deep:.3g} mm, "
        f"{expected.volume / MM3_PER_CM3:.3g} cm^3{heavy}; {system.problem.optic.face_name(system.shaped)} "
        f"with radius {shaped.radius:.4g} mm, K {shaped.constant:.3g}",
        f"sag: the transport map asks for +-{expected.sag:.3g} mm, "
        f"z_freedom allows +-{expected.freedom:.3g} mm, of which a start takes {INSIDE:.0%}",
        f"light: {expected.efficiency:.1%} of the source on the target {when}, "
        f"{expected.stray:.1%} beside it" + _blocked(expected),
        f"{_least_line(system, expected)}; {again}",
        f"{concentration_sentence(system, expected.concentration)}; {again}",
        _detail_line(system, expected),
        _error_line(system, expected),
        f"cost: about {expected.seconds:.2g} s on two cores, "
        f"about {expected.memory_mb / 1000:.2g} GB of memory",
        *_sensitivity_lines(system, expected),
    ]


def _blocked(expected: Expectation) -> str:
    """Return what share of the light is blocked, and by what; where several do, the share of each alone."""
    if round(expected.blocked, 3) == 0:
        return ""
    several = len(expected.blocking) > 1
    by = (name + f" ({share:.1%} alone)" * several for name, share in expected.blocking.items())
    return f", {expected.blocked:.1%} blocked by {', '.join(by)}"


def _least_line(system: System, expected: Expectation) -> str:
    """Return how small the faces might be in their outlines."""
    shapes = (surface.shape for surface in system.unshaped.path.surfaces)
    sizes = {name: shape.half_width for name, shape in zip(system.problem.face_names, shapes)}
    sides = []
    for name, half in expected.least.items():
        full = any(h > FULL * size for h, size in zip(half, sizes[name]))
        sides.append(f"{name} {'at least ' * full}{_by(half)} mm of {_by(sizes[name])}")
    return f"least half-width that loses no light: {', '.join(sides)}"


def _by(size: tuple[float, float]) -> str:
    return f"{size[0]:.4g} x {size[1]:.4g}"


def _detail_line(system: System, expected: Expectation) -> str:
    sizes = {"a pixel": expected.pixel, NET: expected.net}
    if expected.blur is not None:
        sizes[_blurring(system)] = expected.blur
    what = max(sizes, key=lambda name: sizes[name])
    others = ", ".join(f"{name} {_length(system, size)}" for name, size in sizes.items() if name != what)
    finer = "; a higher freeform.max_level makes it finer" if what == NET else ""
    return f"smallest detail: {_shift(system, expected, sizes[what])}, {what} ({others}){finer}"


def _blurring(system: System) -> str:
    """Return what blurs the light: the extent of the source, or its divergence."""
    if not system.blurred:
        return "the image of the source"
    if not system.source.diverging:
        return "the blur of the rough surfaces"
    sun = system.problem.source.divergence_profile == "sun"
    return "the image of the sun" if sun else "the image of the beam's angles"


def _error_line(system: System, expected: Expectation) -> str:
    if system.source.extended and not system.blurred:
        return "rel_l2: not predicted for a source with extent; the notes say what etendue forbids"
    if system.blurred:
        return f"rel_l2: not predicted for blurred light; the start, blurred, has {expected.start_rel_l2:.2g}"
    whose = " of all lenses" if system.displaced else ""
    start = f"the {'start' if expected.from_transport else 'map'}{whose} has {expected.start_rel_l2:.2g}"
    if system.target.settings.kind == "zones":
        return f"rel_l2: not predicted for zones, whose rows are what counts; {start}"
    cut = expected.sag > INSIDE * expected.freedom
    if expected.doubt and not cut and system.target.receiver.across_axis:
        return f"rel_l2: not predicted, since {expected.doubt}"
    if cut or not expected.from_transport:
        return f"rel_l2: not predicted, since the design does not start from the whole transport map; {start}"
    if expected.limit_costs:
        keys = " and ".join(f"limits.{cost.miss.key}" for cost in expected.limit_costs)
        kept = f"{start} without limits, {expected.limit_costs[0].kept:.2g} with the one that costs most"
        return f"rel_l2: not predicted, since the start keeps {keys}; {kept}"
    if whose:
        return f"rel_l2: not predicted for a plate, whose pictures are displaced; {start}"
    if expected.blocked >= TAKEN:
        taken = f"{_blocking_verb(expected)} {expected.blocked:.1%} of the light"
        return f"rel_l2: not predicted, since {' and '.join(expected.blocking)} {taken}; {start}"
    if expected.past:
        return f"rel_l2: not predicted, since light passes by elements on its way to the target; {start}"
    if expected.rel_l2 is None:
        where = "where rays spread in the lens" if system.axial else "off the axis, or on a curve"
        across = system.parallel and system.target.receiver.across_axis
        if across and expected.net > COARSE * expected.pixel:
            where = "on a mesh so much coarser than the pixels; a higher freeform.max_level makes it finer"
        elif across:
            where = "from a start so far from the light asked for"
        return f"rel_l2: not predicted {where}; {start}"
    if system.target.settings.kind == "image" and expected.rel_l2 >= LEAST_ERROR:
        basis = "by a regression that holds within 1.5 times for 18 of 20 pictures after 72 iterations"
        return f"rel_l2: about {expected.rel_l2:.2g}, {basis}; {start}"
    return f"rel_l2: below {max(expected.rel_l2, LEAST_ERROR):.2g}; {start}"


def _blocking_verb(expected: Expectation) -> str:
    """Return the verb of what blocks light."""
    return "take" if len(expected.blocking) > 1 else "takes"


def _sensitivity_lines(system: System, expected: Expectation) -> list[str]:
    shifts = expected.sensitivity
    whose = f"the {system.problem.optic.noun}" if system.source.beam else "the source"
    indices = "every index" if _glasses(system) > 1 else "index"
    by_index = [
        f"{INDEX:g} of {indices} shifts the light by {_shift(system, expected, shifts.index)} on average, "
        f"by {_length(system, shifts.index_most)} at most",
        *_dispersion_lines(system, expected),
    ]
    return [
        *([] if system.reflects else by_index),
        f"{RIPPLE * 1000:g} um of ripple with a period of {PERIOD:g} mm shifts the light by "
        f"{_shift(system, expected, shifts.ripple)}",
        f"{DECENTRE:g} mm of decentre of {whose} shifts details of the light by "
        f"{_shift(system, expected, shifts.decentre)}",
    ]


def _dispersion_lines(system: System, expected: Expectation) -> list[str]:
    """Return what the catalogue's uncertainty does, to first order in the index, and what the colours do."""
    shifts, material, lines = expected.sensitivity, system.material, []
    if material is not None and material.accuracy is not None:
        size = _shift(system, expected, shifts.grade / INDEX * material.accuracy)
        lines.append(
            f"{material.name}: another grade or melt may differ by {material.accuracy:g} in index, "
            f"which shifts the light by {size} on average"
        )
    if len(system.wavelengths) > 1:
        blue, *_, red = system.wavelengths
        falls = max((b.index - r.index for b, r in zip(blue.media, red.media)), key=abs)
        size = _shift(system, expected, shifts.colours)
        falling = "indices fall by up to" if _glasses(system) > 1 else "the index falls by"
        lines.append(
            f"from {blue.nm:.0f} to {red.nm:.0f} nm {falling} {falls:.4f}, "
            f"which shifts the light by {size} on average"
        )
    return lines


def _glasses(system: System) -> int:
    """Return how many lenses light goes through."""
    return len({face.optic.table for face in system.problem.faces_met if face.into_glass})


def _shift(system: System, expected: Expectation, size: float) -> str:
    if isinf(size):
        return "so far that none arrives"
    return f"{_length(system, size)} ({plain_number(size / expected.pixel, 2)} pixels)"


def _length(system: System, size: float) -> str:
    return f"{plain_number(size, 2)} {'degrees' if system.target.far_field else 'mm'}"
