"""The part of `thbcad verify` that lets an independent program make the light of the STEP file."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from optics.base.runtime import Backend, Check, UserError, note, reading, verification
from optics.exchange.results import HASHES, hashes, require_own, writable_folder
from optics.exchange.verification import StepFile
from optics.scene.system import OpticalSystem
from thbcad.io import json_text, write_bytes, write_text
from thbcad.lens import Lens


class FileLight(NamedTuple):
    """What `verify --light` adds: checks, numbers by name, lines of text."""

    checks: list[Check]
    data: dict[str, Any]
    lines: list[str]


@dataclass(frozen=True)
class LightRequest:
    """A program that is to make the light of the STEP file, with `rays` rays.

    folder : where its picture and its numbers are written.
    """

    tracer: str
    rays: int
    folder: Path

    @property
    def picture(self) -> str:
        """The file of the picture."""
        return f"light_{self.tracer}.png"

    @property
    def page(self) -> str:
        """The file of the page that shows picture and numbers."""
        return f"light_{self.tracer}.html"

    @property
    def record(self) -> str:
        """The file of the numbers, and of the hashes of the others."""
        return f"light_{self.tracer}.json"

    def answered(self, system: OpticalSystem, lens: Lens, file: StepFile, backend: Backend) -> FileLight:
        """Trace the file, write picture and numbers, and return the FileLight.

        Raises
        ------
        UserError : the file cannot be read, or is no lens; as `file_tracer`.
        """
        from optics.exchange.cross_checks import (  # OCCT
            compare_light,
            file_tracer,
            light_comparison_checks,
            light_comparison_lines,
        )
        from optics.reporting.figures import two_lights_figure  # matplotlib
        from optics.reporting.report import check_page  # few runs ask

        note(f"{self.tracer} traces {self.rays} rays through the STEP file")
        with reading(file.path):
            tracer = file_tracer(self.tracer, file, system)
        found = compare_light(system, lens, tracer, self.rays, backend)
        checks = light_comparison_checks(found, system.problem.verify)
        checked, lines = verification(checks), light_comparison_lines(found)
        picture = two_lights_figure(found.theirs, found.ours, found.screen, system.density, self.tracer)
        write_bytes(self.folder / self.picture, picture)
        title = f"{system.problem.title}: the light of lens.step by {self.tracer}"
        caption = f"The light that {self.tracer} makes of the file, the lens's own, and their difference."
        write_text(self.folder / self.page, check_page(title, checked, lines, [(caption, picture)]))
        data = found.metrics | checked
        written = {HASHES: hashes(self.folder, [self.picture, self.page])}
        write_text(self.folder / self.record, json_text(data | written))
        return FileLight(checks, data, [*lines, f"wrote {self.folder}"])


def light_request(options: Namespace, of_folder: bool) -> LightRequest | None:
    """Return what is asked of an independent program, None for nothing.

    of_folder : whether a result folder is verified, not a STEP file.

    Raises
    ------
    UserError : options that do not fit together, a program that is not installed, a number of rays that it
        cannot trace, a folder that cannot be written or holds what this program did not write.
    """
    if options.light is None:
        for name in ("rays", "out", "force"):
            if getattr(options, name):
                raise UserError(f"--{name} goes with --light; name the program that traces the STEP file")
        return None
    if not of_folder:
        raise UserError(
            "--light compares with the light of a design: give its result folder, got the file "
            f"{options.result}"
        )
    from optics.exchange.cross_checks import require_tracer  # few runs ask

    rays = require_tracer(options.light, None if options.rays is None else _count(options.rays))
    if not (Path(options.result) / "problem.toml").exists():
        raise UserError(f"{options.result} is not a result folder: it has no problem.toml")
    request = LightRequest(options.light, rays, Path(options.out or Path(options.result) / "verify_light"))
    writable_folder(request.folder)
    names = request.picture, request.page, request.record
    require_own(request.folder, names, request.record, options.force)
    return request


def _count(text: str) -> int:
    """Return a whole number; 1e7 is one too."""
    try:
        number = float(text)
        if number != int(number):
            raise ValueError
        return int(number)
    except (ValueError, OverflowError):
        raise UserError(f"--rays must be a whole number such as 100000 or 1e5, got {text!r}") from None
