"""Installation: megabytes of each extra, and a first design on a bare Debian, without LLVM and not as root.

Each extra goes into an environment of its own, where its packages are imported.  A bare Debian has Python
with venv, and the shared libraries that wheels leave to the system; no LLVM, no compiler.  Its user is not
root and has no network: packages come as files, which were downloaded before.

Run: thbcad bench install   (as root, for debootstrap and chroot)
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.checkout import EXAMPLES, ROOT
from benchmarks.rows.row import Row
from optics.base.runtime import UserError
from scripts.environments import pins_without_cad
from thbcad.doors import EXTRAS, LIBRARIES

MB = 1e6
SYSTEMS = ("bookworm", "trixie")
HEAVY = 50.0  # MB installed: a package that has a row
USER = "1000:1000"
LINK = "usr/lib/x86_64-linux-gnu/libLLVM.so"
# what installs thbcad from the files in /wheels, and the program that it makes
PIP = (
    "python3 -m venv /home/v",
    "/home/v/bin/pip install -q --no-index --find-links /wheels '{wheel}[optics]'",
)
WAYS = {
    "pip": (*PIP, "/home/v/bin/thbcad"),
    "pipx": (
        "python3 -m venv /home/p",
        "/home/p/bin/pip install -q --no-index --find-links /wheels pipx",
        "/home/p/bin/pipx install -q '{wheel}[optics]' --pip-args='--no-index --find-links /wheels'",
        "/home/.local/bin/thbcad",
    ),
    "uv tool": (
        "python3 -m venv /home/u",
        "/home/u/bin/pip install -q --no-index --find-links /wheels uv",
        "/home/u/bin/uv tool install -q --no-index --find-links /wheels '{wheel}[optics]'",
        "/home/.local/bin/thbcad",
    ),
}
# what is imported of an environment, and the files of each package
SIZES = """
import json, sys
from importlib import import_module
from importlib.metadata import distributions
for name in sys.argv[1:]:
    import_module(name)
sizes = {}
for one in distributions():
    paths = [one.locate_file(file) for file in one.files or ()]
    sizes[one.name] = sum(path.lstat().st_size for path in paths if path.is_file()) / 1e6  # links are small
