"""Doors: the `__init__` of a room offers what its table says, under the names that type checkers see."""

import ast
import importlib
import os
import re
import shutil
import subprocess
import sys
from collections import defaultdict
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

import thbcad
from tests.source_tree import FILES, MODULES, ROOT, calls, door_table, module_of, name, tree
from thbcad.doors import WHEELS, MissingPackage, loaded, not_installed, require_one_occt, stand_in

PAGE_IMPORT = re.compile(r"^from ((?:thbcad|optics)\.[\w.]+) import (\([^)]*\)|.*)$", re.MULTILINE)
DOORS = [p for p in FILES if door_table(p)]


def test_doors_offer_what_their_tables_say():
    for path in DOORS:
        door = importlib.import_module(module_of(path))
        names = [n for names in door_table(path).values() for n in names]
        assert len(names) == len(set(names)), name(path)
        assert set(names) == set(door.__all__), name(path)
        for file, offered in door_table(path).items():
            home = importlib.import_module(f"{module_of(path)}.{file}")
            assert [n for n in offered if getattr(door, n) is not getattr(home, n)] == [], name(path)


def names_on_pages():
    """Return {module: names} of what the pages import from rooms."""
    found = defaultdict(set)
    for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
        for module, names in PAGE_IMPORT.findall(page.read_text("utf-8")):
            found[module] |= set(re.findall(r"\w+", names.partition("#")[0])) - {"as"}
    return found


def test_type_checkers_see_the_names_that_users_meet():
    """A door imports its own files alone, and `X as X` what users meet: type checkers offer no other name."""
    shown = names_on_pages()
    for path in DOORS:
        words = {word.arg for call in calls(path, "lazy_door") for word in call.keywords}
        public = "public" in words
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.ImportFrom) and node.module != "thbcad.doors":
                assert node.level == 1 or node.module.startswith(module_of(path) + "."), name(path)
                met = [a.name for a in node.names if public or a.name in shown[module_of(path)]]
                assert [a.name for a in node.names if a.asname == a.name] == met, name(path)
                assert {a.asname for a in node.names} <= {*met, None}, name(path)


def test_what_a_door_offers_is_named_alone_where_it_is_made():
    """The pages' builder finds no name that is one of a pair (`A, B = 1, 2`)."""
    paired = []
    for path in DOORS:
        for file, offered in door_table(path).items():
            home = importlib.import_module(f"{module_of(path)}.{file}")
            pairs = [t for n in tree(Path(home.__file__)).body for t in getattr(n, "targets", ())]
            named = {e.id for t in pairs if isinstance(t, ast.Tuple) for e in t.elts}
            paired += [f"{home.__name__}.{n}" for n in named & set(offered)]
    assert paired == []


def test_a_door_says_in_one_sentence_what_its_room_is():
    firsts = {name(path): ast.get_docstring(tree(path)).split("\n\n")[0] for path in DOORS}
    wrong = {path: first for path, first in firsts.items() if first[-1] != "." or ". " in first}
    assert wrong == {}


def test_no_file_or_room_bears_the_name_of_what_a_door_above_it_offers():
    """A submodule of that name would replace the function after its first import."""
    clashes = []
    for door in DOORS:
        package = module_of(door)
        offered = {n for names in door_table(door).values() for n in names}
        clashes += [m for m in MODULES if m.startswith(package + ".") and m.rpartition(".")[2] in offered]
    assert clashes == []


def test_public_names_are_importable():
    for attribute in dir(thbcad):
        found = getattr(thbcad, attribute)
        assert found.__name__ == attribute
        assert getattr(importlib.import_module(found.__module__), attribute) is found, attribute


def test_the_contract_names_are_public():
    wanted = {"KnotVector", "THBSpace", "THBSurface", "Lens", "FreeformSurface", "write_step", "read_step"}
    assert wanted <= set(dir(thbcad))


def test_unknown_names_are_attribute_errors():
    with pytest.raises(AttributeError, match="module 'thbcad' has no attribute 'Mesh'"):
        _ = thbcad.Mesh
    with pytest.raises(ImportError, match="Mesh"):
        exec("from thbcad import Mesh")


def test_a_renamed_class_still_loads_by_its_old_name_and_the_warning_says_the_new_one():
    import optics.scene.system as door

    with pytest.warns(
        DeprecationWarning, match="OpticalSystem is deprecated: use optics.scene.system.System"
    ):
        assert door.OpticalSystem is door.System
    assert "OpticalSystem" not in dir(door)


def test_a_stand_in_is_what_it_stands_for_once_that_can_be_imported():
    line, knots = (stand_in("thbcad.splines", name) for name in ("line", "KnotVector"))
    assert line is stand_in("thbcad.splines", "line") is not thbcad.line
    assert line([0.0], [2.0])([0.5]).tolist() == [[1.0]]
    assert knots.uniform(2, 3).dim == knots(2, [0, 0, 0, 1, 2, 3, 3, 3]).dim == 5


