"""A designed lens, for scripts: measured, verified, saved and read back."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from optics.base.runtime import UserError, device
from optics.designing.optimisation import Row, stages
from optics.designing.progress import Notes
from optics.exchange.results import ResultFolder, read_arrays
from optics.interface.api.design_files import save, verified
from optics.interface.api.irradiance_model import unit_of
from optics.interface.api.level_records import LevelRecord, read_levels
from optics.interface.api.measured_design import measured
from optics.interface.relighting import given_lens, other_source, relit
from optics.light.analysis import (
    Light,
    LightEstimate,
    Measurement,
    Verdict,
    box_screen,
    contrast_error,
    delivery_checks,
    judged,
    uniformity_metrics,
)
from optics.light.blur import spot_rms
from optics.reporting.view import SceneView, scene_page, scene_paths
from optics.scene.limits import limit_checks
from optics.scene.problem import Problem, Source
from optics.scene.system import System, manufactured, other_limit_checks, solvable_system
from thbcad.checks import Floats
from thbcad.io import read_json
from thbcad.lens import Lens

if TYPE_CHECKING:
    from ipywidgets import HBox

    from optics.interface.relighting import ExploredLight
    from optics.reporting.figures import OverviewFigure
    from optics.tolerancing.machining import ToolFindings, ToolOrder
    from optics.tolerancing.metrology import AsBuilt, FileFrame, Side, Way

HISTORY, METRICS, IRRADIANCE = "history.csv", "metrics.json", "irradiance.npz"
OF_THE_RUN = (
    "run_id",
    "step_sha256",
    "grade",
    "verdict",
    "notes",
)  # keys of metrics.json that measure nothing


@dataclass(frozen=True, eq=False)
class Design:
    """A lens for a problem.  What it delivers is measured when it is first asked for, and once.

    system : the problem with a number for every "auto", and the shape of every element.
    history : a row for every evaluation.  notes : sentences on what limits the result.
    requested : the problem as it was given, with its "auto".
    wall_s : seconds by phase.  started_from_transport : it began at an optimal-transport map.
    interrupted : Ctrl-C ended the work, and this is the best lens so far.
    levels : of this run, where `run.keep` asks for them.
    read : what a result folder says of the light, in place of a measurement.

    >>> Design(System(problem))  # of the problem in the example of Problem, not optimised yet
    Design('lens', 100 degrees of freedom)
    """

    system: System
    history: tuple[Row, ...] = ()
    notes: Notes = field(default_factory=Notes)
    requested: Problem | None = field(default=None, kw_only=True)
    wall_s: Mapping[str, float] = field(default_factory=dict, kw_only=True)
    started_from_transport: bool = field(default=False, kw_only=True)
    interrupted: bool = field(default=False, kw_only=True)
    levels: tuple[LevelRecord, ...] = field(default=(), kw_only=True)
    read: Measurement | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        if not isinstance(self.system, System):
            raise UserError(
                f"a design needs the system of its problem, got {type(self.system).__name__}; "
                "optics.Design.of_lens(problem, lens) makes one of a lens"
            )

    @classmethod
    def of_lens(cls, problem: Problem, lens: Lens) -> Design:
        """Return a lens that is there already, such as `refit` makes of another program's, as a design for
        the light of a problem: nothing is optimised.

        problem : source, target and limits; the shape that its table [lens] describes gives way to `lens`.

        Raises UserError : a problem with [[element]]; a lens that does not go with the light.
        """
        asked, lens = given_lens(problem, lens)
        return cls(solvable_system(asked).with_lens(lens), requested=asked)

    @classmethod
    def load(cls, folder: str | Path) -> Design:
        """Return the design of a result folder; what it delivers is read, not measured again.

        Raises UserError : the folder holds no whole result.
        """
        results = ResultFolder(folder)
        system, record = results.read()
        levels = results.kept_levels()
        results.require_recorded([HISTORY, METRICS, IRRADIANCE, *chain.from_iterable(levels)])
        history = results.read_history()
        return cls(
            system,
            history,
            Notes(map(str, record.get("notes", ()))),
            started_from_transport=_started_from_transport(system, history),
            levels=read_levels(results.path, levels, system),
            read=_read_measurement(results.path, system),
        )

    @property
    def lens(self) -> Lens:
        """The designed lens."""
        return self.system.designed

    @property
    def asked(self) -> Problem:
        """The problem as it was given."""
        return self.requested or self.problem

    @property
    def problem(self) -> Problem:
        return self.system.problem

    @cached_property
    def measurement(self) -> Measurement:
        """Irradiance, target and metrics, by light that the optimiser has not seen."""
        if self.read is not None:
            return self.read
        with device():
            return measured(self.system, self.notes)

    @property
    def metrics(self) -> dict[str, Any]:
        """Numbers by name, see `optics.light.analysis.measure`, and those of the run."""
        return self.measurement.metrics | self.run_metrics

    @cached_property
    def verdict(self) -> Verdict:
        """The verdict on light and lens by the limits of the problem; the STEP file is not judged.

        `verify` checks that file.
        """
        problem, metrics = self.problem, self.measurement.metrics
        checks = delivery_checks(metrics, problem.verify)
        if problem.limits != type(problem.limits)():
            checks += limit_checks(problem, manufactured(self.system))
            checks += other_limit_checks(self.system)
        return judged(metrics, checks, tuple(self.notes), of_file=False)

    @property
    def run_metrics(self) -> dict[str, Any]:
        """Degrees of freedom, levels, evaluations, and the misfit of extended sources on fresh rays."""
        last = self.history[-1].stage if self.history else 0  # its search may not have made the result
        measured = [row for row in self.history if row.fresh_fit is not None and row.stage == last][-1:]
        return {
            "dof": sum(sag.space.dim for sag in self.system.sags),
            "levels": max(sag.space.levels for sag in self.system.sags),
            "evaluations": self.history[-1].evaluation if self.history else 0,
            **({"fit": measured[0].fit, "fresh_fit": measured[0].fresh_fit} if measured else {}),
        }

    @property
    def irradiance(self) -> Floats:
        """What the lens makes on the target's pixels, (rows, columns), W/mm^2; in the far field W/sr.

        For W read lm where that is `source.unit`.
        """
        return unit_of(self.system) * self.measurement.irradiance

    @property
    def target(self) -> Floats:
        """What was asked for, with the flux that leaves the lens, in the same unit."""
        return unit_of(self.system) * self.measurement.target

    def save(self, folder: str | Path, force: bool = False) -> Path:
        """Write the result folder of `thbcad design`: STEP solid, checks, report; return its path.

        force : replace what another problem or program wrote there.

        Raises UserError : the folder cannot be written, or something in it would be lost.
        """
        self._require_told("saved")
        return save(self, ResultFolder(folder), force)

    def verify(self) -> dict[str, Any]:
        """Return the checks of the lens's STEP file and of its light, as in verify.json."""
        self._require_told("verified")
        return verified(self)

    def relight(self, source: str | os.PathLike[str] | Source) -> Measurement:
        """Return what the lens delivers in other light, measured on fresh light.

        source : "sun", "led:1mm", "led:1mm@30mm", a problem file whose source is taken, or a Source.

        Raises UserError : other words, or light that does not go with the lens.
        """
        self._require_told("relit")
        if isinstance(source, str | os.PathLike):
            source = other_source(os.fspath(source), self.problem)
        with device():
            measurement = relit(self.system, source, self.system.backend)
        return measurement.in_unit(unit_of(self.system))

    def tool(self, order: ToolOrder) -> ToolFindings:
        """Return whether a tool fits the lens, how its cusps blur the light, and how it must move."""
        from optics.tolerancing.machining import tool_findings  # few designs ask

        with device():
            return tool_findings(self.system, order, self.system.backend)

    def as_built(
        self,
        file: str | Path,
        frame: FileFrame | None = None,
        surface: Side | None = None,
        align: Way = "datums",
    ) -> AsBuilt:
        """Return the lens as it was made, from measured points of its front or rear, and its light.

        file : rows x y z, a grid sag, X3P, Zygo or GXYZF.  frame : units and orientation of its numbers.
        surface : "front" or "rear"; by default the one that is freeform.
        align : "datums", the file's frame is the lens's, or "best fit".

        Raises UserError : a file that cannot be read, is cut off, or does not fit the surface.
        """
        # few designs ask
        from optics.tolerancing.metrology import default_side, light_as_built, read_measured, surface_of

        side = surface or default_side(self.lens)
        measured = read_measured(file, surface_of(self.lens, side), frame)
        with device():
            return light_as_built(
                self.system,
                measured,
                self.system.backend,
                side,
                align,
                nominal=self.measurement,
            )

    def plot(self) -> OverviewFigure:
        """Return a figure of target, irradiance and their difference."""
        from optics.reporting.figures import overview_figure  # matplotlib

        return overview_figure(self.system, self.measurement)

    def view(self) -> SceneView:
        """Return lens, rays and lit target to be turned, in a notebook or, saved, in any browser."""
        self._require_told("viewed")
        with device():
            paths = scene_paths(self.system, self.system.backend)
        return SceneView(scene_page(self.system, self.measurement.irradiance, paths))

    def explore(self, pixels: int = 128) -> HBox:
        """Return sliders for a notebook, which move the lens, its source and its target, beside the light.

        pixels : of the longer side of the target, at most; more take longer.

        Raises UserError : light that tolerances do not follow.  MissingPackage : no ipywidgets.
        """
        from optics.interface.relighting import Explorer, sliders  # few designs ask

        self._require_told("explored")
        with device():
            explorer = Explorer(self.system, self.system.backend, pixels)

        def light(values: Mapping[str, float]) -> ExploredLight:
            with device():
                return explorer(values)

        return sliders(explorer.knobs, light)

    def _require_told(self, done: str) -> None:
        """Refuse what takes the light from the problem, where a script brought its own.

        Raises UserError : names what cannot be done.
        """
        if self.system.own:
            raise UserError(
                f"a design with a source or a receiver of a script's own cannot be {done}, as no problem "
                "file describes it; take its lens, its irradiance and its metrics"
            )

    def __repr__(self) -> str:
        return f"Design({self.problem.title!r}, {self.run_metrics['dof']} degrees of freedom)"

    def _repr_html_(self) -> str:
        """Return pictures and the main numbers, for notebooks."""
        from optics.reporting.figures import overview_html  # matplotlib

        return overview_html(self.system, self.measurement, self.metrics, self.notes)


