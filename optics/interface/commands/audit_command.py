"""`thbcad audit`: claims of the README, measured on this machine."""

from __future__ import annotations

import os
from argparse import Namespace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from optics.base.runtime import UserError
from optics.interface.audit import CLAIMS, audit_data, audit_lines, experiments_in, judged
from optics.interface.commands.outcome import DONE, MISSED, Outcome
from thbcad.io import json_text, write_text


def audit(options: Namespace) -> Outcome:
    """Measure the claims in a folder of their own, which is kept where --out names one."""
    start, target = perf_counter(), options.out and Path(options.out)
    if target:
        _require_new(target)
    with TemporaryDirectory(prefix=".thbcad_audit_", dir=target and target.parent) as place:
        with experiments_in(Path(place)) as experiments:
            rows = list(judged(experiments, CLAIMS))
        seconds = perf_counter() - start
        data, lines = audit_data(rows, seconds), audit_lines(rows, seconds)
        if target:
            write_text(experiments.folder / "audit.json", json_text(data))
            os.replace(experiments.folder, target)
            lines += ["", f"designs, damaged file and numbers: {target}"]
    return Outcome(data, lines, DONE if data["ok"] else MISSED)


def _require_new(target: Path) -> None:
    """Raise UserError where a folder exists, or its parent does not."""
    if target.exists() or target.is_symlink():
        raise UserError(f"{target} exists; name a folder that does not, which thbcad audit then makes")
    if not target.parent.is_dir():
        raise UserError(f"there is no folder {target.parent} to make {target} in")
