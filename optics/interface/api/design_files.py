"""A design measured, checked and written as a result folder.

Beside the measurement, other processes export the solid and read it back, and draw where cores are to spare.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol

from optics.base.runtime import (
    Check,
    HelperProcess,
    answered,
    device,
    peak_mb,
    process_for,
    usable_cores,
    verification,
)
from optics.designing.etendue import reached_sentences
from optics.designing.optimisation import Row, stages
from optics.designing.progress import DesignProgress, Notes, RunClock
from optics.exchange.results import SCENE, ResultFolder, ResultWriter, level_files, shape_file
from optics.exchange.verification import (
    StepFile,
    light_checks,
    text_solid_checks,
)
from optics.interface.api.design_figures import DesignFigures
from optics.interface.api.level_records import LevelRecord, level_contents
from optics.light.analysis import Measurement, delivery_checks, judged
from optics.light.outgoing import lit_parts
from optics.light.tracing import LandingPoints
from optics.reporting.report import Report, light_files, report_html
from optics.scene.limits import as_data, limit_checks, manufacture_rows
from optics.scene.problem import Problem
from optics.scene.system import (
    MadePart,
    System,
    body_checks,
    designed_part,
    manufactured,
    other_limit_checks,
    other_parts,
)
from thbcad.lens import Manufacturability

SOLIDS, FIGURES = "solids", "figures"  # the work of the helper processes
HELPERS = 2
PEAK = "optics.base.runtime", "peak_mb"  # asked of a process
SHADE = "bodies that shade each other: the independent trace of the file lets its light pass them"
LEFT_OUT = "the volume by OCCT's integral, which `thbcad verify` of this folder computes"
Claims = dict[str, Any]


class FiledDesign(Protocol):
    """The data of a design that its result files hold, see `Design`."""

    @property
    def asked(self) -> Problem: ...
    @property
    def problem(self) -> Problem: ...
    @property
    def system(self) -> System: ...
    @property
    def history(self) -> tuple[Row, ...]: ...
    @property
    def notes(self) -> Notes: ...
    @property
    def levels(self) -> tuple[LevelRecord, ...]: ...
    @property
    def started_from_transport(self) -> bool: ...
    @property
    def measurement(self) -> Measurement: ...
    @property
    def metrics(self) -> dict[str, Any]: ...


@dataclass(frozen=True)
class Written:
    """A result folder and what its files claim.  metrics, verification : as metrics.json and verify.json."""

    folder: ResultFolder
    metrics: Claims
    verification: Claims


@contextmanager
def helpers(forked: bool = False) -> Iterator[tuple[HelperProcess, HelperProcess]]:
    """Yield the processes that export solids and that draw figures.  forked : as of a HelperProcess.

    OpenCASCADE and matplotlib take a second to load, each in its own; one that is not forked is used again.
    """
    with process_for(SOLIDS, forked) as solids, process_for(FIGURES, forked) as drawing:
        yield solids, drawing


class _Exports:
    """The STEP files of the elements by name, that of the designed one first."""

    def __init__(self, solids: HelperProcess, system: System, place: Callable[[str], Path]) -> None:
        parts = {"lens.step": designed_part(system)} | {p.file: p for p in other_parts(system)}
        self.files = [*parts]

        def at(file: str) -> Path:
            return place(file).absolute()  # a helper that is used again may have begun in another folder

        self.own, *self._fixed = (
            _Export(solids, part, system.problem, at(file), system if file == "lens.step" else None)
            for file, part in parts.items()
        )
        self._scene = None
        if self._fixed:
            self.files.append(SCENE)
            room = "optics.exchange.assemblies"
            written = {part.name: at(file) for file, part in parts.items()}
            self._scene = solids.ask(room, "export_scene", system, at(SCENE), False, written)

    def designed(self) -> tuple[list[Check], LandingPoints]:
        """Return the checks of the designed element's file, and where that sends light."""
        of_text = self.own.text_checks()
        checks, landing = self.own.read.result()
        return [*of_text, *checks], landing

    def others(self) -> list[Check]:
        """Return the checks of the fixed elements and of the scene, once all files are written."""
        checks = []
        for fixed in self._fixed:
            found = [*fixed.text_checks(), *fixed.read.result().checks]
            checks += [replace(check, name=f"{fixed.part.name}: {check.name}") for check in found]
        return [*checks, *(self._scene.result() if self._scene else [])]


class _Export:
    """A STEP file that another process writes and reads back.

    traced : the system whose light goes through the file: through two free faces this takes as long as the
        measurement, which is made meanwhile.
    read : the answer of `trace_back_step`, or of `read_back_step`.
    """

    def __init__(
        self,
        solids: HelperProcess,
        part: MadePart,
        problem: Problem,
        path: Path,
        traced: System | None,
    ) -> None:
        self.part, self._file = part, StepFile(path)
        ask = partial(solids.ask, "optics.exchange.verification")
        self._written: Future[list[Check]] = ask("export_step", part, problem.export.schema, path)
        self.read: Future[Any] = (
            ask("trace_back_step", traced, path)
            if traced
            else ask("read_back_step", part.made, path, problem.verify)
        )

    def text_checks(self) -> list[Check]:
        """Return the checks of the file as written, and of its text, which is read as soon as it is."""
        written = self._written.result()
        return [*written, *text_solid_checks(self._file.text, self.part.made)]


