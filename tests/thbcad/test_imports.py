"""Architecture: who imports what, and what a bare import loads."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import thbcad

ROOT = Path(__file__).parents[2]
MODULES = sorted(p for package in ("thbcad", "optics") for p in (ROOT / package).rglob("*.py"))
HEAVY = ["mitsuba", "drjit", "OCP", "build123d", "cadquery", "matplotlib", "scipy", "numpy", "skimage", "PIL"]

# package: the modules (paths from the root) that alone may import it, and why
ALLOWED = {
    "OCP": (["thbcad/cad/"], "CAD formats live in one subpackage: OCP takes a second to load"),
    "build123d": (["thbcad/cad/objects.py", "thbcad/lens.py"], "CAD formats live in one subpackage"),
    "cadquery": (["thbcad/cad/objects.py", "thbcad/lens.py"], "CAD formats live in one subpackage"),
    "mitsuba": (["optics/mitsuba_loading.py"], "the adapter checks libLLVM and the version before it loads Mitsuba"),
    "drjit": (
        ["optics/backend.py", "optics/mitsuba_loading.py"],
        "they check libLLVM before they load Dr.Jit, which can abort the process",
    ),
    "optiland": (["optics/optiland_trace.py"], "an optional stranger that takes seconds to load"),
    "trimesh": (["optics/export_checks.py"], "exported meshes are read back by what did not write them"),
    "lib3mf": (["optics/export_checks.py"], "exported meshes are read back by what did not write them"),
    "matplotlib": (["optics/figures.py", "optics/scene_figure.py", "optics/solid_figure.py"], "modules that draw are few and named for it"),
}
HANDOVER = "thbcad.cad.objects"
THBCAD_NEEDS = {"numpy", "scipy", "thbcad", "OCP", "build123d", "cadquery", *sys.stdlib_module_names}


def name(path):
    return path.relative_to(ROOT).as_posix()


def imported(path):
    """Return the modules that a file imports, inside functions and by import_module or __import__ of a literal too."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name(path)}: relative import"
            found.add(node.module)
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in ("import_module", "__import__"):
            found |= {a.value for a in node.args if isinstance(a, ast.Constant) and isinstance(a.value, str)}
    return found


def packages(path):
    return {module.split(".")[0] for module in imported(path)}


def run(*arguments):
    return subprocess.run([sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, check=True)


def test_the_walk_finds_the_modules():
    names = [name(path) for path in MODULES]
    assert {"thbcad/bspline.py", "thbcad/cad/step.py", "optics/backend.py", "optics/figures.py"} <= set(names)
    assert "drjit" in packages(ROOT / "optics/backend.py")
    assert "OCP" in packages(ROOT / "thbcad/cad/solid.py")


@pytest.mark.parametrize("path", [p for p in MODULES if name(p).startswith("thbcad")], ids=name)
def test_the_kernel_imports_neither_optics_nor_other_packages(path):
    assert packages(path) <= THBCAD_NEEDS


@pytest.mark.parametrize("package", ALLOWED)
def test_only_named_modules_import(package):
    places, reason = ALLOWED[package]
    importers = [name(path) for path in MODULES if package in packages(path)]
    assert all(any(i.startswith(place) for place in places) for i in importers), reason
    assert bool(importers) == bool(places)


def test_the_cad_subpackage_is_a_leaf():
    """No module of the kernel needs it; a lens hands itself over to CAD libraries when it is asked to."""
    importers = [name(p) for p in MODULES if any(m.startswith("thbcad.cad") for m in imported(p)) and name(p).startswith("thbcad/")]
    assert [i for i in importers if not i.startswith("thbcad/cad/") and i != "thbcad/__init__.py"] == ["thbcad/lens.py"]
    assert {m for m in imported(ROOT / "thbcad/lens.py") if m.startswith("thbcad.cad")} == {HANDOVER}


def test_kernel_imports_have_no_cycle():
    kernel = [p for p in MODULES if name(p).startswith("thbcad")]
    graph = {name(p)[:-3].replace("/", ".").removesuffix(".__init__"): imported(p) - {HANDOVER} for p in kernel}
    done, path = set(), []

    def visit(module):
        assert module not in path, f"cycle: {[*path[path.index(module) :], module]}"
        if module in done:
            return
        path.append(module)
        for other in graph[module] & graph.keys():
            visit(other)
        done.add(path.pop())

    for module in graph:
        visit(module)
    assert len(done) == len(graph)


@pytest.mark.parametrize("path", MODULES, ids=name)
def test_files_are_data(path):
    """Nothing that is read is executed: no pickle, no eval, no exec."""
    assert not packages(path) & {"pickle", "marshal", "shelve", "dill", "cloudpickle", "joblib"}
    calls = {n.func.id for n in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)}
    assert not calls & {"eval", "exec", "compile"}


def test_import_thbcad_loads_nothing_heavy():
    done = run("-c", f"import sys, thbcad; thbcad.__version__; dir(thbcad); print(*set({HEAVY!r}) & set(sys.modules))")
    assert done.stdout.split() == []


def test_the_kernel_loads_no_cad_and_no_rendering():
    program = "import sys; from thbcad import Lens, read_lens, THBSurface; print(*{m.split('.')[0] for m in sys.modules})"
    loaded = set(run("-c", program).stdout.split())
    assert "numpy" in loaded
    assert not loaded & (set(HEAVY) - {"numpy", "scipy"})


@pytest.mark.parametrize("module", ["approximation", "construction", "graph", "part21_surfaces", "cad.solid", "cad.exchange"])
def test_tensor_product_modules_do_not_load_the_hierarchy(module):
    loaded = run("-c", f"import sys, thbcad.{module}; print(*sys.modules)").stdout.split()
    assert "thbcad.bspline" in loaded
    assert not {"thbcad.hierarchy", "thbcad.space", "thbcad.thb"} & set(loaded)


def test_help_loads_neither_numpy_nor_scipy():
    done = run("-X", "importtime", "-m", "optics.cli", "--help")
    assert "usage" in done.stdout
    loaded = {line.split("|")[-1].strip().split(".")[0] for line in done.stderr.splitlines() if line.startswith("import time:")}
    assert "argparse" in loaded
    assert not loaded & set(HEAVY)


@pytest.mark.parametrize("attribute", [a for a in thbcad.__all__ if a != "__version__"])
def test_public_names_are_importable(attribute):
    found = getattr(thbcad, attribute)
    assert found.__name__ == attribute
    assert getattr(importlib.import_module(found.__module__), attribute) is found
    assert attribute in dir(thbcad)


def test_the_contract_names_are_public():
    wanted = {"KnotVector", "THBSpace", "THBSurface", "Lens", "FreeformSurface", "write_step", "read_step"}
    assert wanted <= set(thbcad.__all__)


def test_unknown_names_are_attribute_errors():
    with pytest.raises(AttributeError, match="module 'thbcad' has no attribute 'Mesh'"):
        _ = thbcad.Mesh
    with pytest.raises(ImportError, match="Mesh"):
        exec("from thbcad import Mesh")
