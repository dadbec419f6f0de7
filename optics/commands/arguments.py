"""The arguments of the command line."""

from __future__ import annotations

import argparse
from collections.abc import Callable

from thbcad import __version__


def parser() -> argparse.ArgumentParser:
    """Return the argument parser (nothing heavy is imported for it)."""
    main = argparse.ArgumentParser(
        prog="thbcad",
        description="Freeform illumination lenses: from a target picture to a verified STEP solid.",
        epilog="exit codes: 0 done, 1 a check failed, 2 bad input, 3 numerical failure, "
        "70 internal error, 130 interrupted, 143 terminated",
    )
    main.add_argument("--version", action="version", version=f"thbcad {__version__}")
    commands = main.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, (sentence, options) in COMMANDS.items():
        command = commands.add_parser(name, help=sentence)
        options(command)
        command.add_argument("--json", action="store_true", help="print the result as JSON")
    return main


def _problem_options(command: argparse.ArgumentParser) -> None:
    command.add_argument("problem", metavar="PROBLEM.toml")


def _force_option(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--force", action="store_true", help="replace files that another problem or program wrote"
    )


def _design_options(command: argparse.ArgumentParser) -> None:
    _problem_options(command)
    command.add_argument(
        "--out", metavar="DIR", help="result folder (default: exports/NAME of the problem file)"
    )
    _force_option(command)
    command.add_argument(
        "--resume",
        action="store_true",
        help="go on from the checkpoint in the result folder, or from its finished result",
    )
    command.add_argument(
        "--iterations",
        type=int,
        metavar="N",
        help="with --resume: iterations on each level that is left, or more on the last one",
    )
    command.add_argument(
        "--from",
        dest="earlier",
        metavar="DIR",
        help="start from the free surfaces of an earlier design, on their meshes",
    )


def _check_options(command: argparse.ArgumentParser) -> None:
    _problem_options(command)
    command.add_argument(
        "--explain", action="store_true", help="also list what tracing skips on this problem, and why"
    )


def _no_options(command: argparse.ArgumentParser) -> None:
    """Add nothing."""


def _verify_options(command: argparse.ArgumentParser) -> None:
    command.add_argument("result", metavar="RESULT", help="result folder of a design, or a STEP file")
    command.add_argument(
        "--no-optiland",
        dest="optiland",
        action="store_false",
        help="leave out the trace by optiland, which takes longest",
    )


def _export_options(command: argparse.ArgumentParser) -> None:
    command.add_argument("result", metavar="RESULT", help="result folder of a design, or a lens.json")
    command.add_argument(
        "--out", metavar="FILE", required=True, help="file to write (dat and xyz: FILE_front and FILE_rear)"
    )
    command.add_argument(
        "--format",
        metavar="NAME",
        help="step iges brep stl 3mf obj ply dat xyz npz (default: the suffix of FILE)",
    )
    command.add_argument(
        "--aperture",
        type=float,
        nargs=2,
        metavar=("A", "B"),
        help="cut to an ellipse with these semi-axes in mm",
    )
    command.add_argument(
        "--flange",
        type=float,
        nargs=3,
        metavar=("WIDTH", "LOW", "HIGH"),
        help="planar flange from z = LOW to HIGH, mm",
    )
    command.add_argument(
        "--patches", action="store_true", help="one face per patch of same-level cells (step)"
    )
    command.add_argument(
        "--separate", action="store_true", help="front and rear as loose faces, FILE_front and FILE_rear"
    )
    command.add_argument(
        "--chord",
        type=float,
        default=1e-3,
        metavar="MM",
        help="error that meshes may have, in mm (default: 1e-3)",
    )
    _force_option(command)


def _trace_options(command: argparse.ArgumentParser) -> None:
    command.add_argument("result", metavar="RESULT", help="result folder of a design")
    command.add_argument("--rays", type=int, default=513, metavar="N", help="N x N rays (default: 513)")
    command.add_argument(
        "--precision",
        choices=("double", "single"),
        default="double",
        help="of the sequential trace (default: double)",
    )
    command.add_argument("--out", metavar="DIR", help="folder to write (default: RESULT/trace)")
    _force_option(command)


def _etendue_options(command: argparse.ArgumentParser) -> None:
    _problem_options(command)
    command.add_argument(
        "--efficiency",
        type=float,
        metavar="FRACTION",
        help="of the light on the target (default: the most that can arrive)",
    )
    command.add_argument(
        "--measure",
        metavar="RESULT",
        help="also measure the images of the source that a designed lens throws",
    )
    command.add_argument(
        "--out", metavar="FILE.png", help="picture of target, best light and the source's image"
    )
    _force_option(command)


def _bench_options(command: argparse.ArgumentParser) -> None:
    command.add_argument("name", metavar="NAME", nargs="?", help="a module of benchmarks/, such as overview")
    command.add_argument("--store", action="store_true", help="also keep the results in docs/data/NAME.json")
    command.add_argument(
        "--markdown",
        action="store_true",
        help="run nothing: write docs/benchmarks.md and the marked numbers of README and docs from docs/data",
    )


# by name: what the command does, and what adds its options
COMMANDS: dict[str, tuple[str, Callable[[argparse.ArgumentParser], None]]] = {
    "design": ("shape the lens, write the STEP solid, verify it, report", _design_options),
    "new": ("print a commented problem file to start from", _no_options),
    "check": ("read the problem and say what lens to expect, without optimising", _check_options),
    "verify": (
        "check the STEP file of a result folder against its lens, or a STEP file by itself",
        _verify_options,
    ),
    "export": (
        "write the lens for other programs, read it back and compare it with the exact surfaces",
        _export_options,
    ),
    "trace": (
        "trace the lens of a result folder again: flux by fate, reflections, phase space",
        _trace_options,
    ),
    "etendue": (
        "what light the source can make at all: etendue, flux, a certified bound of rel_l2",
        _etendue_options,
    ),
    "bench": ("run a benchmark of a checkout and print its results beside their limits", _bench_options),
}
