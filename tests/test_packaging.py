"""What an installation holds: the base and its extras, the sentence about a missing one, sdist and wheel."""

import json
import os
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from email import message_from_bytes
from importlib.metadata import packages_distributions
from shutil import copytree, ignore_patterns, which

import pytest
import yaml

import thbcad
from optics.interface.commands import main
from tests.cases import DATA, ROOT
from tests.source_tree import PACKAGE_FILES, packages
from thbcad import FreeformSurface, Lens, write_lens
from thbcad.doors import EXTRAS

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
FIRST_BLOCK = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)
OTHER_EXTRAS = ("all", "docs", "light", "peers", "test")  # of no door
SENTENCE = 'thbcad: {} not installed; pip install "thbcad[optics]"\n'
ARGUMENTS = {
    "asbuilt": ["result", "--measured", "points.xyz"],
    "audit": [],
    "bench": ["overview"],
    "check": ["problem.toml"],
    "completion": ["bash"],
    "design": ["problem.toml", "--out", "result"],
    "etendue": ["problem.toml"],
    "pack": ["result", "--for", "shop", "--out", "pack.zip"],
    "relight": ["result", "--source", "sun"],
    "road": ["lamp.ies", "--class", "P4", "--height", "8", "--spacing", "30"],
    "sheet": ["result", "--out", "lens.svg"],
    "tolerance": ["result"],
    "sweep": ["problem.toml", "--vary", "target.distance=200:400:5"],
    "tool": ["result"],
    "trace": ["result"],
    "verify": ["result"],
}
FREE = ("export", "new")  # what these lack depends on what they are asked for
LIBRARY = {
    "OCP": ("from thbcad import write_step; write_step()", "cad"),
    "PIL": ("from optics.scene.receivers import read_picture", "optics"),
    "drjit": ("from optics.base.runtime import load_backend; load_backend()", "optics"),
    "matplotlib": ("from optics.reporting.figures import solid_views", "optics"),
}
HOOK = """
import sys

class Screen:
    '''A finder that does not see some packages.'''

    def __init__(self, finder):
        self.finder = finder

    def find_spec(self, name, path=None, target=None):
        return None if hidden(name.partition(".")[0]) else self.finder.find_spec(name, path, target)

sys.meta_path[:] = map(Screen, sys.meta_path)
"""
BARE_HOOK = (
    "def hidden(package):\n"
    "    own = {'numpy', 'scipy', 'thbcad', 'optics', *sys.stdlib_module_names}\n"
    "    return package not in own and not package.startswith('_sysconfigdata')\n" + HOOK
)
READ_STEP_TEXT = f"""
from thbcad.io import parse_brep, volume

solid = parse_brep({str(DATA / "lens.step")!r})
print(len(solid.faces), "faces", abs(volume(solid) / lens.volume() - 1) < 1e-13)
"""
BARE_OUTPUT = "148 (14, 14)\n6 faces True\n"


def bare_program():
    """Return the first Python block of docs/README.md, then the text of its lens's STEP file read."""
    return FIRST_BLOCK.search((ROOT / "docs" / "README.md").read_text("utf-8"))[1] + READ_STEP_TEXT


def run(program, folder):
    """Run a program on this checkout in a folder without it."""
    path = f"import sys; sys.path.insert(0, {str(ROOT)!r})\n"
    return subprocess.run([sys.executable, "-c", path + program], cwd=folder, capture_output=True, text=True)


def run_commands(hook, commands, folder):
    """Return (code, stdout, stderr) of commands, one after the other in one process behind an import hook."""
    program = f"""
import contextlib, io, json
from optics.interface.commands import main

for arguments in {commands!r}:
    streams = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(streams[0]), contextlib.redirect_stderr(streams[1]):
        try:
            code = main(arguments)
        except SystemExit as end:
            code = end.code
    print(json.dumps([code, *(stream.getvalue() for stream in streams)]))
"""
    done = run(f"{hook}\n{program}", folder)
    assert done.stderr == ""
    return [tuple(json.loads(line)) for line in done.stdout.splitlines()]


