"""`thbcad new`: a commented problem file to start from."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from optics.problem import commented_problem


def new(options: Namespace) -> tuple[dict[str, Any], list[str], bool]:
    """Print a problem file to start from."""
    text = commented_problem()
    return {"problem": text}, text.splitlines(), True