def _started_from_transport(system: System, history: Sequence[Row]) -> bool:
    """Return whether a history is that of a design which started from an optimal-transport map.

    Its stages then have other levels than those of a flat start, or the first ones no evaluations.
    """
    plan, seen = stages(system.shaping, False), {row.stage for row in history}
    skipped = any(stage.iterations and k not in seen for k, stage in enumerate(plan[: max(seen, default=0)]))
    return skipped or any(row.stage >= len(plan) or plan[row.stage].level != row.level for row in history)


def _read_measurement(folder: Path, system: System) -> Measurement:
    """Return what a result folder says of the light.

    What the verdict needs and results of thbcad 0.2 do not hold is computed from their irradiance.
    """
    arrays = read_arrays(folder / IRRADIANCE, ("irradiance", "target"))
    irradiance, target = arrays["irradiance"], arrays["target"]
    colour, sharp = arrays.get("xyz"), arrays.get("sharp")
    metrics: dict[str, Any] = read_json(folder / METRICS, "metrics")
    own = {k: v for k, v in metrics.items() if k not in OF_THE_RUN}
    if system.target.as_picture:
        own = contrast_error(own, target) | own
    elif system.target.uniform_region and "grid" not in own.get("uniformity", {}):
        with device():
            blur = spot_rms(system, system.backend)
        boxes = box_screen(system)
        assert boxes is not None, "a uniform region has boxes"
        images = [irradiance, boxes.means_of(irradiance, system.target.screen())]
        light = LightEstimate.exact(Light.of(images, 0.0, 0.0))
        own["uniformity"] = uniformity_metrics(system, light, blur)
    return Measurement(irradiance, target, own, sharp=sharp, colour=colour)