def hiding(*packages):
    return f"def hidden(package):\n    return package in {packages!r}\n{HOOK}"


def distribution(requirement):
    """Return the normal name of a requirement's distribution, "cadquery-ocp"."""
    return re.match(r"[\w.-]+", requirement)[0].lower().replace("_", "-")


@pytest.mark.slow
def test_the_bare_snippet_needs_numpy_and_scipy_only(tmp_path):
    done = run(BARE_HOOK + bare_program(), tmp_path)
    assert (done.stdout, done.stderr) == (BARE_OUTPUT, "")
    assert (tmp_path / "lens.json").exists()


def test_the_hook_refuses_other_packages(tmp_path):
    done = run(f"{BARE_HOOK}\nimport hypothesis", tmp_path)
    assert done.stderr.endswith("ModuleNotFoundError: No module named 'hypothesis'\n")


@pytest.mark.parametrize("package", LIBRARY)
def test_a_missing_package_is_an_import_error_with_the_command(package, tmp_path):
    program, extra = LIBRARY[package]
    done = run(f"{hiding(package)}\n{program}", tmp_path)
    sentence = f'{package} is not installed; pip install "thbcad[{extra}]"'
    assert done.stderr.splitlines()[-1] == f"thbcad.doors.MissingPackage: {sentence}"


LOOKS = """
import importlib, inspect, pydoc, sys
package = importlib.import_module(sys.argv[1])
held = {}
exec(f"from {package.__name__} import *", held)
assert set(package.__all__) <= set(held)
assert all(hasattr(package, name) for name in package.__all__)
assert not hasattr(package, "no_such_name")
members = dict(inspect.getmembers(package))
assert all(members[name] is held[name] for name in package.__all__)
text = pydoc.plain(pydoc.render_doc(package))
assert all(name in text for name in package.__all__)
assert all(held[name].__name__ == name and held[name].__doc__ for name in package.__all__)
"""
USES = """
import thbcad
from thbcad.doors import MissingPackage

assert inspect.isclass(thbcad.ForeignLens) and inspect.isfunction(thbcad.write_step)
assert thbcad.ForeignLens.__module__ == "thbcad.cad.foreign.foreign_lens"
assert thbcad.write_step.__doc__.startswith("Write a lens, or a part with a lens")
assert not isinstance(1, thbcad.ForeignLens) and not issubclass(int, thbcad.ForeignLens)
assert not hasattr(thbcad.ForeignLens, "__no_such_name__")
class Own(thbcad.ForeignLens):
    pass
for use in (Own, thbcad.ForeignLens, lambda: thbcad.ForeignLens.lens, thbcad.write_step, thbcad.to_trimesh):
    try:
        use()
    except MissingPackage as error:
        print(error)
"""


@pytest.mark.slow
@pytest.mark.parametrize("package", ["thbcad", "thbcad.cad", "optics"])
def test_nothing_dies_of_a_missing_extra_by_being_looked_at(package, tmp_path):
    """`import *`, `hasattr`, `inspect.getmembers` and `help` work; what is used says what it lacks."""
    uses = USES if package == "thbcad" else ""
    done = run(f"{BARE_HOOK}\nsys.argv[1:] = [{package!r}]\n{LOOKS}{uses}", tmp_path)
    assert done.stderr == ""
    lacking = ["OCP", "OCP", "OCP", "OCP", "trimesh"] if uses else []
    sentences = [f'{name} is not installed; pip install "thbcad[cad]"' for name in lacking]
    assert done.stdout.splitlines() == sentences


def test_all_commands_have_arguments_here():
    assert {p.stem for p in (ROOT / "optics" / "interface" / "commands").glob("*_command.py")} == {
        f"{command}_command" for command in (*ARGUMENTS, *FREE)
    }


