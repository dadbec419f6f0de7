"""`thbcad bench`: the figures of a benchmark beside their limits."""

from __future__ import annotations

import sys
from argparse import Namespace
from importlib import import_module
from pathlib import Path
from typing import Any

from optics.runtime import UserError, machine, table


def bench(options: Namespace) -> tuple[list[dict[str, Any]], list[str], bool]:
    """Run a benchmark that lies in the checkout this package was installed from."""
    root = Path(__file__).resolve().parents[2]
    modules = {
        p.stem: p
        for p in sorted((root / "benchmarks").rglob("*.py"))
        if "\ndef rows(" in p.read_text("utf-8")
    }
    if options.name not in modules:
        names = ", ".join(sorted(modules)) or "none, run from a checkout"
        raise UserError(f"there is no benchmark {options.name!r}; this installation has: {names}")
    sys.path.insert(0, str(root))
    rows = import_module(".".join(modules[options.name].relative_to(root).with_suffix("").parts)).rows()
    return [row.plain() for row in rows], [machine(), *table(rows)], all(row.ok for row in rows)
