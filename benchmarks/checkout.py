"""Folders of the checkout that benchmarks read and write."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
BUILD = ROOT / "build"  # what may be made again
