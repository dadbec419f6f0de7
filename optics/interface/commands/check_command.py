"""`thbcad check`: what a problem asks for, what would be done, and what lens to expect."""

from __future__ import annotations

import shlex
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from optics.base.runtime import note, speaking_of
from optics.designing.etendue import UNBOUND, etendue_notes
from optics.designing.optimisation import Stage, can_cross
from optics.designing.prediction import (
    Expectation,
    blur_limits,
    blur_sentence,
    diffraction,
    displaced_limits,
    displaced_sentence,
    expectation_lines,
    expected,
    foreseen_misses,
    resolved,
)
from optics.designing.starts import STEEP, spot_system
from optics.interface.api import require_engine
from optics.interface.commands.outcome import Outcome
from optics.interface.commands.problem_options import system_of
from optics.interface.screens import Heading, check_screen
from optics.light.analysis import dark_fraction
from optics.light.outgoing import fire_warning
from optics.scene.keys import AUTO
from optics.scene.limits import position
from optics.scene.system import System, advice

MANY_FACES = 12  # that light meets, from where on a check takes more than some seconds
SMALL = 1.0  # mm: lenses and targets of less may have been given in metres


def check(options: Namespace) -> Outcome:
    """Read a problem and say what to expect of its lens, without optimising."""
    system = system_of(options)
    if (faces := len(system.problem.faces_met)) > MANY_FACES:
        note(f"light meets {faces} faces; each takes seconds to compile, so that this may take minutes")
    with speaking_of(options.problem):
        require_engine(system)
        backend, chosen = system.backend, any(free.z_freedom == AUTO for free in system.freeforms)
        system, start = resolved(system, backend)
        expectation, plan = expected(system, backend, start)
        fire = fire_warning(system, expectation.concentration)
        data = _data(system, plan) | {"expected": asdict(expectation), "fire": fire}
        picture, least = system.target.light, system.base.least_thickness()
        limits = blur_limits(spot_system(system, backend), backend) if system.blurred else None
        displaced = displaced_limits(system)
        waves = diffraction(system, expectation.least, lambda: expectation.blur or 0.0)
        missed = foreseen_misses(system, expectation, limits, backend, displaced)
        data["missed"] = missed
        asked = "picture" if system.problem.target.kind == "image" else "light asked for"
        urgent = [*filter(None, [fire]), *_notes(system, expectation, chosen)]
        etendue = etendue_notes(system)
        notes = [*urgent, *etendue.limits]
        if etendue.background and not etendue.limits:
            notes.append("etendue forbids nothing here; `thbcad etendue` has the bounds")
        lines = [
            Heading("Problem"),
            *missed,
            f"{asked} {_by(picture.shape[::-1])}, target {_by(data['target_pixels'])} pixels, "
            f"{data['dark_share']:.0%} of them dark",
            *_side_lines(system),
            Heading("What to expect"),
            f"before optimisation: least thickness {least.value:.4g} mm {position(least)}",
            *expectation_lines(system, expectation),
        ]
        if limits is not None:
            data["blur"] = asdict(limits)
            lines.append(f"blur: {blur_sentence(system, limits)}")
        if displaced is not None:
            data["displaced"] = asdict(displaced)
            lines.append(f"plate: {displaced_sentence(displaced)}")
        if waves is not None:
            data["diffraction"] = asdict(waves)
            lines.append(f"diffraction: {waves.sentence(system.target.unit)}")
        lines += [
            Heading("Stages"),
            *(
                f"level {s.level}: {_by(s.pixels)} pixels"
                f"{f' of {_by([s.parts] * 2)} parts' * (s.parts > 1)}, "
                f"{_by(s.rays)} rays, {s.iterations} iterations"
                for s in plan
            ),
        ]
        if options.explain:
            lines += [Heading("Skipped"), *(skip.line for skip in system.skips)]
        if notes:
            lines += [Heading("Notes"), *(f"note: {sentence}" for sentence in notes)]
        words = options.words
        if set(etendue.limits) - {UNBOUND}:
            urgent.append(f"etendue limits this light; see {_command(words, 'etendue')}")
        commands = _command(words, "design"), _command(words, "check", "--full")
        return Outcome(data, lines, screen=check_screen(system, expectation, missed, urgent, commands))


def _command(words: Sequence[str], name: str, *more: str) -> str:
    """Return the command line of `check` as that of another command, for a shell.  more : options."""
    kept = [word for word in words[1:] if word not in ("--json", "--full", "--explain")]
    return shlex.join(["thbcad", name, *kept, *more])


def _side_lines(system: System) -> list[str]:
    """Return from which side a picture reads right; nothing of regions and formulas."""
    target = system.problem.target
    if target.kind != "image":
        return []
    light = "lens" if system.axial else "light"
    side, other, name = (
        (f"behind the target, looking at the {light}", f"a wall seen from the {light}'s side", "lens")
        if target.seen_from == "behind"
        else (f"the {light}'s side, as on a wall", "a screen seen from behind", "behind")
    )
    return [f"the picture reads right from {side}; for {other}: --set target.seen_from={name}"]


def _data(system: System, plan: Sequence[Stage]) -> dict[str, Any]:
    """Return what is certain before a design."""
    screen, least = system.target.screen(), system.base.least_thickness()
    return {
        "title": system.problem.title,
        "picture_pixels": list(system.target.light.shape[::-1]),
        "picture_seen_from": system.problem.target.seen_from,
        "target_pixels": list(screen.pixels),
        "dark_share": dark_fraction(system.target.irradiance(screen, system.problem.flux)),
        "least_thickness_mm": least.value,
        "least_thickness_at_mm": [least.u, least.v],
        "volume_mm3": system.unshaped.as_possible()[0].made.volume(),
        "skips": [asdict(skip) for skip in system.skips],
        "levels": [
            {
                "level": s.level,
                "pixels": s.pixels,
                "rays": list(s.rays),
                "iterations": s.iterations,
            }
            for s in plan
        ],
    }


def _notes(system: System, expectation: Expectation, chosen: bool) -> list[str]:
    """Return sentences about what does not suit the problem.  chosen : whether z_freedom was left to us."""
    notes = [*_unit_notes(system), *filter(None, [expectation.note])]
    if any(can_cross(system)) and not chosen:
        notes.append(
            "z_freedom is larger than the least thickness; a penalty keeps front and rear of a design apart"
        )
    if not system.reflects and expectation.reflected > STEEP:
        sentence = (
            f"{expectation.reflected:.0%} of the light is reflected at "
            f"{system.problem.surface_names[-1] or 'the rear'}, which bends it far, and "
            f"{expectation.totally:.1%} totally"
        )
        options, shared = " or ".join(expectation.nearest), ", or let both surfaces bend it"
        remedy = f"at most {STEEP:.0%} are with {options}" if options else system.problem.target.gentler
        # a note on the sag names what helps both
        shared = f"; {remedy}" + shared * (len(system.freeforms) == 1)
        notes.append(sentence + shared * (not expectation.note))
    return [*notes, *advice(system)]


def _unit_notes(system: System) -> list[str]:
    """Return a sentence of lens and target where they are so small that their lengths may be in metres."""
    target = system.target.settings
    widths = {system.problem.optic.noun: 2 * max(getattr(system.base, system.shaped).half_width)}
    if not target.far_field:
        widths["target"] = 2 * max(target.half_width)
    return [
        f"the {name} is {width:g} mm wide; every length is in mm: is it meant to be so small?"
        for name, width in widths.items()
        if width < SMALL
    ]


def _by(size: Sequence[int]) -> str:
    return f"{size[0]} x {size[1]}"