print(json.dumps(sizes))
"""


def rows() -> list[Row]:
    """Return megabytes of extras and heavy packages; seconds of installing and designing on bare systems.

    Raises UserError : this is not root on a system with debootstrap.
    """
    if os.geteuid() != 0 or not shutil.which("debootstrap"):
        raise UserError(
            "bench install makes bare systems by debootstrap and chroot: run it as root on Debian"
        )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _run([sys.executable, "-m", "build", "--wheel", "--outdir", str(folder / "wheels"), str(ROOT)])
        (wheel,) = (folder / "wheels").iterdir()
        return [*_extras(folder, wheel), *(row for system in SYSTEMS for row in _bare(folder, system, wheel))]


def _extras(folder: Path, wheel: Path) -> list[Row]:
    wheels = {extra: folder / "wheels" for extra in (*EXTRAS, "all")} | {"cadquery": folder / "of_cadquery"}
    for extra in ("all", "cadquery"):  # which need different versions of OCP
        _download(wheels[extra], f"{wheel}[{extra}]")
    found, sizes = [], {}
    for extra, files in wheels.items():
        sizes[extra] = _sizes(folder / "v", f"{wheel}[{extra}]", files, EXTRAS.get(extra, ()))
    for extra, installed in sizes.items():
        files = [path for path in wheels[extra].iterdir() if _named(path.name.split("-")[0]) in installed]
        found.append(Row(f"thbcad[{extra}]: download", sum(path.stat().st_size for path in files) / MB, "MB"))
        found.append(Row("  installed", sum(installed.values()), "MB"))
    for package, size in sorted(sizes["all"].items(), key=lambda item: -item[1]):
        if size > HEAVY:
            holders = [extra for extra in EXTRAS if package in sizes[extra]]
            found.append(
                Row(f"{package}, of {'several' if len(holders) > 1 else (holders or ['all'])[0]}", size, "MB")
            )
    return found


def _sizes(venv: Path, wanted: str, wheels: Path, packages: tuple[str, ...]) -> dict[str, float]:
    """Install in an environment of its own, import the packages, and return MB of each distribution."""
    _run([sys.executable, "-m", "venv", str(venv)])
    python = str(venv / "bin" / "python")
    _run([python, "-m", "pip", "install", "-q", "--no-index", "--find-links", str(wheels), wanted])
    sizes = json.loads(_run([python, "-c", SIZES, *packages]))
    shutil.rmtree(venv)
    return {_named(name): size for name, size in sizes.items() if name != "setuptools"}


def _bare(folder: Path, system: str, wheel: Path) -> list[Row]:
    """Return the rows of a bare Debian: each way of installing, and one with a broken LLVM of the system."""
    root = folder / system
    packages = ",".join(("python3-venv", *LIBRARIES.values()))
    _run(["debootstrap", "--variant=minbase", f"--include={packages}", system, str(root)])
    for path in (root / LINK).parent.glob("libLLVM*"):  # of the driver of OpenGL
        path.unlink()
    running = _chroot(root, "python3 -c \"import sys; print(*sys.version_info[:2], sep='.')\"").strip()
    wheels = root / "wheels"
    _download(wheels, f"{wheel}[optics]", "pipx", "uv", running=running)
    shutil.copy(wheel, wheels)
    for name in ("pearl.toml", "pearl.png"):
        shutil.copy(EXAMPLES / name, root / "wheels")
    found = []
    for way, commands in WAYS.items():
        title = f"{system}, Python {running}, {way}"
        found += _design(root, title, [command.format(wheel=f"/wheels/{wheel.name}") for command in commands])
        if way == "pip":
            (root / LINK).write_bytes(b"no library")
            found += _design(root, f"{title}, the system's LLVM broken", [commands[-1]])
            (root / LINK).unlink()
    shutil.rmtree(root)
    return found


def _design(root: Path, title: str, commands: list[str]) -> list[Row]:
    """Install by all but the last command, which is the program; return seconds, and what the design says."""
    *installing, program = commands
    home = root / "home"
    if installing:
        shutil.rmtree(home)
        home.mkdir()
    os.chown(home, *map(int, USER.split(":")))
    start = time.perf_counter()
    for command in installing:
        _chroot(root, command)
    installed = time.perf_counter()
    _chroot(root, f"{program} design /wheels/pearl.toml --out /home/pearl")
    done = time.perf_counter()
    metrics = json.loads((home / "pearl" / "metrics.json").read_text("utf-8"))
    shutil.rmtree(home / "pearl")
    found = [Row(f"{title}: rel_l2 of pearl", metrics["rel_l2"], limit=0.03)]
    if installing:
        found.append(Row("  installing", installed - start, "s"))
    return [*found, Row("  the first design, its STEP verified", done - installed, "s")]


def _download(into: Path, *wanted: str, running: str = "") -> None:
    """Put the wheels of packages into a folder; running : another version of Python that they are for."""
    other = ("--python-version", running, "--only-binary", ":all:") if running else ()
    into.mkdir(exist_ok=True)
    pins = into / "constraints.txt"
    pins.write_text(pins_without_cad(), "utf-8")
    constraints = ("-c", str(pins))
    _run([sys.executable, "-m", "pip", "download", "-q", *constraints, *other, "-d", str(into), *wanted])


def _chroot(root: Path, command: str) -> str:
    """Run a command of the shell in a system of its own, as a user who is not root."""
    quiet = {"HOME": "/home", "PATH": "/usr/bin:/bin", "LANG": "C.UTF-8"}
    return _run([str(shutil.which("chroot")), f"--userspec={USER}", str(root), "sh", "-c", command], quiet)


def _run(command: list[str], environment: dict[str, str] | None = None) -> str:
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    if done.returncode:
        raise UserError(f"{' '.join(command)} failed: {(done.stderr or done.stdout)[-400:]}")
    return done.stdout


def _named(name: str) -> str:
    """Return the name of a distribution as files write it."""
    return name.lower().replace("-", "_").replace(".", "_")
