"""Whether designs are what they were: all examples, small, by this checkout and by an earlier commit.

For every example a table shows whether the STEP file and the light have the same bytes, rel_l2 of both, the
largest change of the light over its mean, and the user CPU seconds of both and their ratio.  Both checkouts
run with the packages of this interpreter, in turns.  Exit code 1: some result differs.

Run: .venv/bin/python scripts/same_results.py COMMIT [EXAMPLE ...]   (ten minutes for all on two cores)
"""

from __future__ import annotations

import hashlib
import json
import os
import resource
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
LEVEL, PIXELS = 1, 24
SMALL = {"optimizer.iterations": [2], "optimizer.finish": 0, "verify.rays": 33}
HEAD = ("example", "exit", "STEP", "light", "rel_l2 before", "now", "largest change", "CPU s before", "ratio")


@dataclass(frozen=True)
class Result:
    """A design: exit code, hash of the STEP file, irradiance in float64, rel_l2, user CPU seconds."""

    code: int
    step: str
    light: Any
    rel_l2: float
    seconds: float


def main(words: Sequence[str]) -> int:
    """Print the table; return 1 where a result differs from that of the commit."""
    if not words:
        sys.exit(__doc__)
    commit, *names = words
    differ = 0
    with checkout_of(commit) as base:
        print("| " + " | ".join(HEAD) + " |\n|" + "---|" * len(HEAD))
        for name in names or examples():
            before, now = (designed(root, name) for root in (base, ROOT))
            row, same = compared(name, before, now)
            differ += not same
            print("| " + " | ".join(row) + " |", flush=True)
    print(f"{differ} differ" if differ else "all are the same")
    return 1 if differ else 0


def examples() -> list[str]:
    """Return the problem files of examples/ by their path in that folder."""
    found = (ROOT / "examples").rglob("*.toml")
    read = {
        str(path.relative_to(ROOT / "examples")): tomllib.loads(path.read_text("utf-8")) for path in found
    }
    return sorted(name for name, table in read.items() if "target" in table)  # else a mount


@contextmanager
def checkout_of(commit: str) -> Iterator[Path]:
    """Have a commit as a folder in the block."""
    with tempfile.TemporaryDirectory(prefix="same_results_") as folder:
        place = Path(folder) / "base"
        git = ["git", "-C", str(ROOT), "worktree"]
        subprocess.run([*git, "add", "--quiet", "--detach", str(place), commit], check=True)
        try:
            yield place
        finally:
            subprocess.run([*git, "remove", "--force", str(place)], check=True)


def designed(root: Path, name: str) -> Result:
    """Design an example with few pixels, levels and iterations, by a checkout."""
    path = root / "examples" / name
    table = tomllib.loads(path.read_text("utf-8"))
    few = [min(n, PIXELS) for n in table["target"].get("pixels", [PIXELS, PIXELS])]
    changes = SMALL | {"target.pixels": few} | dict.fromkeys(levels(table), LEVEL)
    options = [word for key, value in changes.items() for word in ("--set", f"{key}={value}")]
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "optics", "design", str(path), "--out", folder, "--force", "--quiet"]
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        done = subprocess.run(
            [*command, *options],
            cwd=root,
            env=os.environ | {"PYTHONPATH": str(root)},
            capture_output=True,
            text=True,
        )
        seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        if done.returncode not in (0, 1):
            print(f"{name}: {done.stderr.strip().splitlines()[-1:]}", file=sys.stderr)
            return Result(done.returncode, "", None, float("nan"), seconds)
        metrics = json.loads((Path(folder) / "metrics.json").read_text("utf-8"))
        with np.load(Path(folder) / "irradiance.npz") as arrays:
            light = np.asarray(arrays["irradiance"], float)
        step = hashlib.sha256((Path(folder) / "lens.step").read_bytes()).hexdigest()
        return Result(done.returncode, step, light, metrics["rel_l2"], seconds)


def levels(table: dict[str, Any], prefix: str = "") -> list[str]:
    """Return the keys of the finest levels of all meshes of a problem file."""
    found = []
    for key, value in table.items():
        if isinstance(value, dict):
            found += levels(value, f"{prefix}{key}.")
        elif key == "element":
            for row in value:
                found += levels(row, f"{prefix}{key}.{row['name']}.")
        elif key == "max_level":
            found.append(prefix + key)
    return found


def compared(name: str, before: Result, now: Result) -> tuple[list[str], bool]:
    """Return the cells of a row under HEAD, and whether both results are the same."""
    if before.light is None or now.light is None:
        return [name, f"{before.code} {now.code}", *["-"] * (len(HEAD) - 2)], before.code == now.code
    same_step, same_light = before.step == now.step, np.array_equal(before.light, now.light)
    change = "-"
    if before.light.shape == now.light.shape:
        change = f"{np.abs(now.light - before.light).max() / np.abs(before.light).mean():.1e}"
    code = str(now.code) if before.code == now.code else f"{before.code} -> {now.code}"
    words = ["same" if same else "differs" for same in (same_step, same_light)]
    errors = [f"{result.rel_l2:.6f}" for result in (before, now)]
    times = [f"{before.seconds:.1f}", f"{now.seconds / before.seconds:.2f}"]
    return [name, code, *words, *errors, change, *times], same_step and same_light and before.code == now.code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
