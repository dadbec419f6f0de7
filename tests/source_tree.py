"""The modules of the repository as data: what each imports, calls and offers.

Every import counts: inside functions, under TYPE_CHECKING, by `import_module` of a literal, and in the tables
of doors.
"""

import ast
import re
from functools import cache, lru_cache

from tests.cases import ROOT

FOLDERS = ("thbcad", "optics", "oracles", "benchmarks", "tests", "examples")
FILES = sorted(p for folder in FOLDERS for p in (ROOT / folder).rglob("*.py"))
MODULE_NAME = re.compile(r"(thbcad|optics)(\.\w+)+")


def name(path):
    return path.relative_to(ROOT).as_posix()


def module_of(path):
    return name(path).removesuffix(".py").replace("/", ".").removesuffix(".__init__")


MODULES = {module_of(path): path for path in FILES}
PACKAGE_FILES = [p for p in FILES if name(p).startswith(("thbcad/", "optics/"))]
IN_PACKAGES = frozenset(PACKAGE_FILES)


@cache
def text(path):
    return path.read_text("utf-8")


@lru_cache(1)  # the trees of all files are millions of objects
def tree(path):
    return ast.parse(text(path))


@lru_cache(1)
def nodes(path):
    """Return what `ast.walk` yields, in a third of its time."""
    found = [tree(path)]
    for node in found:
        for value in vars(node).values():
            if isinstance(value, ast.AST):
                found.append(value)
            elif isinstance(value, list):
                found += [entry for entry in value if isinstance(entry, ast.AST)]
    return found


def calls(path, *functions):
    for node in nodes(path) if any(function in text(path) for function in functions) else ():
        if (
            isinstance(node, ast.Call)
            and getattr(node.func, "attr", getattr(node.func, "id", "")) in functions
        ):
            yield node


@cache
def imported(path):
    """Return what a file imports, as full dotted names: "a.b.c" of `from a.b import c` and of `import a.b.c`.

    In the packages a string that is the name of a module counts as an import of it.
    """
    found = set()
    for node in nodes(path):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0 or door_table(path), f"{name(path)}: relative import"
            home = f"{module_of(path)}.{node.module}" if node.level else node.module
            found |= {f"{home}.{alias.name}" for alias in node.names}
    for node in nodes(path) if path in IN_PACKAGES else ():
        if (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and MODULE_NAME.fullmatch(node.value)
        ):
            found.add(node.value)
    for node in calls(path, "import_module", "loaded", "__import__"):
        found |= {a.value for a in node.args if isinstance(a, ast.Constant) and isinstance(a.value, str)}
    return found | {
        f"{module_of(path)}.{file}.{n}" for file, names in door_table(path).items() for n in names
    }


@cache
def door_table(path):
    """Return {file: names} of a door, {} of any other file."""
    if path.name != "__init__.py" or not any(calls(path, "lazy_door")):
        return {}
    (block,) = (
        n for n in tree(path).body if isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING"
    )
    start = len(module_of(path)) + 1
    return {
        node.module[0 if node.level else start :]: [alias.name for alias in node.names] for node in block.body
    }


def module_in(dotted):
    """Return the longest module of this repository that a dotted name begins with, or None."""
    parts = dotted.split(".")
    heads = [".".join(parts[:k]) for k in range(len(parts), 0, -1)]
    return next((head for head in heads if head in MODULES), None)


def packages(path):
    return {module.split(".")[0] for module in imported(path)}
