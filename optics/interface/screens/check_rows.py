"""The first screen of `thbcad check`: lens, light, error and cost to expect, and the next command."""

from __future__ import annotations

from collections.abc import Sequence

from optics.base.runtime import plain_number
from optics.designing.prediction import LEAST_ERROR, Expectation
from optics.interface.screens.screen import Entry, Screen
from optics.scene.system import System

MM3_PER_CM3 = 1000
SHOWN = 5e-4  # of the source's light: less is not worth a word
NOTES = 3  # that are shown; all are in the full output
PERCENT = 100


def check_screen(
    system: System,
    expected: Expectation,
    missed: Sequence[str],
    notes: Sequence[str],
    commands: tuple[str, str],
) -> Screen:
    """Return the screen of a valid problem.

    missed : sentences on limits that the design may miss.  notes : sentences, the most urgent first.
    commands : that design it, and that show everything.
    """
    problem, size = system.problem, expected.size
    shown = [*(Entry("limit", sentence) for sentence in missed)]
    shown += [Entry("note", sentence) for sentence in notes[:NOTES]]
    if len(notes) > NOTES:
        shown.append(Entry("", f"{len(notes) - NOTES} more with --full"))
    design, full = commands
    return Screen(
        problem.title,
        "problem is valid" + (", but may miss its limits" if missed else ""),
        (
            Entry(
                problem.optic.noun,
                f"{size[0]:.4g} x {size[1]:.4g} x {size[2]:.3g} mm, {_amount(expected)}",
                _relief(expected),
            ),
            Entry("light", _light(expected), _detail(system, expected)),
            Entry("error", _error(system, expected), _cost(expected)),
            *shown,
            Entry("next", design, f"more: {full}"),
        ),
    )


def _amount(expected: Expectation) -> str:
    volume = f"{expected.volume / MM3_PER_CM3:.3g} cm^3"
    return volume if expected.mass is None else f"{volume}, {expected.mass:.3g} g"


def _relief(expected: Expectation) -> str:
    """Return how far the free surface departs from its base, against what z_freedom allows."""
    relation = " ideal," if expected.sag > expected.freedom else " of"
    return f"relief ±{expected.sag:.3g}{relation} ±{expected.freedom:.3g} mm allowed"


def _light(expected: Expectation) -> str:
    """Return how much light arrives; of a design with another start it is a first estimate."""
    about = "" if expected.from_transport else "roughly "
    words = f"{about}{expected.efficiency:.0%} on the target"
    words += f", {expected.stray:.1%} stray" * (expected.stray > SHOWN)
    return words + f", {expected.blocked:.1%} blocked" * (expected.blocked > SHOWN)


def _detail(system: System, expected: Expectation) -> str:
    """Return the size of the smallest detail: of a pixel, a knot span or the image of the source."""
    size = max(expected.pixel, expected.net, expected.blur or 0.0)
    unit = "degrees" if system.target.far_field else "mm"
    return f"detail down to {plain_number(size, 2)} {unit} ({plain_number(size / expected.pixel, 2)} px)"


def _error(system: System, expected: Expectation) -> str:
    """Return the rel_l2 to expect; where it cannot be predicted, that of the surface before optimisation."""
    if expected.rel_l2 is None:
        start = expected.start_rel_l2
        before = f"; start {start:.0%}" if start is not None and expected.from_transport else ""
        return f"not predicted{before}"
    if system.target.settings.kind == "image" and expected.rel_l2 >= LEAST_ERROR:
        return f"about {PERCENT * expected.rel_l2:.2g} % expected"
    return f"below {PERCENT * max(expected.rel_l2, LEAST_ERROR):.2g} % expected"


def _cost(expected: Expectation) -> str:
    return f"time about {expected.seconds:.2g} s, {expected.memory_mb / 1000:.2g} GB"
