"""Architecture: rooms and their floors.

A room is a package of docs/architecture.md.  It imports only rooms on lower floors, through their doors
(`__init__`).
"""

import ast
from itertools import chain

import pytest

from tests.cases import ROOT
from tests.source_tree import (
    FILES,
    MODULES,
    PACKAGE_FILES,
    door_table,
    imported,
    module_in,
    module_of,
    name,
    nodes,
    packages,
    text,
)

# wing of optics: its rooms, floor by floor; a wing sees those above it in this table, but for BLIND
WINGS = {
    "base": ["runtime", "optimisers statistics workers"],
    "scene": [
        "keys luminaires materials photometry ray_files receivers",
        "problem sources",
        "limits paths",
        "system",
    ],
    "light": ["intersections measuring refraction roads", "tracing", "blur", "analysis engines", "outgoing"],
    "designing": ["etendue penalties transport", "starts", "optimisation", "prediction progress"],
    "tolerancing": ["machining perturbations", "form_errors metrology monte_carlo_samples"],
    "exchange": ["results verification", "export mitsuba", "assemblies cross_checks packs"],
    "reporting": ["report view", "figures live"],
    "interface": ["relighting", "api", "audit sweeps screens", "commands"],
}
BLIND = {("tolerancing", "designing"), ("reporting", "exchange")}  # the first does not see the second
FLOORS = [
    ["thbcad.doors", "thbcad.checks", "thbcad.early_stop", "thbcad.files", "thbcad.texts", "thbcad.values"],
    ["thbcad.pictures", "thbcad.poses", "thbcad.splines", "thbcad.toml"],
    ["thbcad.hierarchy", "thbcad.outlines", "thbcad.sags"],
    ["thbcad.surfaces"],
    ["thbcad.certified"],
    ["thbcad.fitting", "thbcad.lens"],
    ["thbcad.io", "thbcad.moulds", "thbcad.mounts", "thbcad.tools"],
    ["thbcad.drawings", "thbcad.cad.occt_names"],
    ["thbcad.cad.shapes"],
    ["thbcad.cad.exchange"],
    ["thbcad.meshes", "thbcad.cad.parts", "thbcad.cad.foreign"],
    ["thbcad.cad"],
    ["thbcad"],
    *(
        [f"optics.{wing}.{room}" for room in rooms.split()]
        for wing, floors in WINGS.items()
        for rooms in floors
    ),
    ["optics"],
    ["oracles"],
    ["examples"],
    ["benchmarks.rows"],
    ["benchmarks", "tests"],
]
FLOOR = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}
# `thbcad bench` is a thin door to the benchmarks of a checkout; the command begins in `thbcad`, which another
# package cannot overwrite
UPWARD = {
    ("optics.interface.commands.bench_command", "benchmarks.rows.bench_run"),
    ("thbcad.__main__", "optics.__main__"),
}
# rooms of one file, which is its own door
SINGLE_FILES = {
    f"thbcad.{file}"
    for file in ("checks", "doors", "early_stop", "files", "pictures", "poses", "texts", "toml", "values")
} | {"thbcad.cad.occt_names"}
MOST_FILES = 13  # of a room, besides its door


def room_of(module):
    parts = module.split(".")
    return next(room for k in range(len(parts), 0, -1) if (room := ".".join(parts[:k])) in FLOOR)


def wing_of(room):
    parts = room.split(".")
    return parts[1] if parts[0] == "optics" and len(parts) == 3 else None


def has_door(room):
    return room.split(".")[0] in ("thbcad", "optics") and room not in SINGLE_FILES


def violations(path):
    """Return the imports of a file that go up, across or past a door, each as a sentence."""
    own = module_of(path)
    room = room_of(own)
    tested = own.removeprefix("tests.").rpartition(".")[0] if own.startswith("tests.") else None
    for dotted in sorted(imported(path)):
        other = module_in(dotted)
        if other is None or other == own or (own, other) in UPWARD:
            continue
        target = room_of(other)
        if target in (room, tested):
            continue
        if FLOOR[target] >= FLOOR[room]:
            yield f"{name(path)} (floor {FLOOR[room]}) imports {dotted} (floor {FLOOR[target]})"
        elif (wing_of(room), wing_of(target)) in BLIND:
            yield f"{name(path)}: {wing_of(room)} does not see {wing_of(target)}, but imports {dotted}"
        elif has_door(target) and other != target:
            yield f"{name(path)} reaches past the door of {target}: {dotted}"


