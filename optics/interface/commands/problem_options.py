"""The problem that the arguments of a command describe: its file, and what --set and --engine change."""

from __future__ import annotations

import sys
from argparse import Namespace
from typing import Any

from optics.base.runtime import printable, speaking_of
from optics.scene.problem import Problem, assignment
from optics.scene.system import OpticalSystem


def changes_of(options: Namespace) -> dict[str, Any]:
    """Return {dotted key: value} of --set and --engine; of two values for a key the later one holds.

    Raises
    ------
    UserError : see `assignment`.
    """
    with speaking_of("--set"):
        changes = dict(assignment(text, Problem) for text in options.set)
    engine = getattr(options, "engine", None)
    return changes | ({"optimizer.engine": engine} if engine else {})


def system_of(options: Namespace) -> OpticalSystem:
    """Return the OpticalSystem of the problem file and its changes; --verbose says what tracing skips."""
    from optics.scene.system import load_system, skip_lines

    system = load_system(options.problem, changes_of(options))
    if options.verbose:
        for line in skip_lines(system.skips):
            print(f"thbcad: {printable(line)}", file=sys.stderr)
    return system
