"""What is kept of every level of a design: its lens, its light, and where the loss still pulls."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from optics.designing.optimisation import Indicators, Stage
from optics.exchange.results import lens_of, read_arrays
from optics.interface.api.irradiance_model import unit_of
from optics.light.analysis import Measurement, measure, rel_l2
from optics.light.engines import Engine
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.io import json_text, lens_to_dict
from thbcad.lens import Lens


@dataclass(frozen=True, eq=False)
class LevelRecord:
    """A level of a design, as it was behind its optimisation.

    name : such as "level 3" or "finish".  lens : of several free elements the last.
    gradients : for every free surface of the lens, front first, the sum of |dL/dz| of a grid of vertices over
        every leaf cell (thesis 6.2).
    measurement : irradiance, target and metrics of its lens.  unit : of scripts, see `unit_of`.
    """

    name: str
    lens: Lens = field(repr=False)
    gradients: tuple[Floats, ...] = field(repr=False)
    measurement: Measurement = field(repr=False)
    unit: float = field(default=1.0, repr=False)

    @property
    def irradiance(self) -> Floats:
        """On the target's pixels, (rows, columns), W/mm^2; in the far field W/sr."""
        return self.unit * self.measurement.irradiance

    @property
    def metrics(self) -> dict[str, Any]:
        return self.measurement.metrics


class LevelKeeper:
    """Keeps a record of every level of a run; call it as `seen` of the design loop.

    system : that measures.  traced, engine : what the design traces, see `shaping_by`.
    """

    def __init__(self, system: System, traced: System, engine: Engine) -> None:
        self._system, self._traced, self._engine = system, traced, engine
        self.records: list[LevelRecord] = []

    def __call__(self, stage: Stage, shaped: System, target: Floats) -> None:
        lens = shaped.designed
        traced, system = (s.with_shapes(shaped.shapes) for s in (self._traced, self._system))
        measurement = measure(system, system.backend)
        gradients = tuple(Indicators(self._engine, target, None).vertex(traced, stage)[-len(lens.sags) :])
        record = LevelRecord(stage.name, lens, gradients, measurement, unit_of(self._system))
        if stage.name in (names := [kept.name for kept in self.records]):  # aimed again
            self.records[names.index(stage.name) :] = []
        self.records.append(record)


def level_contents(level: LevelRecord) -> tuple[bytes, bytes]:
    """Return what a result keeps of a level: its lens as JSON, and its arrays as .npz."""
    buffer = io.BytesIO()
    arrays: dict[str, Any] = {f"gradients_{k}": g for k, g in enumerate(level.gradients)}
    arrays |= {"irradiance": level.measurement.irradiance, "target": level.measurement.target}
    np.savez_compressed(buffer, name=np.array(level.name), **arrays)
    return json_text(lens_to_dict(level.lens)).encode(), buffer.getvalue()


def read_levels(
    folder: Path, files: Sequence[tuple[str, str, str]], system: System
) -> tuple[LevelRecord, ...]:
    """Return the levels that a result folder keeps.  files : names as of `level_files`."""
    levels = []
    for lens, arrays, _ in files:
        data = read_arrays(folder / arrays, ("irradiance", "target"))
        irradiance, target = data["irradiance"], data["target"]
        gradients = tuple(data[key] for key in sorted(data) if key.startswith("gradients_"))
        name = str(data.get("name", lens))
        measurement = Measurement(irradiance, target, {"rel_l2": rel_l2(irradiance, target)})
        read = lens_of(folder / lens, "run the design again")
        levels.append(LevelRecord(name, read, gradients, measurement, unit_of(system)))
    return tuple(levels)