def save(design: FiledDesign, folder: ResultFolder, force: bool) -> Path:
    """Write the result folder of a design and return its path."""
    clock = RunClock(DesignProgress(lambda event: None))
    with folder.taken(design.asked, force), helpers() as (solids, drawing), device():
        write_result(design, folder, clock, solids, DesignFigures(drawing, design.system))
    return folder.path


def verified(design: FiledDesign) -> Claims:
    """Return the checks of a design's solid and light, as in verify.json."""
    system = design.system
    with process_for(SOLIDS) as solids, TemporaryDirectory() as folder, device():
        export = _Exports(solids, system, Path(folder).joinpath)
        return _verification(design, _checks(design, manufactured(system), export), export)


def _verification(design: FiledDesign, checks: Sequence[Check], export: _Exports) -> Claims:
    """Return checks as in verify.json, and what they leave out: bodies of a scene that shade light, too."""
    left_out, fates = [LEFT_OUT], design.measurement.metrics[design.system.units.key("fates")]
    shaded = sum(flux for name, flux in fates.items() if name.endswith(("blocked", "hit twice")))
    if shaded and design.system.shaded_path.bodies:
        share = shaded / sum(fates.values())
        left_out = [*left_out, f"{SHADE}; with stops and holders they take {share:.2%} of the light"]
    return verification(checks) | {"left_out": left_out}


def write_result(
    design: FiledDesign, folder: ResultFolder, clock: RunClock, solids: HelperProcess, figures: DesignFigures
) -> Written:
    """Export, measure and verify a design; then write what can be claimed of it.

    folder : taken by this run.  solids : which exports.
    """
    system = design.system
    writer = ResultWriter(folder, system)
    export = _Exports(solids, system, writer.staged)
    writer.write_design(design.history)
    plan = stages(system.shaping, design.started_from_transport)
    draw_lens = partial(figures.draw_lens, system, design.history, plan, design.levels)
    cores_to_spare = usable_cores() > HELPERS  # else drawing would keep the solid waiting
    if cores_to_spare:
        draw_lens()
    clock.lap("export")
    measurement, metrics = design.measurement, design.metrics
    system.backend.release()
    # of an extended source it takes two seconds, and that process has nothing left to do
    reached = system, measurement.metrics
    bound = solids.ask("optics.designing.etendue", "reached_sentences", *reached)
    clock.lap("measure")
    with system.backend.on_threads(usable_cores() - HELPERS):  # which are at work
        product = manufactured(system)  # while the solids are written
        checks = _checks(design, product, export)
        etendue = answered(bound, reached_sentences, *reached)
        for sentence in etendue.limits:
            design.notes(sentence)
        writer.place_steps(export.files)
        lit = lit_parts(system, system.backend)
        writer.write_claims("manufacture.json", as_data(product, lit))
        checked = writer.write_claims("verify.json", _verification(design, checks, export))
        clock.lap("verify")
        solids_peak = solids.ask(*PEAK)
        solids.done()
        if not cores_to_spare:
            draw_lens()
        figures.draw_light(system, measurement, system.backend)
        figures.photograph(system, measurement.irradiance, system.backend)
    light = light_files(
        measurement.irradiance,
        measurement.target,
        system.target.screen(),
        system.density,
        measurement.colour,
        measurement.sharp,
    )
    for name, data in light.items():
        writer.write(name, data)
    for name, (_, png) in figures.pictures.items():
        writer.write(f"figures/{name}.png", png)
    for names, level, (_, png) in zip(level_files(len(design.levels)), design.levels, figures.levels()):
        for name, data in zip(names, (*level_contents(level), png)):
            writer.write(name, data)
    clock.lap("figures")
    peaks = [solids_peak.result(), figures.process.ask(*PEAK).result()]
    metrics |= {"wall_s": dict(clock.total()), "peak_mb": peak_mb() + sum(peaks)}

    verdict = judged(metrics, checks, tuple(design.notes))
    page = Report(
        problem=design.problem,
        metrics=metrics,
        verification=checked,
        manufacture=manufacture_rows(
            product,
            design.problem.source.wavelength,
            [design.problem.optic.face_name(side) for side in ("front", "rear")],
            lit,
        ),
        pictures=figures.pictures,
        levels=figures.levels(),
        verdict=verdict,
        background=etendue.background,
        run=writer.run,
        view=figures.view(),
        parts=[*export.files[1:], *(shape_file(o.called) for o, _ in system.free_others)],
    )
    metrics = writer.write_claims("metrics.json", metrics | verdict.data())
    writer.write("report.html", report_html(page, writer.problem_text).encode())
    writer.finish(design.asked, {"ok": checked["ok"], **verdict.data()})
    folder.checkpoint.unlink(missing_ok=True)
    return Written(folder, metrics, checked)


def _checks(design: FiledDesign, product: Manufacturability, export: _Exports) -> list[Check]:
    """Return the checks of the STEP files, of what the lens delivers, and of the limits of manufacturing."""
    system, problem = design.system, design.problem
    solid, landing = export.designed()
    light = light_checks(system, landing, system.backend)  # while the others are written
    return [
        *solid,
        *export.others(),
        *light,
        *delivery_checks(design.measurement.metrics, problem.verify),
        *limit_checks(problem, product),
        *body_checks(design.asked, problem),
        *other_limit_checks(system),
    ]