def test_commands_without_the_extra_are_bad_input(tmp_path):
    commands = [[command, *arguments] for command, arguments in ARGUMENTS.items()]
    told = (2, "", SENTENCE.format("OCP, drjit are"))
    found = run_commands(hiding("drjit", "OCP"), commands, tmp_path)
    assert dict(zip(ARGUMENTS, found, strict=True)) == dict.fromkeys(ARGUMENTS, told)


LACKS = {
    "dat": "",
    "svg": "",
    "x3p": 'cannot export lens.x3p: x3pio is not installed; pip install "thbcad[metrology]"',
    "dxf": 'cannot export lens.dxf: ezdxf is not installed; pip install "thbcad[cad]"',
    "ply": 'a ply file is read back by trimesh, which is not installed; pip install "thbcad[optics]"',
    "step": 'cannot export lens.step: OCP is not installed; pip install "thbcad[cad]"',
}


def test_an_export_names_only_what_its_file_lacks(tmp_path):
    write_lens(Lens(FreeformSurface((4, 4)), FreeformSurface((4, 4)), 2.0, 1.5), tmp_path / "lens.json")
    commands = [["export", "lens.json", "--out", f"lens.{name}"] for name in LACKS]
    found = {
        name: (code, err) for name, (code, _, err) in zip(LACKS, run_commands(BARE_HOOK, commands, tmp_path))
    }
    assert found == {name: (2, f"thbcad: {told}\n") if told else (0, "") for name, told in LACKS.items()}
    written = {path.name.split(".")[1] for path in tmp_path.iterdir()} - {"json"}
    assert written == {name for name, told in LACKS.items() if not told}


@pytest.mark.parametrize("package", EXTRAS["optics"])
def test_each_package_of_the_extra_is_named(package, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, package, None)
    assert main(["check", "problem.toml"]) == 2
    assert capsys.readouterr() == ("", SENTENCE.format(f"{package} is"))


def test_help_and_version_need_no_extra(tmp_path):
    told, version = run_commands(BARE_HOOK, [["--help"], ["--version"]], tmp_path)
    assert (told[0], told[2], version) == (0, "", (0, f"thbcad {thbcad.__version__}\n", ""))
    assert told[1].startswith("usage: thbcad")


def test_the_extras_bring_what_the_doors_say():
    extras = PROJECT["optional-dependencies"]
    wanted = {extra: {distribution(r) for r in extras[extra]} for extra in EXTRAS}
    wanted["optics"] = {distribution(r) for r in (*extras["cad"], *extras["light"])}
    homes = packages_distributions() | {"cadquery": ["cadquery"]}  # which has an environment of its own
    told = {extra: {distribution(homes[p][0]) for p in packages} for extra, packages in EXTRAS.items()}
    # one has no module, one is for another processor
    assert told["optics"] == wanted["optics"] - {"karellen-llvm-core", "py-lib3mf", "ezdxf"}
    assert all(told[extra] <= wanted[extra] for extra in EXTRAS)


def test_what_is_imported_is_asked_for():
    asked = {"numpy", "scipy", *(p for extra in EXTRAS.values() for p in extra)}
    imported = set().union(*map(packages, PACKAGE_FILES))
    ours = {"thbcad", "optics", "benchmarks"}
    assert imported - ours - {"_typeshed", *sys.stdlib_module_names} <= asked
    assert {distribution(r) for r in PROJECT["dependencies"]} == {"numpy", "scipy"}


def test_the_citation_names_this_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert citation["version"] == thbcad.__version__
    assert citation["license"] == PROJECT["license"]
    assert citation["authors"] == PROJECT["authors"]


def test_a_commit_runs_what_make_lint_runs():
    rule = re.search(r"^lint:.*\n((?:\t.*\n)+)", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)[1]
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text("utf-8"))["repos"][0]["hooks"]
    assert {line.strip("\t@") for line in rule.splitlines()} <= {hook["entry"] for hook in hooks}
    assert {hook["language"] for hook in hooks} == {"system"}


