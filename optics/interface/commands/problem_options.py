"""What arguments of several commands stand for: the problem with --set and --engine, and a picture."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

from optics.base.runtime import UserError, printable, require_file_name, speaking_of
from optics.exchange.results import require_writable
from optics.scene.keys import assignment
from optics.scene.problem import Problem
from optics.scene.system import System, load_system


def changes_of(options: Namespace) -> dict[str, Any]:
    """Return {dotted key: value} of --set and --engine; of two values for a key the later one holds.

    Raises UserError : see `assignment`.
    """
    with speaking_of("--set"):
        changes = dict(assignment(text, Problem) for text in options.set)
    engine = getattr(options, "engine", None)
    return changes | ({"optimizer.engine": engine} if engine else {})


def system_of(options: Namespace) -> System:
    """Return the System of the problem file and its changes; --verbose says what tracing skips."""
    system = load_system(options.problem, changes_of(options))
    if options.verbose:
        for skip in system.skips:
            print(f"thbcad: {printable(skip.line)}", file=sys.stderr)
    return system


def result_path(options: Namespace, ending: str = "") -> Path:
    """Return the folder to write: that of --out, else one that is named after the problem file.

    Raises UserError : that name does not suit every system.
    """
    if options.out:
        return Path(options.out)
    name = Path(options.problem).stem + ending
    require_file_name("the problem file", name, "choose a folder with --out")
    return Path("exports") / name


def picture_path(options: Namespace) -> Path | None:
    """Return where --out wants a picture, None without it; checked before any work is done.

    Raises UserError : it does not end in .png, cannot be written, or is there already, without --force.
    """
    if not options.out:
        return None
    out = Path(options.out)
    if out.suffix.lower() != ".png":
        raise UserError(f"--out must end in .png, since the picture is a PNG, got {out}")
    require_writable(out)
    if out.exists() and not options.force:
        raise UserError(f"{out} is there already; choose another --out, or replace it with --force")
    return out
