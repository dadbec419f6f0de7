"""The installed command `thbcad`, and `python -m thbcad`: the command line of `optics`, if that is ours.

PyPI has another package `optics`, which pip installs into the same folder.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

OWN = b"from thbcad.doors import"  # in the text of our package, and of no other
INSTALL = "pip install --force-reinstall --no-deps thbcad"


def entry() -> None:
    """Run the command line of this process, and end it."""
    if wrong := foreign_optics():
        print(f"thbcad: {wrong}", file=sys.stderr)
        sys.exit(2)
    import_module("optics.__main__").entry()


def foreign_optics() -> str:
    """Return in one sentence why the package `optics` is not ours, and what to do; "" where it is."""
    own = Path(__file__).resolve().parents[1] / "optics" / "__init__.py"
    spec = find_spec("optics")
    found = Path(spec.origin).resolve() if spec and spec.origin else None
    if found and found != own:
        return (
            f"{found.parent} is another package optics and hides that of thbcad; rename it, or run thbcad "
            "where Python does not look for it"
        )
    if not found:
        return f"its package optics is missing; {INSTALL}"
    if OWN not in found.read_bytes():
        return (
            f"the package optics of PyPI has overwritten that of thbcad in {found.parent}; pip uninstall -y "
            f"optics, then {INSTALL}"
        )
    return ""


if __name__ == "__main__":
    entry()
