"""Print the licence of every installed package; exit with 1 where one does not suit an MIT project.

Run: .venv/bin/python scripts/licences.py

A licence suits if it is permissive, or weak copyleft (LGPL, MPL): such packages are used unchanged, as
libraries of their own.  The GPL, and a licence that is not stated, do not suit.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable
from importlib.metadata import Distribution, distributions

KINDS = ("permissive", "weak copyleft", "GPL", "unknown")
PERMISSIVE = re.compile(
    r"\b(?:MIT|0?BSD|Apache|ISC|PSF|Python Software Foundation|Zlib|CC0|HPND|Unlicense)\b"
)
WEAK = re.compile(r"LGPL|Lesser General Public|MPL|Mozilla Public")
STRONG = re.compile(r"\bA?GPL|General Public")
# name: (licence, why it is written here); such a licence takes the place of that of the metadata
STATED = {
    "bd_materials": ("Apache-2.0", "no metadata; the wheel holds the text"),
    "cadquery-ocp-novtk": (
        "Apache-2.0 AND LGPL-2.1-only WITH OCCT-exception-1.0",
        "the metadata name the licence of the bindings only, not that of OpenCASCADE",
    ),
    "ocpsvg": ("Apache-2.0", "no metadata; the wheel holds the text"),
}
# name: why it may be here although its licence does not suit
ALLOWED = {
    "gmsh": "GPL; the extra `peers` has it for one benchmark, which runs it as a program of its own",
}


def stated_licence(package: Distribution) -> str:
    """Return what the metadata say: the expression, else classifiers, else the first line of the text."""
    metadata = package.metadata
    if expression := metadata.get("License-Expression"):
        return expression
    classifiers = [c for c in metadata.get_all("Classifier") or () if c.startswith("License")]
    names = [c.rpartition(" :: ")[2] for c in classifiers if c.count(" :: ") > 1]
    text = metadata.get("License", "").strip().partition("\n")[0]
    return " AND ".join(names) or ("" if text == "UNKNOWN" else text)


def kind_of(licence: str) -> str:
    """Return one of `KINDS`: that of the best part of an OR, and of the worst part of an AND."""

    def rank(part: str) -> int:
        if WEAK.search(part):
            return 1
        if STRONG.search(part):
            return 2
        return 0 if PERMISSIVE.search(part) else 3

    choices = re.sub(r"[()]", "", licence).split(" OR ")
    return KINDS[min(max(map(rank, choice.split(" AND "))) for choice in choices)]


def table(packages: Iterable[Distribution]) -> tuple[list[str], list[str]]:
    """Return lines "name version kind licence", and a line for each package that does not suit."""
    rows, faults = [], []
    for package in sorted(packages, key=lambda p: p.name.lower()):
        licence = STATED.get(package.name, (stated_licence(package), ""))[0] or "not stated"
        kind = kind_of(licence)
        rows.append(f"{package.name:28} {package.version:16} {kind:14} {licence}")
        if kind in ("GPL", "unknown") and package.name not in ALLOWED:
            faults.append(f"{package.name} {package.version}: {licence}")
    return rows, faults


def main() -> int:
    """Print the table; return 1 where a licence does not suit."""
    rows, faults = table(distributions())
    print("\n".join(rows))
    for fault in faults:
        print(f"licences: {fault} does not suit; take another package", file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