def test_the_walk_finds_the_modules():
    names = [name(path) for path in FILES]
    assert {
        "thbcad/splines/knot_vector.py",
        "thbcad/cad/exchange/step.py",
        "optics/base/runtime/backend.py",
    } <= set(names)
    assert "drjit" in packages(ROOT / "optics/base/runtime/backend.py")
    assert "OCP" in packages(ROOT / "thbcad/cad/shapes/lens_parts.py")
    assert "thbcad.splines.knot_vector.KnotVector" in imported(ROOT / "thbcad/splines/__init__.py")
    assert "thbcad.splines.KnotVector" in imported(ROOT / "thbcad/__init__.py")


def test_imports_go_down_and_through_doors():
    assert list(chain.from_iterable(map(violations, FILES))) == []


def test_an_import_within_a_function_says_why():
    """Of our own rooms: what it would load for nothing, in a comment behind it or in the line before."""
    silent = [
        f"{name(path)}:{node.lineno}"
        for path in PACKAGE_FILES
        for function in nodes(path)
        if isinstance(function, ast.FunctionDef)
        for node in ast.walk(function)
        if isinstance(node, ast.ImportFrom) and node.module.split(".")[0] in ("thbcad", "optics")
        for before, line in [text(path).splitlines()[node.lineno - 2 : node.lineno]]
        if "  # " not in line and not before.strip().startswith("# ")
    ]
    assert silent == []


def test_every_package_is_a_room():
    """A folder below a room would be a room without a floor."""
    folders = {module_of(p) for p in PACKAGE_FILES if p.name == "__init__.py"}
    rooms = {room for room in FLOOR if room.split(".")[0] in ("thbcad", "optics")} - SINGLE_FILES
    assert folders == rooms | {f"optics.{wing}" for wing in WINGS}


@pytest.mark.parametrize("wing", WINGS)
def test_a_wing_has_no_door(wing):
    """Its rooms have: a wing is a folder with one sentence."""
    (sentence,) = ast.parse((ROOT / "optics" / wing / "__init__.py").read_text("utf-8")).body
    assert sentence.value.value.count("\n") == 0
    assert sentence.value.value.endswith(".")


@pytest.mark.parametrize("room", [*filter(has_door, FLOOR)])
def test_rooms_are_small(room):
    files = [p for p in (ROOT / room.replace(".", "/")).glob("*.py") if not p.match("__init__.py")]
    files = [p for p in files if not p.match("*_command.py")]  # as many as the command line offers
    files = [p for p in files if module_of(p) not in SINGLE_FILES]
    assert len(files) <= (1 if "." not in room else MOST_FILES)


def test_modules_import_each_other_in_no_cycle():
    graph = {m: {module_in(dotted) for dotted in imported(p)} - {None, m} for m, p in MODULES.items()}
    for module in graph:  # a door stands for its files only when something is taken through it
        if door_table(MODULES[module]):
            graph[module] = set()
    done, path = set(), []

    def visit(module):
        assert module not in path, f"cycle: {[*path[path.index(module) :], module]}"
        if module in done:
            return
        path.append(module)
        for other in graph[module]:
            visit(other)
        done.add(path.pop())

    for module in graph:
        visit(module)
    assert len(done) == len(graph)


def test_no_function_takes_a_problem_and_its_light_apart():
    """An `System` holds both."""
    functions = [
        (name(path), node)
        for path in FILES
        if name(path).startswith(("optics/", "benchmarks/", "oracles/"))
        if "problem" in text(path) and "light" in text(path)
        for node in nodes(path)
        if isinstance(node, ast.FunctionDef)
    ]
    taken = [
        (file, node.name, {a.arg for a in node.args.args + node.args.kwonlyargs}) for file, node in functions
    ]
    assert [(file, function) for file, function, names in taken if {"problem", "light"} <= names] == []


def test_no_test_file_imports_another():
    tests = [p for p in FILES if name(p).startswith("tests/")]
    taken = {
        (name(p), other)
        for p in tests
        for d in imported(p)
        if (other := module_in(d)) and other != module_of(p)
    }
    assert [(p, other) for p, other in sorted(taken) if other.rpartition(".")[2].startswith("test_")] == []


def test_tests_mirror_the_rooms():
    rooms = {r.replace(".", "/") for r in FLOOR} - {r.replace(".", "/") for r in SINGLE_FILES}
    folders = {
        name(p.parent).removeprefix("tests/")
        for p in FILES
        if name(p).startswith(("tests/thbcad/", "tests/optics/"))
    }
    assert folders <= rooms | {f"optics/{wing}" for wing in WINGS}


def test_the_quick_tests_touch_every_room():
    _, _, rest = (ROOT / "Makefile").read_text("utf-8").partition("QUICK = \\\n")
    quick = [ROOT / line.strip(" \t\\") for line in rest.partition("\n\n")[0].splitlines()]
    assert [p for p in quick if not p.exists()] == []
    rooms = {p.parent for p in (ROOT / "tests").rglob("test_*.py")}
    assert {p if p.is_dir() else p.parent for p in quick} == rooms
