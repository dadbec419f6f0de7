"""`thbcad check`: what a problem asks for, and what would be done, without tracing."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from dataclasses import asdict

from optics.analysis import dark_fraction
from optics.commands.outcome import Outcome
from optics.etendue import etendue_note
from optics.optimisation import stages, surfaces_can_cross
from optics.runtime import speaking_of
from optics.system import OpticalSystem, advice, load_system, skip_lines


def check(options: Namespace) -> Outcome:
    """Read a problem without tracing."""
    system = load_system(options.problem)
    with speaking_of(options.problem):
        return _checked(system)


def _checked(system: OpticalSystem) -> Outcome:
    problem = system.problem
    picture, screen = system.target.light, system.target.screen()
    dark = dark_fraction(system.target.irradiance(screen, problem.source.flux))
    least, volume = system.lens.least_thickness(), system.lens.volume()
    plan = stages(system, problem.optimizer.start == "transport")
    data = {
        "title": problem.title,
        "picture_pixels": list(picture.shape[::-1]),
        "target_pixels": list(screen.pixels),
        "dark_share": dark,
        "least_thickness_mm": least.value,
        "least_thickness_at_mm": [least.u, least.v],
        "volume_mm3": volume,
        "skips": [asdict(skip) for skip in system.skips],
        "levels": [
            {
                "level": s.level,
                "pixels": list(s.screen.pixels),
                "rays": list(s.rays),
                "iterations": s.iterations,
            }
            for s in plan
        ],
    }
    lines = [
        f"{problem.title}: the problem is valid",
        f"picture {_by(picture.shape[::-1])}, target {_by(screen.pixels)} pixels, {dark:.0%} of them dark",
        f"least thickness {least.value:.4g} mm at x = {least.u:.4g}, y = {least.v:.4g} mm; "
        f"volume {volume:.6g} mm^3",
    ]
    lines += [
        f"level {s.level}: {_by(s.screen.pixels)} pixels, {_by(s.rays)} rays, {s.iterations} iterations"
        for s in plan
    ]
    if surfaces_can_cross(system):
        lines.append(
            "note: z_freedom is larger than the least thickness; a design that uses it fully would be refused"
        )
    lines += skip_lines(system.skips)
    lines += [f"note: {sentence}" for sentence in [*advice(system), *etendue_note(system)]]
    return Outcome(data, lines)


def _by(size: Sequence[int]) -> str:
    return f"{size[0]} x {size[1]}"
