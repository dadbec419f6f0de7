"""`thbcad new`: a commented problem file to start from."""

from __future__ import annotations

from argparse import Namespace

from optics.interface.commands.outcome import Outcome
from optics.scene.problem import commented_problem


def new(options: Namespace) -> Outcome:
    """Print a problem file to start from."""
    text = commented_problem(options.kind)
    return Outcome({"problem": text}, text.splitlines())
