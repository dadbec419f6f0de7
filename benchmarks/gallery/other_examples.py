"""The examples that the page of the gallery does not show."""

from __future__ import annotations

import tomllib
from pathlib import Path

from benchmarks.checkout import EXAMPLES
from benchmarks.gallery.lenses import LENSES


def example_problems() -> list[Path]:
    """Return every problem file below examples/, which the table [target] tells from mounts."""
    files = sorted(EXAMPLES.rglob("*.toml"))
    return [path for path in files if "target" in tomllib.loads(path.read_text("utf-8"))]


def other_examples() -> dict[str, Path]:
    """Return the problem files of examples/ that no lens of the gallery has, by a name for their results."""
    shown = {EXAMPLES / lens.problem for lens in LENSES}
    return {
        "_".join(path.relative_to(EXAMPLES).with_suffix("").parts): path
        for path in example_problems()
        if path not in shown
    }
