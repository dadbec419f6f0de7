"""`thbcad export`: the lens in files for other programs."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from optics.base.runtime import Check, UserError
from optics.exchange.export import (
    Body,
    Labels,
    export as run,
    format_of,
    labelled_lens,
    moulded_in,
    output_files,
    require_free_files,
)
from optics.exchange.mitsuba import (
    absorbs,
    current_mitsuba,
    irradiance_of_one,
    scene_checks,
    scene_file_names,
    scene_files,
)
from optics.exchange.results import ResultFolder
from optics.interface.commands.light_export import intensity_of_light, is_luminaire, rays_of_light, reported
from optics.interface.commands.outcome import Outcome
from optics.light.outgoing import cut_cost
from thbcad.io import write_files
from thbcad.lens import Flange, Lens
from thbcad.moulds import UNCHANGED, shrinkage_factors
from thbcad.outlines import Outline, Polygon

SCENE = ".xml"  # suffix of a scene for Mitsuba
# options that change the body
SHAPES = ("aperture", "polygon", "flange", "mount", "patches", "separate", "shrinkage", "cavity", "back")


def export(options: Namespace) -> Outcome:
    """Write the lens for other programs, check the file and store the checks beside it."""
    if options.light or is_luminaire(options):
        _require_whole_lens("light is that of", options)
        _require_no_assembly("light", options)
        return rays_of_light(options) if options.light else intensity_of_light(options)
    if options.out.lower().endswith(SCENE) and options.format is None:
        _require_no_assembly("a scene for Mitsuba", options)
        return _scene(options)
    name = format_of(options.out, options.format)
    if options.scene:
        return _assembly(options, name)
    with _option("flange"):
        flange = None if options.flange is None else Flange(*options.flange)
    with _option("polygon"):
        polygon = None if options.polygon is None else _corners(options.polygon)
    with _option("shrinkage"):
        factors = UNCHANGED if options.shrinkage is None else shrinkage_factors(options.shrinkage)
    body = Body(
        options.aperture and tuple(options.aperture),
        flange,
        options.patches,
        options.separate,
        polygon,
        factors,
        options.cavity,
        options.back,
    )
    if options.mount is None:
        body = moulded_in(options.result, body)
    require_free_files(output_files(Path(options.out), name, body), options.out, options.force)
    lens, labels = labelled_lens(options.result)
    if options.mount is None:
        files, checks = run(lens, name, options.out, options.chord, body, labels)
    else:
        files, checks = _mounted(lens, name, options, labels)
    lost, lines = _cut_cost(options.result, lens, body)
    numbers = {"chord_mm": options.chord, **lost}
    if options.separate and not lens.rear.outline.is_rectangle:
        lines.append("the faces go on beyond the outline of the lens, over the rectangle round it")
    if options.shrinkage is not None:
        numbers |= {"shrinkage_percent": options.shrinkage, "factors": body.factors}
        x, y, z = (f"{factor:.10g}" for factor in body.factors)
        lines.append(f"enlarged for shrinkage, by {x} in x, {y} in y and {z} in z")
    return reported(options.out, name, files, checks, numbers, [*_sizes(files), *lines])


def _cut_cost(result: str, lens: Lens, body: Body) -> tuple[dict[str, Any], list[str]]:
    """Return what a cut costs of the light, as data and as lines; nothing without a cut or a problem."""
    if body.aperture is not None:
        cut: Outline | Polygon = Outline(body.aperture, body.aperture)
    elif body.polygon is not None:
        cut = Polygon(tuple(body.polygon))
    else:
        return {}, []
    if not Path(result).is_dir():
        return {}, []
    system = ResultFolder(result).read().system
    cost = cut_cost(system, system.backend, cut)
    line = (
        f"the cut costs {cost.through:.2%} of the light "
        f"{'of the mirror' if system.reflects else 'through front and rear'}, "
        f"{cost.on_target:.2%} of that on the target"
    )
    return {"cut_cost": asdict(cost)}, [line]


def _mounted(lens: Lens, name: str, options: Namespace, labels: Labels) -> tuple[list[Path], list[Check]]:
    """Write the lens with the mount that --mount asks for.

    Raises UserError : another option of the solid, or lens.body, beside it; as `mount_from` and
        `export_mounted`.
    """
    from optics.exchange.assemblies import export_mounted, mount_from  # OCCT

    shapes = [name for name in SHAPES if name != "mount"]
    if any(_is_given(options, name) for name in shapes):
        raise UserError(
            f"a mount has its own flange on the whole lens: leave out {', '.join(f'--{s}' for s in shapes)}"
        )
    if moulded_in(options.result, Body()).moulded is not None:
        raise UserError(
            "a mount stands on the lens without lens.body: export lens.json of the result with --mount"
        )
    return export_mounted(lens, mount_from(options.mount), name, options.out, options.chord, labels)


def _scene(options: Namespace) -> Outcome:
    """Write the scene of a result for the program `mitsuba`.

    Raises UserError : no result folder, Mitsuba is not installed or cannot express the problem.
    """
    out, folder = Path(options.out), Path(options.result)
    _require_whole_lens("a scene holds", options)
    if not folder.is_dir():
        raise UserError(f"a scene needs the problem of a result folder, and {folder} is none")
    system = ResultFolder(folder).read().system
    require_free_files(scene_file_names(system, out), options.out, options.force)
    current_mitsuba()
    files = scene_files(system, out)
    write_files(files)
    density = system.density
    one = density.factor * irradiance_of_one(system)
    lines = [
        *_sizes(files),
        f"render it with: mitsuba -m scalar_rgb {out}, the light on the screen",
        f"or with: mitsuba -m scalar_rgb -s 1 {out}, past the lens at the screen",
        f"1 in the pictures is {one:.6g} {density.shown} on the screen",
        *(["the scene holds the lens with its own walls, without lens.body"] if system.body else []),
        *(["the scene holds one lens of the plate, and its source"] if system.problem.optic.array else []),
        *(["its glass is clear: it absorbs nothing"] if absorbs(system) else []),
    ]
    return reported(options.out, "mitsuba", files, scene_checks(system, out), {}, lines)


def _assembly(options: Namespace, name: str) -> Outcome:
    """Write the elements of a result where they lie, as an assembly.

    Raises UserError : no result folder, another format than STEP, options of another body.
    """
    from optics.exchange.assemblies import export_scene  # OCCT

    out, folder = Path(options.out), Path(options.result)
    _require_whole_lens("a scene holds", options)
    if name != "step":
        raise UserError(f"--scene needs step, got {name}")
    if not folder.is_dir():
        raise UserError(f"--scene needs the problem of a result folder, and {folder} is none")
    require_free_files([out], options.out, options.force)
    system = ResultFolder(folder).read().system
    checks = export_scene(system, out, options.scene == "staged")
    return reported(options.out, name, [out], checks, {}, _sizes([out]))


def _sizes(files: Iterable[Path]) -> list[str]:
    return [f"wrote {file}, {file.stat().st_size / 1e6:.3g} MB" for file in files]


def _require_whole_lens(does: str, options: Namespace) -> None:
    """Raise UserError where options ask for another body.  does : of what is written, a verb at the end."""
    if any(_is_given(options, name) for name in SHAPES):
        raise UserError(f"{does} the whole lens: leave out {', '.join(f'--{name}' for name in SHAPES)}")


def _require_no_assembly(what: str, options: Namespace) -> None:
    """Raise UserError where options ask for an assembly.  what : is written instead."""
    if options.scene:
        raise UserError(f"--scene writes an assembly as STEP, not {what}: leave it out")


def _is_given(options: Namespace, name: str) -> bool:
    """Whether an option stands on the command line, such as `--back 0`."""
    value = getattr(options, name)
    return value is not None and value is not False


@contextmanager
def _option(name: str) -> Iterator[None]:
    """Put an option before the message of a ValueError of the block, which becomes a UserError."""
    try:
        yield
    except ValueError as error:
        raise UserError(f"--{name}: {error}") from None


def _corners(numbers: Sequence[float]) -> list[tuple[float, float]]:
    """Return the corners of a polygon; raise ValueError, or UserError where X or Y of one is missing."""
    if len(numbers) % 2:
        raise UserError(f"--polygon must have X and Y of every corner, got {len(numbers)} numbers")
    return list(Polygon(tuple(zip(numbers[::2], numbers[1::2]))).corners)
