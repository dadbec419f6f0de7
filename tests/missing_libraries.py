"""Which test files need build123d or cadquery, and which of the two are missing.

Their latest versions need different versions of OCP, so that an environment holds only one of them.
"""

import re
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from tests.cases import ROOT

LIBRARIES = ("build123d", "cadquery")
MISSING = tuple(library for library in LIBRARIES if find_spec(library) is None)
TEXT = re.compile(r'""".*?"""', re.DOTALL)  # may hold a program
IMPORT = re.compile(r"^(?:import|from) +([\w.]+)(?: +import +(\([^)]*\)|[^#\n]*))?", re.MULTILINE)


@cache
def needed(path):
    """Return the libraries that a file imports at its top, or that modules of `tests` import for it."""
    found = set()
    for module, names in IMPORT.findall(TEXT.sub("", path.read_text("utf-8"))):
        package, *_ = module.split(".")
        if package in LIBRARIES:
            found.add(package)
        elif package == "tests":
            found.update(*(needed(p) for p in _files(module, names)))
    return frozenset(found)


def _files(module, names):
    """Return the files of a module of `tests` and of those of its names that are modules."""
    stem = ROOT.joinpath(*module.split("."))
    stems = [stem, *(stem / name for name in re.findall(r"\w+", names))]
    return [p for s in stems for p in (s.with_suffix(".py"), s / "__init__.py") if p.is_file()]


def left_out(path, missing=MISSING):
    """Return whether a path is a test file that needs a missing library."""
    is_test = path.name.startswith("test_") and path.suffix == ".py"
    return is_test and any(library in needed(path) for library in missing)


def sentences(places, missing=MISSING):
    """Return for each missing library how many test files in these folders are left out."""
    files = {p for place in map(Path, places) if place.is_dir() for p in place.rglob("test_*.py")}
    counts = {library: sum(left_out(p, (library,)) for p in files) for library in missing}
    return [
        f"not collected without {library}: {count} file{'s' * (count > 1)}"
        for library, count in counts.items()
        if count
    ]
