"""`thbcad pack`: one zip of a result for people of another program."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict
from pathlib import Path

from optics.base.runtime import UserError
from optics.exchange.export import require_free_files
from optics.exchange.packs import packed, texts
from optics.interface.commands.light_export import reported
from optics.interface.commands.outcome import Outcome
from thbcad.io import write_bytes


def pack(options: Namespace) -> Outcome:
    """Write a zip for another program, with a report beside it.

    Raises UserError : a file that does not end in .zip; as `packed`.
    """
    out = Path(options.out)
    if out.suffix.lower() != ".zip":
        raise UserError(f"a pack is a zip: let --out end in .zip, got {out}")
    require_free_files([out], options.out, options.force)
    made = packed(options.result, options.program)
    write_bytes(out, made.data)
    numbers = {
        "for": options.program,
        "contents": list(made.names),
        "expected": [asdict(row) for row in made.rows],
    }
    name = texts()["programs"][options.program]["name"]
    lines = [
        f"wrote {out}, {out.stat().st_size / 1e6:.3g} MB, {len(made.names)} files for "
        f"{name}; its README.txt says how to bring them in"
    ]
    return reported(options.out, "zip", [out], made.checks, numbers, lines)
