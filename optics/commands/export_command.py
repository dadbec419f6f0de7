"""`thbcad export`: the lens in files for other programs."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from typing import TYPE_CHECKING

from optics.commands.outcome import Outcome
from optics.results import HASHES, hashes
from optics.runtime import UserError, check_lines

if TYPE_CHECKING:
    from thbcad.lens import Flange


def export(options: Namespace) -> Outcome:
    """Write the lens for other programs, check the file and store the checks beside it."""
    from optics.export import Body, export as run, format_of, labelled_lens, report_of, require_free
    from optics.runtime import verification
    from thbcad.io import json_text, write_text

    name = format_of(options.out, options.format)
    body = Body(
        options.aperture and tuple(options.aperture),
        _flange(options.flange),
        options.patches,
        options.separate,
    )
    require_free(options.out, name, body, options.force)
    lens, labels = labelled_lens(options.result)
    files, checks = run(lens, name, options.out, options.chord, body, labels)
    report = report_of(options.out)
    data = {
        "format": name,
        "files": [str(file) for file in files],
        "chord_mm": options.chord,
        **verification(checks),
        HASHES: hashes(report.parent, [file.name for file in files]),
    }
    write_text(report, json_text(data))
    written = [f"wrote {file}, {file.stat().st_size / 1e6:.3g} MB" for file in files]
    return Outcome(data, [*check_lines(data), *written], data["ok"])


def _flange(numbers: Sequence[float] | None) -> Flange | None:
    """Return the flange that --flange asks for.

    Raises
    ------
    UserError : numbers that make none.
    """
    from thbcad.lens import Flange

    try:
        return None if numbers is None else Flange(*numbers)
    except ValueError as error:
        raise UserError(f"--flange: {error}") from None
