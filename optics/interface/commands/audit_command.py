"""`thbcad audit`: claims of the README, measured on this machine."""

from __future__ import annotations

import os
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from optics.base.runtime import UserError, limited_cores
from optics.interface.audit import CLAIMS, Experiments, audit_data, audit_lines, judged, kernels_in
from optics.interface.commands.outcome import DONE, MISSED, Outcome
from thbcad.io import json_text, write_text

CORES = 2  # that an audit uses, so that its times mean the same on larger machines


def audit(options: Namespace) -> Outcome:
    """Measure the claims in a folder of their own, which is kept where --out names one."""
    start = perf_counter()
    with _work_folder(options.out) as folder, limited_cores(CORES):
        kernels = folder.parent / "kernels"
        with kernels_in(kernels):
            rows = list(judged(Experiments(folder, kernels), CLAIMS))
        seconds = perf_counter() - start
        data = audit_data(rows, seconds)
        if options.out:
            write_text(folder / "audit.json", json_text(data))
    lines = audit_lines(rows, seconds)
    kept = ["", f"designs, damaged file and numbers: {options.out}"] if options.out else []
    return Outcome(data, [*lines, *kept], DONE if data["ok"] else MISSED)


@contextmanager
def _work_folder(out: str | None) -> Iterator[Path]:
    """Yield an empty folder; it becomes `out` at the end of the block, and goes where the block fails.

    Raises UserError : `out` exists, or its parent does not.
    """
    target = Path(out) if out else None
    if target and (target.exists() or target.is_symlink()):
        raise UserError(f"{out} exists; name a folder that does not, which thbcad audit then makes")
    if target and not target.parent.is_dir():
        raise UserError(f"there is no folder {target.parent} to make {out} in")
    with TemporaryDirectory(prefix=".thbcad_audit_", dir=target and target.parent) as place:
        folder = Path(place) / "audit"
        folder.mkdir()
        yield folder
        if target:
            os.replace(folder, target)
