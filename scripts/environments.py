"""Environments with each of the CAD tools that thbcad lives beside: what works in them, as a table.

In each one the packages import, a small lens is designed to a verified STEP file, and the tests of
`thbcad/cad` and `thbcad/io` run.  They lie in build/environments and are made anew; all other packages have
the versions of constraints.txt.

Run: .venv/bin/python scripts/environments.py [NAME ...]   (make environments; half an hour for all)
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "build" / "environments"
# extras of thbcad, and what they would leave open
ENVIRONMENTS = {
    "build123d-0.13": ("build123d", ["build123d==0.13.*"]),
    "build123d-0.12": ("build123d", ["build123d==0.12.*"]),
    "cadquery-2.8": ("cadquery", ["cadquery==2.8.*"]),
    "both-of-7.9": ("build123d,cadquery", ["build123d==0.12.*", "cadquery==2.8.*"]),
    "both-of-7.8": ("build123d,cadquery", ["build123d==0.10.*", "cadquery==2.7.*", "ocp-gordon<0.2"]),
    "neither": ("optics", []),
}
FREE = re.compile(r"^(?:build123d|cadquery|ocp|vtk|ezdxf)[\w-]*==", re.IGNORECASE)  # versions that differ
LIBRARIES = ("OCP", "build123d", "cadquery")
IMPORTS = f"""
from importlib.util import find_spec
import thbcad.cad, optics
found = [name for name in {LIBRARIES} if find_spec(name)]
for name in found:
    __import__(name)
from OCP import __version__
print(__version__)
"""
DESIGN = (
    *("design", "examples/tophat_square.toml", "--set", "target.pixels=[48,48]"),
    *("--set", "lens.rear.freeform.max_level=1", "--force"),
)
TESTS = ("-n", "logical", "--dist", "loadfile", "-m", "not slow", "tests/thbcad/cad", "tests/thbcad/io")
TOLD = re.compile(r"^\d+ (?:passed|failed).*$", re.MULTILINE)


def main(names: list[str]) -> int:
    """Make environments, all without names, and print their table; 1 if something in one fails."""
    if unknown := set(names) - set(ENVIRONMENTS):
        print(f"environments: {', '.join(unknown)}: not one of {', '.join(ENVIRONMENTS)}", file=sys.stderr)
        return 2
    print("| environment | OCP | design | tests |\n|---|---|---|---|", flush=True)
    failed = False
    for name in names or ENVIRONMENTS:
        cells, good = _checked(name)
        print(f"| {' | '.join((name, *cells))} |", flush=True)
        failed |= not good
    return int(failed)


def pins_without_cad() -> str:
    """Return constraints.txt without the CAD tools and OCP, whose versions differ between environments."""
    lines = (ROOT / "constraints.txt").read_text("utf-8").splitlines()
    return "\n".join(line for line in lines if not FREE.match(line))


def _checked(name: str) -> tuple[list[str], bool]:
    """Return what the table says of an environment: OCP's version, the design, the tests; and if all work."""
    folder = FOLDER / name
    shutil.rmtree(folder, ignore_errors=True)
    python = str(folder / "bin" / "python")
    pins = FOLDER / "constraints.txt"
    FOLDER.mkdir(parents=True, exist_ok=True)
    pins.write_text(pins_without_cad(), "utf-8")
    extras, packages = ENVIRONMENTS[name]
    wanted = ["-e", f"{ROOT}[{extras}]", *packages, "pytest", "pytest-xdist", "hypothesis"]
    for command in (
        [sys.executable, "-m", "venv", str(folder)],
        [python, "-m", "pip", "install", "-q", "--disable-pip-version-check", "-c", str(pins), *wanted],
    ):
        if (done := _run(command)).returncode:
            return [f"not installed: {_last(done.stderr)}", "", ""], False
    imported = _run([python, "-c", IMPORTS])
    if imported.returncode:
        return [f"not imported: {_last(imported.stderr)}", "", ""], False
    designed = _run([python, "-m", "thbcad", *DESIGN, "--out", str(folder / "lens")])
    tested = _run([python, "-m", "pytest", *TESTS])
    found = TOLD.findall(tested.stdout)
    cells = [
        imported.stdout.strip(),
        "verified" if designed.returncode == 0 else f"exit code {designed.returncode}",
        found[-1].partition(" in ")[0] if found else _last(tested.stdout),
    ]
    return cells, designed.returncode == tested.returncode == 0


def _run(command: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True)


def _last(text: str) -> str:
    lines = text.strip().splitlines()
    return lines[-1] if lines else ""


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