def test_the_workflow_runs_targets_of_the_makefile_by_every_python():
    """On Linux; on the other systems, which have no `make setup`, it is pip and pytest."""
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text("utf-8"))
    others = workflow["jobs"].pop("never-run")
    assert others["strategy"]["matrix"]["os"] == ["windows-2022", "macos-14"]
    assert [step["run"].split()[0] for step in others["steps"] if "if" not in step and "run" in step] == [
        "python",
        "thbcad",
        "python",
    ]
    assert "none of the two was ever run" in (ROOT / ".github" / "workflows" / "ci.yml").read_text("utf-8")
    steps = [step for job in workflow["jobs"].values() for step in job["steps"]]
    runs = {step["run"] for step in steps if "run" in step}
    targets = re.search(r"^\.PHONY: (.*)", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)[1].split()
    makes = {run for run in runs if "drjit" not in run}  # else: which kernels may be kept
    wanted = ("lint", "licences", "test", "environments", "docs", "dist")
    assert makes == {f"make PYTHON=python {target}" for target in wanted}
    assert len(runs - makes) == 1
    assert set(wanted) <= set(targets)
    versions = workflow["jobs"]["test"]["strategy"]["matrix"]["python"]
    assert [f"Programming Language :: Python :: {v}" for v in versions] == [
        line for line in PROJECT["classifiers"] if "Python :: 3." in line
    ]