@pytest.mark.parametrize(
    ("system", "machine", "packages"),
    [
        ("Linux", "x86_64", []),
        ("Windows", "AMD64", []),
        ("Darwin", "arm64", []),
        ("Darwin", "x86_64", ["drjit"]),
        ("Linux", "aarch64", []),
        ("Windows", "ARM64", ["drjit", "OCP", "lib3mf"]),
    ],
)
def test_a_system_without_wheels_is_told_so(system, machine, packages, monkeypatch):
    monkeypatch.setattr("platform.system", lambda: system)
    monkeypatch.setattr("platform.machine", lambda: machine)
    lacking = [
        p for p in WHEELS if not_installed([p], "optics").startswith(f"{p} is not installed, and there are")
    ]
    assert lacking == packages
    words = not_installed(["matplotlib", *WHEELS], "optics")
    assert words.endswith(" only" if packages else '; pip install "thbcad[optics]"')


def test_shared_libraries_that_are_missing_are_named_with_their_packages(monkeypatch):
    """Dr.Jit then raises a NameError, since its own sentence names what was not loaded."""

    def failing(module):
        raise NameError("name '_drjit_ext' is not defined")

    def library(name):
        if name != "libc.so.6":
            raise OSError(f"{name}: cannot open shared object file: No such file or directory")

    monkeypatch.setattr("thbcad.doors.import_module", failing)
    monkeypatch.setattr("thbcad.doors.LIBRARIES", {"libc.so.6": "libc6", "libmissing.so.1": "libmissing1"})
    monkeypatch.setattr("ctypes.CDLL", library)
    words = r"^drjit needs libmissing\.so\.1; install them \(Debian: apt-get install libmissing1\)$"
    with pytest.raises(MissingPackage, match=words):
        loaded("drjit")
    monkeypatch.setattr("thbcad.doors.LIBRARIES", {"libc.so.6": "libc6"})
    with pytest.raises(NameError):
        loaded("drjit")


NOVTK, VTK = "cadquery-ocp-novtk", "cadquery-ocp"
FIGHT = (
    "cadquery-ocp-novtk 8.0.1.1.0 and cadquery-ocp 7.9.3.1.1 share the folder OCP, where one overwrites the "
    "other; pip uninstall -y cadquery-ocp-novtk cadquery-ocp, then pip install "
)


@pytest.mark.parametrize(
    ("installed", "libraries", "sentence"),
    [
        ({}, (), ""),  # the import itself tells
        ({NOVTK: "7.8.1.1.post1"}, (), ""),
        ({NOVTK: "8.0.1.1.0"}, ("build123d",), ""),
        ({NOVTK: "7.9.3.1.1", VTK: "7.9.3.1.1"}, ("build123d", "cadquery"), ""),  # the same files
        ({NOVTK: "8.0.1.1.0", VTK: "7.9.3.1.1"}, (), f"{FIGHT}cadquery-ocp-novtk==8.0.1.1.0"),
        ({NOVTK: "8.0.1.1.0", VTK: "7.9.3.1.1"}, ("cadquery",), f"{FIGHT}cadquery-ocp==7.9.3.1.1"),
        (
            {VTK: "7.7.2"},
            ("cadquery",),
            "cadquery-ocp 7.7.2 is installed, and thbcad was tested with versions from 7.8.1 to below 8.1; "
            'pip install "cadquery-ocp>=7.8.1,<8.1"',
        ),
        (
            {NOVTK: "8.1.0.0"},
            (),
            "cadquery-ocp-novtk 8.1.0.0 is installed, and thbcad was tested with versions from 7.8.1 to "
            'below 8.1; pip install "cadquery-ocp-novtk>=7.8.1,<8.1"',
        ),
    ],
)
def test_packages_of_opencascade_that_fight_are_named_with_the_remedy(
    installed, libraries, sentence, monkeypatch
):
    def version(package):
        if package not in installed:
            raise PackageNotFoundError(package)
        return installed[package]

    monkeypatch.setattr("importlib.metadata.version", version)
    monkeypatch.setattr("thbcad.doors.find_spec", lambda package: package if package in libraries else None)
    if not sentence:
        require_one_occt()
        return
    with pytest.raises(MissingPackage) as told:
        require_one_occt()
    assert str(told.value) == sentence


FOREIGN = {
    "before ours": "{found} is another package optics and hides that of thbcad; rename it, or run thbcad "
    "where Python does not look for it",
    "over ours": "the package optics of PyPI has overwritten that of thbcad in {found}; pip uninstall -y "
    "optics, then pip install --force-reinstall --no-deps thbcad",
    "gone": "its package optics is missing; pip install --force-reinstall --no-deps thbcad",
}


@pytest.mark.parametrize("case", FOREIGN)
def test_another_package_optics_is_named(case, tmp_path):
    """A copy of what the command needs, beside it a package as PyPI has one."""
    (tmp_path / "thbcad").mkdir()
    for file in ("__init__.py", "__main__.py", "doors.py", "early_stop.py"):
        shutil.copy(ROOT / "thbcad" / file, tmp_path / "thbcad")
    folders = {"before ours": [tmp_path / "first" / "optics", tmp_path / "optics"], "gone": []}
    for folder in folders.get(case, [tmp_path / "optics"]):
        folder.mkdir(parents=True)
        (folder / "__init__.py").write_text("from optics.optics import *\n")
    path = os.pathsep.join(map(str, (tmp_path / "first", tmp_path)))
    done = subprocess.run(
        [sys.executable, "-S", "-m", "thbcad", "check", "lens.toml"],
        env=os.environ | {"PYTHONPATH": path},
        cwd=tmp_path / "thbcad",
        capture_output=True,
        text=True,
    )
    found = tmp_path / ("first/optics" if case == "before ours" else "optics")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"thbcad: {FOREIGN[case].format(found=found)}\n"
