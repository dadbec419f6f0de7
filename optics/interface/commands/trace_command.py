"""`thbcad trace`: a designed lens traced again, sequentially and non-sequentially, and its phase space."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Any

from optics.base.runtime import UserError, load_backend
from optics.designing.prediction import diffraction_of
from optics.exchange.results import ResultFolder, require_own, writable_folder, write_recorded
from optics.interface.commands.outcome import Outcome
from optics.interface.relighting import lens_in_light, screen_words
from optics.light.analysis import (
    conservation,
    crosstalk,
    crosstalk_line,
    measure,
    nonsequential,
    passing_words,
    polarisation_change,
    polarisation_note,
    sections,
    sequential,
    sequential_metrics,
)
from optics.light.tracing import SENTENCES, fate_sentences, path_faults
from optics.reporting.report import light_files
from optics.scene.photometry import Units
from optics.scene.system import System, load_system
from thbcad.checks import Floats

MOST_RAYS, RAYS = 1 << 15, 513  # per direction
AWAY = 100.0  # mm to the screen of a lens in given light
TRIED = (65, 65)  # rays that tell whether the light can go where it is to go
RECORD = "trace.json"
SHOWN = 5e-4  # of the light: smaller losses are not printed
ENDS = {  # of the light through front and rear, by fates
    "reaches": ("on_target",),
    "is reflected": ("front_reflected", "rear_reflected", "total_internal"),
    "is absorbed": ("absorbed",),
    "is blocked": ("blocked",),
    "misses the lens": ("beside_lens",),
    "meets an edge": ("missed_rear",),
    "misses the screen": ("off_target",),
}
FILES = ("irradiance.npz", "irradiance_16bit.png", "irradiance.png")
OF_LENS = ("fresnel.png",)  # of a lens on the axis
PHASE_SPACE = ("phase_space.png",)  # of such a lens with one source, on the axis too
DIAGRAMS = ("polar.png", "isocandela.png")  # of the far field


def trace(options: Namespace) -> Outcome:
    """Trace a result, a problem or a lens in given light, and report where the light goes.

    Phase space needs a lens on the axis; stray paths are traced through any lens.
    """
    count = RAYS if options.rays is None else options.rays
    if not 8 <= count <= MOST_RAYS:
        raise UserError(f"--rays must lie between 8 and {MOST_RAYS} per direction, got {count}")
    _require_effects(options)
    system, folder = _system(options), _folder(options)
    if folder is None:
        return _answered(system)
    writable_folder(folder)
    alone = system.lens_on_axis and system.problem.source.lone
    own_files = *OF_LENS * system.lens_on_axis, *PHASE_SPACE * alone
    files = (*FILES, *own_files, *DIAGRAMS * system.target.far_field)
    require_own(folder, (*files, RECORD), RECORD, options.force)
    from optics.reporting.figures import fresnel_figure, phase_space_figure  # matplotlib

    backend = load_backend(options.precision or "double", system.problem.run.threads)
    exact = backend if options.precision != "single" else system.backend
    start = perf_counter()
    every = system.with_all_sources
    image, fates, counts = sequential(every, backend, count)
    seconds = perf_counter() - start
    contents = _light_contents(every, image, fates.transmitted)
    rays = system.own_rays(system.source.rays(TRIED))
    data: dict[str, Any] = {"seconds": seconds, **sequential_metrics(every, fates, counts)}
    data |= polarisation_change(every, every.shaded_path, exact)
    if system.lens_on_axis:
        data["etendue"] = conservation(system, exact)
    data["faults"] = path_faults(exact, system.own_path, rays)
    if system.lens_on_axis:
        contents["fresnel.png"] = fresnel_figure(exact, system.designed.index)
    if alone:
        contents["phase_space.png"] = phase_space_figure(sections(system, exact))
    if system.all_ways:
        data["nonsequential"] = nonsequential(system, exact)
    if system.problem.optic.array is not None:
        data |= crosstalk(system, exact)
    lines = [*_lines(data, system.units), *_left_out(system)]
    if waves := diffraction_of(system, exact):
        data["diffraction"] = asdict(waves)
        lines.append(f"diffraction: {waves.sentence(system.target.unit)}")
    write_recorded(folder, RECORD, data, contents)
    return Outcome(data, [*lines, f"wrote {folder}"])


def _require_effects(options: Namespace) -> None:
    """Refuse options that have no effect together.

    Raises UserError : names them.
    """
    given = {f"--{name}" for name in ("at", "material", "index") if getattr(options, name) is not None}
    if options.turn:
        given.add("--turn")
    if given and not options.source:
        raise UserError(f"{' and '.join(sorted(given))} have no effect without --source; leave them out")
    if {"--material", "--index"} <= given:
        raise UserError("--material and --index both give the index of the lens; leave one out")
    if options.source and not options.out and (options.rays or options.precision):
        raise UserError("--rays and --precision have no effect on the one line of --source; add --out DIR")


def _system(options: Namespace) -> System:
    """Return the system of a result folder or a problem file, or a lens of any file in given light."""
    path = Path(options.result)
    if options.source:
        if path.suffix.lower() == ".toml":
            raise UserError(
                f"--source goes with the file of a lens, and {path} is a problem with its own source"
            )
        glass = {"material": options.material, "index": options.index}
        glass = {key: value for key, value in glass.items() if value is not None}
        away = AWAY if options.at is None else options.at
        return lens_in_light(path, options.source, away, glass, options.turn)
    if path.suffix.lower() == ".toml":
        return load_system(path, to_design=False)
    if path.is_file():
        raise UserError(f"a lens needs light: add --source to {path}, such as --source led:1mm")
    return ResultFolder(path).read().system


def _folder(options: Namespace) -> Path | None:
    """Return the folder to write; None where one line answers."""
    path = Path(options.result)
    if options.out or options.source:
        return Path(options.out) if options.out else None
    return (Path("exports") / path.stem if path.suffix.lower() == ".toml" else path) / "trace"


def _answered(system: System) -> Outcome:
    """Report the light of a lens in one line."""
    found = measure(system, system.backend).metrics
    units, flux = system.units, system.problem.flux
    fates = found[units.key("fates")]
    shares = {
        words: sum(light for name, light in fates.items() if name in names) / flux
        for words, names in ENDS.items()
    }
    through, *lost = (
        f"{100 * share:.1f} % {words}"
        for words, share in shares.items()
        if share >= SHOWN or words == "reaches"
    )
    ghosts = 100 * found.get("nonsequential", {}).get("by_other_ways", 0.0)
    line = (
        f"{system.problem.title}: of {flux:.4g} {units.flux}, {through} {screen_words(system.problem)}; "
        f"{', '.join(lost) or 'nothing is lost'}; ghosts are {ghosts:.1f} % of the light there"
    )
    return Outcome(found, [line])


def _left_out(system: System) -> list[str]:
    """Return what is not shown, or not of all the light."""
    left_out = []
    if system.spectral:
        nm = system.problem.source.wavelength
        left_out.append(f"light by other ways, etendue and phase space are those of {nm:g} nm alone")
    if not system.lens_on_axis:
        left_out.append("phase space is left out: it is shown of a lens on the axis")
    elif not system.problem.source.lone:
        left_out.append("phase space is left out: it is shown of one source on the axis")
    elif not system.axial:
        left_out.append("phase space is shown behind the lens alone: the target does not lie across the axis")
    return left_out


def _light_contents(system: System, image: Floats, flux: float) -> dict[str, bytes]:
    """Return the files of the light by name: arrays and pictures, in the far field diagrams too.

    image : the irradiance on the target's pixels.  flux : of the light asked for.
    """
    from optics.reporting.figures import intensity_figures, irradiance_figure  # matplotlib

    screen, density = system.target.screen(), system.density
    shown = screen.projection()  # in the far field pictures are intensities
    irradiance, target = image / shown, system.target.irradiance(screen, flux) / shown
    contents = light_files(irradiance, target, screen, density)
    contents["irradiance.png"] = irradiance_figure(irradiance, screen, density)
    if not screen.angular:
        return contents
    diagrams = intensity_figures(irradiance, target, screen, density)
    return contents | {f"{name}.png": png for name, (_, png) in diagrams.items()}


def _lines(data: dict[str, Any], units: Units) -> list[str]:
    key, unit = units.key("fates"), units.flux
    rays, sentences = data["rays"], fate_sentences(data[key])
    lines = [f"{rays} rays in sequence, {data['seconds']:.3g} s"]
    for name, flux in data[key].items():
        count = f"{data['counts'][name]:>10} rays" if name in data["counts"] else " " * 15
        lines.append(f"{abs(flux):10.6f} {unit} {count}  {sentences[name]}")
    lines.append(f"efficiency {data['efficiency']:.4f}; {passing_words(data)}")
    if "etendue" in data:
        etendue = data["etendue"]
        lines.append(f"etendue is conserved to {etendue['median']:.1e} (median of {etendue['rays']} rays)")
    if "nonsequential" in data:
        closed = data["nonsequential"]
        lines += [
            f"{flux:10.6f} {unit}  {SENTENCES[name]}, with all reflections"
            for name, flux in closed[key].items()
            if flux
        ]
        verdict = "suffices" if closed["sequential_suffices"] else "does not suffice"
        lines.append(
            f"{closed['by_other_ways']:.2%} of the light on the target comes by other ways: "
            f"the sequential tracer {verdict}"
        )
    lines += crosstalk_line(data)
    return [*lines, *(f"note: {sentence}" for sentence in (*polarisation_note(data), *data["faults"]))]
