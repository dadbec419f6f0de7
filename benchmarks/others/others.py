"""Cases that others published: their figure as reference, ours as value; [set-ups](others.md) word for word.

With --quick one lens of every case is designed.

Run: thbcad bench others
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from benchmarks.others.beam_and_cone import cone_rows, square_rows
from benchmarks.others.hobbyist import hobby_rows
from benchmarks.others.text_and_portrait import picture_rows
from benchmarks.rows.row import Row


def rows(quick: bool = False) -> list[Row]:
    """Return the measured rows, case by case."""
    with tempfile.TemporaryDirectory() as folder:
        return [
            *square_rows(Path(folder), quick),
            *cone_rows(Path(folder), quick),
            *picture_rows(Path(folder), quick),
            *hobby_rows(Path(folder), quick),
        ]