def test_the_changelog_begins_with_this_version():
    headings = re.findall(r"^## (.*)", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE)
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert headings[:2] == ["Unreleased", f"{thbcad.__version__} - {citation['date-released']}"]


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Sdist and wheel, built without a warning from a copy of the checkout."""
    copy, out = tmp_path_factory.mktemp("checkout"), tmp_path_factory.mktemp("dist")
    for folder in ("thbcad", "optics", "tests"):
        copytree(ROOT / folder, copy / folder, ignore=ignore_patterns("__pycache__"))
    for path in ROOT.iterdir():
        if path.is_file():
            (copy / path.name).write_bytes(path.read_bytes())
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    done = subprocess.run(
        [sys.executable, "-m", "build", "--outdir", out, copy],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert done.returncode == 0, done.stdout
    assert re.findall(r".*(?:warn|deprecat).*", done.stdout, re.IGNORECASE) == []
    (sdist,), (wheel,) = out.glob("*.tar.gz"), out.glob("*.whl")
    return sdist, wheel


@pytest.mark.slow
def test_sdist_and_wheel_hold_the_packages_and_nothing_else(built):
    sources = {
        p.relative_to(ROOT).as_posix()
        for package in ("thbcad", "optics")
        for p in (ROOT / package).rglob("*")
        if p.suffix in (".py", ".typed", ".html", ".csv", ".toml")
    }
    assert {
        "thbcad/py.typed",
        "optics/py.typed",
        "optics/reporting/view/viewer.html",
        "optics/scene/photometry/cie_5nm.csv",
        "optics/scene/photometry/fmvss_108_ub2.toml",
    } <= sources
    with tarfile.open(built[0]) as sdist:
        held = {m.name.partition("/")[2] for m in sdist.getmembers() if m.isfile()}
    own = {
        "CHANGELOG.md",
        "CITATION.cff",
        "LICENSE",
        "LICENSES.md",
        "PKG-INFO",
        "README.md",
        "pyproject.toml",
    }
    own |= {"setup.cfg"}
    assert {name for name in held if not name.startswith("thbcad.egg-info/")} == sources | own
    with zipfile.ZipFile(built[1]) as wheel:
        assert {name for name in wheel.namelist() if ".dist-info/" not in name} == sources
        texts = {name.partition("/licenses/")[2]: wheel.read(name) for name in wheel.namelist()}
    for name in ("LICENSE", "LICENSES.md"):
        assert texts[name] == (ROOT / name).read_bytes()


@pytest.mark.slow
def test_the_metadata_say_whose_it_is_and_what_it_needs(built):
    with zipfile.ZipFile(built[1]) as wheel:
        (name,) = (n for n in wheel.namelist() if n.endswith(".dist-info/METADATA"))
        metadata = message_from_bytes(wheel.read(name))
    assert metadata["Version"] == thbcad.__version__
    assert metadata["Author"] == "thbcad developers"
    assert metadata["License-Expression"] == "MIT"
    assert metadata.get_all("License-File") == ["LICENSE", "LICENSES.md"]
    assert metadata["Requires-Python"] == ">=3.11"
    assert metadata["Description-Content-Type"] == "text/markdown"
    assert metadata.get_payload() == (ROOT / "README.md").read_text("utf-8")
    assert metadata["Summary"] == PROJECT["description"]
    assert metadata["Keywords"]
    assert "Typing :: Typed" in metadata.get_all("Classifier")
    assert metadata.get_all("Project-URL") is metadata["Home-page"] is None
    assert set(metadata.get_all("Provides-Extra")) == {*EXTRAS, *OTHER_EXTRAS}
    base = [r for r in metadata.get_all("Requires-Dist") if "extra ==" not in r]
    assert {distribution(r) for r in base} == {"numpy", "scipy"}


@pytest.mark.slow
def test_the_wheel_works_in_a_fresh_environment(built, tmp_path, capsys):
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}

    def call(*command):
        return subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)

    assert call(sys.executable, "-m", "venv", "fresh").returncode == 0
    python, command = tmp_path / "fresh" / "bin" / "python", tmp_path / "fresh" / "bin" / "thbcad"
    done = call(python, "-m", "pip", "install", "-c", ROOT / "constraints.txt", built[1])
    assert done.returncode == 0, done.stderr
    names = {line.split("==")[0] for line in call(python, "-m", "pip", "freeze").stdout.splitlines()}
    assert {name.partition(" ")[0] for name in names} == {"numpy", "scipy", "thbcad"}

    done = call(python, "-I", "-c", bare_program())
    assert (done.stdout, done.stderr) == (BARE_OUTPUT, "")
    assert call(command, "--help").stdout.startswith("usage: thbcad")
    assert call(command, "--version").stdout == f"thbcad {thbcad.__version__}\n"
    assert call(python, "-I", "-c", "import thbcad, optics").returncode == 0
    for arguments in (["design", "problem.toml"], ["check", "problem.toml"]):
        done = call(command, *arguments)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr == SENTENCE.format(", ".join(EXTRAS["optics"]) + " are")

    (site,) = (tmp_path / "fresh" / "lib").glob("python*/site-packages")
    megabytes = {
        name: round(sum(p.stat().st_size for p in site.glob(f"{name}*/**/*") if p.is_file()) / 1e6)
        for name in ("numpy", "scipy", "thbcad", "optics")
    }
    with capsys.disabled():
        print(f"\ninstalled, MB: {megabytes}; wheel {built[1].stat().st_size / 1e6:.2f} MB")
    assert sum(megabytes.values()) < 400


@pytest.mark.slow
@pytest.mark.skipif(which("uvx") is None, reason="uvx is not installed")
def test_uvx_runs_the_program_of_the_wheel(built, tmp_path):
    done = subprocess.run(
        ["uvx", "--from", built[1], "thbcad", "--help"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("usage: thbcad")


def test_no_group_of_a_pattern_is_repeated_possessively():
    """`(...)*+` matches too much before Python 3.11.5 (gh-106052); `(?>(...)*)` says the same."""
    wrong = re.compile(r"\)[+*?]\+(?!\s)")
    assert [str(path) for path in PACKAGE_FILES if wrong.search(path.read_text("utf-8"))] == []
