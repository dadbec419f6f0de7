"""A checkout of its own for the studies of the thesis, so that no test writes into this one."""

import os
import shutil
import subprocess
import sys

from tests.cases import ROOT

PROGRAM = """
import sys
from pathlib import Path
from optics.interface.commands import bench_command, main
bench_command.checkout = Path.cwd
sys.exit(main(sys.argv[1:]))
"""


def copied_checkout(folder):
    """Copy what the studies need into a folder, and return it."""
    for name in ("benchmarks", "examples"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def studies(checkout, *arguments):
    """Start `thbcad bench thesis` as a process of its own in a copied checkout."""
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, "bench", "thesis", *arguments],
        cwd=checkout,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
