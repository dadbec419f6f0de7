"""The command line.

Results go to stdout (--json for machines), progress and messages to stderr.  Exit codes:
0 done, 1 a check failed, 2 bad input, 3 numerical failure, 130 interrupted.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module

from optics.runtime import NumericalError, UserError
from thbcad import __version__
from thbcad.doors import missing_packages, pip_command


def parser() -> argparse.ArgumentParser:
    """Return the argument parser (nothing heavy is imported for it)."""
    main = argparse.ArgumentParser(
        prog="thbcad",
        description="Freeform illumination lenses: from a target picture to a verified STEP solid.",
        epilog="exit codes: 0 done, 1 a check failed, 2 bad input, 3 numerical failure, 130 interrupted",
    )
    main.add_argument("--version", action="version", version=f"thbcad {__version__}")
    commands = main.add_subparsers(dest="command", required=True, metavar="COMMAND")
    design = commands.add_parser("design", help="shape the lens, write the STEP solid, verify it, report")
    design.add_argument("problem", metavar="PROBLEM.toml")
    design.add_argument(
        "--out", metavar="DIR", help="result folder (default: exports/NAME of the problem file)"
    )
    design.add_argument(
        "--resume", action="store_true", help="go on from the checkpoint in the result folder"
    )
    design.add_argument(
        "--from",
        dest="earlier",
        metavar="DIR",
        help="start from the free surfaces of an earlier design, on their meshes",
    )
    new = commands.add_parser("new", help="print a commented problem file to start from")
    check = commands.add_parser("check", help="read the problem and say what would be done, without tracing")
    check.add_argument("problem", metavar="PROBLEM.toml")
    verify = commands.add_parser(
        "verify", help="check the STEP file of a result folder against its lens, or a STEP file by itself"
    )
    verify.add_argument("result", metavar="RESULT", help="result folder of a design, or a STEP file")
    verify.add_argument(
        "--no-optiland",
        dest="optiland",
        action="store_false",
        help="leave out the trace by optiland, which takes longest",
    )
    export = commands.add_parser(
        "export",
        help="write the lens for other programs, read it back and compare it with the exact surfaces",
    )
    export.add_argument("result", metavar="RESULT", help="result folder of a design, or a lens.json")
    export.add_argument(
        "--out", metavar="FILE", required=True, help="file to write (dat and xyz: FILE_front and FILE_rear)"
    )
    export.add_argument(
        "--format",
        metavar="NAME",
        help="step iges brep stl 3mf obj ply dat xyz npz (default: the suffix of FILE)",
    )
    export.add_argument(
        "--aperture",
        type=float,
        nargs=2,
        metavar=("A", "B"),
        help="cut to an ellipse with these semi-axes in mm",
    )
    export.add_argument(
        "--flange",
        type=float,
        nargs=3,
        metavar=("WIDTH", "LOW", "HIGH"),
        help="planar flange from z = LOW to HIGH, mm",
    )
    export.add_argument(
        "--patches", action="store_true", help="one face per patch of same-level cells (step)"
    )
    export.add_argument(
        "--separate", action="store_true", help="front and rear as loose faces, FILE_front and FILE_rear"
    )
    export.add_argument(
        "--chord",
        type=float,
        default=1e-3,
        metavar="MM",
        help="error that meshes may have, in mm (default: 1e-3)",
    )
    trace = commands.add_parser(
        "trace", help="trace the lens of a result folder again: flux by fate, reflections, phase space"
    )
    trace.add_argument("result", metavar="RESULT", help="result folder of a design")
    trace.add_argument("--rays", type=int, default=513, metavar="N", help="N x N rays (default: 513)")
    trace.add_argument(
        "--precision",
        choices=("double", "single"),
        default="double",
        help="of the sequential trace (default: double)",
    )
    trace.add_argument("--out", metavar="DIR", help="folder to write (default: RESULT/trace)")
    etendue = commands.add_parser(
        "etendue", help="what light the source can make at all: etendue, flux, a certified bound of rel_l2"
    )
    etendue.add_argument("problem", metavar="PROBLEM.toml")
    etendue.add_argument(
        "--efficiency",
        type=float,
        metavar="SHARE",
        help="of the light on the target (default: the most that can arrive)",
    )
    etendue.add_argument(
        "--measure",
        metavar="RESULT",
        help="also measure the images of the source that a designed lens throws",
    )
    etendue.add_argument(
        "--out", metavar="FILE.png", help="picture of target, best light and the source's image"
    )
    bench = commands.add_parser(
        "bench", help="run a benchmark of a checkout and print its figures beside their limits"
    )
    bench.add_argument("name", metavar="NAME", nargs="?", help="a module of benchmarks/, such as overview")
    bench.add_argument("--store", action="store_true", help="also keep the figures in docs/data/NAME.json")
    bench.add_argument(
        "--markdown",
        action="store_true",
        help="run nothing: write docs/benchmarks.md and the marked numbers of README and docs from docs/data",
    )
    for command in (design, new, check, verify, export, trace, etendue, bench):
        command.add_argument("--json", action="store_true", help="print the result as JSON")
    return main


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code."""
    options = parser().parse_args(arguments)
    # only vector operations use BLAS here: its threads would wait for each other, not help
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        _require_extra()
        command = import_module(f"optics.commands.{options.command}_command")
        result, lines, ok = getattr(command, options.command)(options)
    except (UserError, NumericalError) as error:
        print(f"thbcad: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("thbcad: interrupted", file=sys.stderr)
        return 130
    except ImportError as error:
        if not isinstance(error.__cause__, KeyboardInterrupt):  # Ctrl-C while OCP is loaded
            raise
        print("thbcad: interrupted", file=sys.stderr)
        return 130
    except MemoryError:
        print("thbcad: out of memory; use fewer pixels, rays or levels", file=sys.stderr)
        return NumericalError.exit_code
    except OSError as error:
        where = f" {error.filename}" if error.filename else ""
        print(f"thbcad: cannot write or read{where}: {error.strerror or error}", file=sys.stderr)
        return UserError.exit_code
    from thbcad.io import json_text

    _print(json_text(result) if options.json else "\n".join(lines))
    return 0 if ok else 1


def _require_extra() -> None:
    """Raise UserError unless everything that the commands need is installed; help needs none of it."""
    missing = missing_packages("optics")
    if missing:
        verb = "is" if len(missing) == 1 else "are"
        raise UserError(f"{', '.join(missing)} {verb} not installed; {pip_command('optics')}")


def _print(text: str) -> None:
    """Print to stdout; a reader that has gone (`| head`) is no error."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def entry() -> None:
    """Entry point of the installed command."""
    sys.exit(main())
