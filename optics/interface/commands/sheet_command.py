"""`thbcad sheet`: the drawing of a lens with its indications for the shop."""

from __future__ import annotations

from argparse import Namespace
from collections import Counter
from dataclasses import asdict
from pathlib import Path

from optics.base.runtime import UserError
from optics.exchange.export import (
    SheetFacts,
    indications_of,
    notes_of,
    require_free_files,
    sheet_checks,
    sheet_of,
)
from optics.interface.commands.light_export import reported
from optics.interface.commands.outcome import Outcome
from thbcad.drawings import DRAWINGS, drawing_bytes
from thbcad.io import write_files

SUFFIXES = (*DRAWINGS, "pdf")


def sheet(options: Namespace) -> Outcome:
    """Write the sheet of a result, read it back, and list its indications."""
    out = Path(options.out)
    name = out.suffix[1:].lower()
    if name not in SUFFIXES:
        raise UserError(f"--out must end in {', '.join(f'.{s}' for s in SUFFIXES)}, got {out}")
    given = dict(_assignment(text) for text in options.set_indication)
    require_free_files([out], options.out, options.force)
    facts = SheetFacts.of(options.result)
    indications = indications_of(facts, options.manner, given)
    try:
        drawn = sheet_of(facts, indications, options.manner, options.chord)
    except ValueError as error:
        raise UserError(f"cannot draw {options.result}: {error}") from None
    if name == "pdf":
        from optics.reporting.figures import sheet_pdf  # matplotlib

        data = sheet_pdf(drawn)
    else:
        data = drawing_bytes(drawn, name)
    write_files({out: data})
    checks = sheet_checks(facts.lens, drawn, out, name)
    counts = Counter(one.origin for one in indications)
    numbers = {
        "manner": options.manner,
        "indications": [asdict(one) for one in indications],
        "notes": notes_of(facts),
    }
    lines = [
        *(f"{one.name}: {one.value} ({one.origin})" for one in indications),
        f"wrote {out}: " + ", ".join(f"{count} {origin}" for origin, count in counts.items()),
        *(["give what is open or differs by --set-indication NAME=VALUE"] if counts["open"] else []),
    ]
    return reported(options.out, name, [out], checks, numbers, lines)


def _assignment(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise UserError(f"--set-indication must be NAME=VALUE, got {text!r}")
    return name.strip(), value.strip()
