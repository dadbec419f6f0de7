"""The arguments of the command line."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence

from optics.interface.commands.command_examples import examples_text
from optics.interface.commands.command_parser import CommandParser, require_known, require_paths
from optics.interface.commands.making_options import (
    asbuilt_options,
    audit_options,
    bench_options,
    chord_option,
    pack_options,
    problem_options,
    ray_options,
    relight_options,
    road_options,
    sheet_options,
    sweep_options,
    tolerance_options,
    tool_options,
)
from optics.scene.problem import ENGINES, STARTS
from thbcad import __version__

FIRST_STEPS = """thbcad designs freeform lenses: from the light that is asked for to a verified STEP solid.
  thbcad new                          ask three questions, write my_lens.toml
  thbcad check my_lens.toml           say in seconds what lens to expect
  thbcad design my_lens.toml --live   design it, and show the light in a browser meanwhile
  exports/my_lens/report.html         open it: the light, the lens, all checks
  thbcad --help                       list all commands; thbcad COMMAND --help explains one"""


def parsers() -> tuple[CommandParser, dict[str, CommandParser]]:
    """Return the parser of the command line and those of its commands (nothing heavy is imported)."""
    main = CommandParser(
        prog="thbcad",
        description="Freeform illumination lenses: from a target picture to a verified STEP solid.",
        epilog="exit codes: 0 done; 1 the light misses what was asked for, or that is not decided; "
        "2 bad input; 3 numerical failure; 4 a file, a part or a limit of making fails; 70 internal error; "
        "130 interrupted; 143 terminated",
    )
    main.add_argument("--version", action="version", version=f"thbcad {__version__}")
    added = main.add_subparsers(dest="command", required=True, metavar="COMMAND")
    commands = {}
    for name, (sentence, options) in COMMANDS.items():
        commands[name] = added.add_parser(
            name,
            help=sentence,
            description=sentence,
            epilog=examples_text(name),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        options(commands[name])
        _common_options(commands[name])
    return main, commands


def parsed(words: Sequence[str]) -> argparse.Namespace | None:
    """Return the options of a command line, with its `words`; None after what `thbcad` alone prints.

    Raises UserError : an unknown command or option, an argument that is missing or has a wrong value.
    Raises OSError : stdout cannot be written, where help or version is asked for.
    """
    main, commands = parsers()
    if not words:
        print(FIRST_STEPS, flush=True)
        return None
    require_known(words, main, commands)
    options = main.parse_args(words, argparse.Namespace(words=tuple(words)))
    require_paths(options, commands[options.command])
    return options


def _common_options(command: CommandParser) -> None:
    command.switch("--json", "print the result as JSON")
    amount = command.add_mutually_exclusive_group()
    amount.add_argument(
        "-v",
        "--verbose",
        action="store_true",
        help="also say on stderr what tracing skips on a problem, and show the traceback of an internal "
        "error",
    )
    amount.add_argument(
        "-q", "--quiet", action="store_true", help="neither progress nor notes on stderr, only errors"
    )


def _design_options(command: CommandParser) -> None:
    problem_options(command)
    command.out("DIR", "result folder (default: exports/NAME of the problem file)")
    command.option(
        "--engine",
        "NAME",
        f"what traces the light while optimising: {', '.join(ENGINES)}; "
        "short for --set optimizer.engine=NAME",
        choices=ENGINES,
    )
    command.switch("--resume", "go on from the checkpoint in the result folder, or from its finished result")
    command.option(
        "--iterations",
        "N",
        "with --resume: iterations on each level that is left, or more on the last one",
        type=int,
    )
    command.switch("--live", "write DIR/live.html, which shows the light while it is designed, and open it")
    command.option(
        "--from", "DIR", "start from the free surfaces of an earlier design, on their meshes", dest="earlier"
    )
    command.option(
        "--lens",
        "LENS",
        "lens.json, or STEP of any program: this lens as it is, not optimised; the problem may leave out "
        "thickness, half-widths and the target",
    )
    command.switch("--turn", "with --lens of a STEP file: light meets its other side first")


def _check_options(command: CommandParser) -> None:
    problem_options(command)
    command.switch("--explain", "also list what tracing skips on this problem, and why")


def _new_options(command: CommandParser) -> None:
    command.option(
        "--kind",
        "NAME",
        f"of the task: {', '.join(STARTS)} (default: collimated)",
        choices=tuple(STARTS),
        default="collimated",
    )


def _completion_options(command: CommandParser) -> None:
    command.choice("shell", ("bash", "zsh", "tcsh"), "that shall complete")


def _verify_options(command: CommandParser) -> None:
    command.add_argument("result", metavar="RESULT", help="result folder of a design, or a STEP file")
    command.option(
        "--lens",
        "LENS",
        "of a STEP file: the result folder, or lens.json, of the lens that the part in it holds; only "
        "the folder knows the light",
    )
    command.add_argument(
        "--no-optiland",
        dest="optiland",
        action="store_false",
        help="leave out the trace by optiland, which takes longest",
    )
    command.choice(
        "--light",
        ("mitsuba", "optiland", "occt"),
        "also let this program make the light of the STEP file, and compare it with ours",
    )
    command.option(
        "--rays", "N", "with --light: random rays (default: 1e7 for mitsuba, 2e4 for optiland, 1e5 for occt)"
    )
    command.out("DIR", "with --light: folder to write (default: RESULT/verify_light)")


def _export_options(command: CommandParser) -> None:
    command.add_argument("result", metavar="RESULT", help="result folder of a design, or a lens.json")
    command.option("--out", "FILE", "file to write (dat, xyz, x3p: FILE_front and FILE_rear)", required=True)
    command.option(
        "--format",
        "NAME",
        "step iges brep stl 3mf obj ply glb dat xyz x3p npz svg dxf (default: the suffix of FILE; "
        "xml: Mitsuba scene; ies, ldt: intensity of the light behind the lens)",
    )
    _body_options(command)
    command.switch("--patches", "one face per patch of same-level cells (step)")
    command.switch("--separate", "front and rear as loose faces, FILE_front and FILE_rear")
    command.choice(
        "--scene",
        ("elements", "staged"),
        "all elements where they lie, as an assembly (step); staged: source and screen too, as plates",
    )
    command.choice(
        "--light",
        ("rear", "target"),
        "write the light behind the lens as rays (.tm25ray, Zemax .dat, LightTools .ray), from there",
    )
    ray_options(command)
    chord_option(command)
    command.force()


def _body_options(command: CommandParser) -> None:
    """Add what is made of the lens before it is written."""
    command.option(
        "--aperture", ("A", "B"), "cut to an ellipse with these semi-axes in mm", type=float, nargs=2
    )
    corners = "cut to the polygon with these corners in mm: X Y X Y X Y ..."
    command.option("--polygon", ("X", "Y"), corners, type=float, nargs="+")
    command.option(
        "--flange", ("WIDTH", "LOW", "HIGH"), "planar flange from z = LOW to HIGH, mm", type=float, nargs=3
    )
    command.option(
        "--mount", "FILE", "mount.toml: flange, holes, pins, bosses and gate, in one solid with the lens"
    )
    command.option(
        "--shrinkage",
        "PERCENT",
        "enlarge by 1 + PERCENT / 100, one number, or three for x, y and z: what shrinks is the design",
        type=float,
        nargs="+",
    )
    command.choice(
        "--cavity",
        ("front", "rear"),
        "the insert of a mould that makes this surface: its negative, with a plane back",
    )
    command.option(
        "--back", "Z", "plane back of the insert, z in mm (default: as deep as the lens is thick)", type=float
    )


def _trace_options(command: CommandParser) -> None:
    command.add_argument("result", metavar="RESULT", help="result folder of a design")
    command.option("--rays", "N", "N x N rays (default: 513)", type=int, default=513)
    command.choice(
        "--precision", ("double", "single"), "of the sequential trace (default: double)", default="double"
    )
    command.out("DIR", "folder to write (default: RESULT/trace)")


def _etendue_options(command: CommandParser) -> None:
    problem_options(command)
    command.option(
        "--efficiency",
        "FRACTION",
        "of the light on the target (default: one pass through two uncoated faces)",
        type=float,
    )
    command.option("--measure", "RESULT", "also measure the images of the source by a designed lens")
    command.out("FILE.png", "picture of target, both bounds and the source's image")


# by name: what the command does, and what adds its options
COMMANDS: dict[str, tuple[str, Callable[[CommandParser], None]]] = {
    "design": ("shape the lens, write the STEP solid, verify it, report", _design_options),
    "new": ("print a commented problem file to start from", _new_options),
    "check": ("read the problem and say what lens to expect, without optimising", _check_options),
    "verify": (
        "check the STEP file of a result folder against its lens, or a STEP file by itself",
        _verify_options,
    ),
    "export": (
        "write the lens for other programs, read it back and compare it with the exact surfaces",
        _export_options,
    ),
    "sheet": ("write the drawing of the lens with its indications for the shop", sheet_options),
    "pack": (
        "put part, drawing, points, rays and expected light into one zip for another program or the shop",
        pack_options,
    ),
    "trace": (
        "trace the lens of a result folder again: flux by fate, reflections, phase space",
        _trace_options,
    ),
    "etendue": (
        "what light the source can make at all: what etendue forbids, what one blur would cost",
        _etendue_options,
    ),
    "relight": ("show a finished design in other light", relight_options),
    "road": ("judge a road under lamps with this light by its lighting class, EN 13201", road_options),
    "sweep": ("design every combination of the values of some keys, side by side", sweep_options),
    "tolerance": (
        "say what errors of lens, source and target do to the light, and what shop and mount must hold",
        tolerance_options,
    ),
    "tool": (
        "say whether a tool fits, how its cusps blur the light, and how its machine must move",
        tool_options,
    ),
    "asbuilt": (
        "show the light of a lens as it was made, from measured points of its surface",
        asbuilt_options,
    ),
    "audit": ("measure twelve claims of the README on this machine, in a minute or two", audit_options),
    "bench": ("run a benchmark of a checkout and print its results beside their limits", bench_options),
    "completion": ("print a script that completes commands and options in a shell", _completion_options),
}
