"""What a worker does of a sweep: one variant, from its changes to its metrics and a small picture."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from optics.exchange.results import data_of
from optics.interface.api import Design, design
from optics.reporting.view import block_means
from optics.scene.problem import Problem
from thbcad.io import lens_to_dict

PICTURE = 96  # pixels, at most, of the larger side
GAMMA = 2.2  # of screens: without it dark parts could not be told apart
WHITE = 1.25  # times the most that is asked for: ripples on it are still seen


@dataclass(frozen=True)
class Shared:
    """What all variants share.

    files : content of the files that they name, by path: workers see no disk of the client.
    """

    problem: Problem
    files: Mapping[str, bytes]


class Designed(NamedTuple):
    """What is known of a variant.  picture : PNG.  lens : as in lens.json, "" where it is not kept."""

    metrics: dict[str, float | int | str | bool | None]
    picture: bytes
    lens: str


class Work(NamedTuple):
    """A variant to be designed.  keep_lens : its lens is sent back too."""

    changes: dict[str, Any]
    keep_lens: bool


def designed(shared: Shared, work: Work) -> Designed:
    """Design a variant on one thread.

    Raises UserError, NumericalError : as `design`.
    """
    problem = shared.problem.with_(**work.changes)
    problem = replace(problem, run=replace(problem.run, threads=1))
    with TemporaryDirectory() as folder:
        tables: dict[str, Any] = {}
        for table, part, path in data_of(problem):
            local = Path(folder) / (table + Path(path).suffix)
            local.write_bytes(shared.files[path])
            tables[table] = replace(part, **{part.data: str(local)})
        made = design(replace(problem, **tables))
        if made.interrupted:
            raise KeyboardInterrupt
        judged = made.verdict.data() | {"notes": "; ".join(made.verdict.notes)}
        metrics = _flat(judged | dict(made.metrics))
        lens = json.dumps(lens_to_dict(made.lens), separators=(",", ":")) if work.keep_lens else ""
        return Designed(metrics, _picture(made), lens)


def _flat(metrics: Mapping[str, Any], prefix: str = "") -> dict[str, float | int | str | bool | None]:
    """Return metrics by dotted name; lists are left out."""
    flat: dict[str, float | int | str | bool | None] = {}
    for name, value in metrics.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{name}.")
        elif value is None or isinstance(value, float | int | str):
            flat[prefix + name] = value
    return flat


def _picture(made: Design) -> bytes:
    """Return the light on the target as a small grey PNG, with the curve of a screen."""
    import numpy as np
    from PIL import Image

    side = -(-max(made.irradiance.shape) // PICTURE)
    grey = block_means(made.irradiance, side) / max(WHITE * float(made.target.max()), 1e-300)
    buffer = io.BytesIO()
    levels = np.rint(255 * np.clip(grey, 0, 1) ** (1 / GAMMA)).astype(np.uint8)
    Image.fromarray(levels).save(buffer, "png")
    return buffer.getvalue()
