"""The arguments of the command line."""

from __future__ import annotations

import argparse
import textwrap
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

FIRST_STEPS = """thbcad designs freeform lenses: from source and target light to a STEP solid.
  thbcad new                          answer three questions, get my_lens.toml
  thbcad check my_lens.toml           predict lens, light and time in seconds
  thbcad design my_lens.toml --live   design it and watch the light in a browser
  exports/my_lens/report.html         open it: light, lens and all checks
  thbcad --help                       list all commands"""


EXIT_CODES = """Exit codes: 0 done; 1 the light fails its limits, or that is not decided;
2 bad input; 3 numerical failure; 4 the file, a part or a manufacturing limit
fails; 70 internal error; 130 interrupted; 143 terminated."""
HELP_WIDTH, HELP_COLUMN = 80, 14  # of the list of commands
# commands by what they are for, as the help lists them
GROUPS = {
    "Start": ("new", "check", "design"),
    "Look": ("verify", "trace", "relight", "etendue", "road", "audit"),
    "Make": ("export", "sheet", "pack", "tolerance", "tool", "asbuilt"),
    "Many": ("sweep",),
    "Developers": ("bench", "completion"),
}
WITH_SCREEN = ("check", "design", "verify", "tolerance", "tool", "etendue", "asbuilt", "road")


def parsers() -> tuple[CommandParser, dict[str, CommandParser]]:
    """Return the parser of the command line and those of its commands (nothing heavy is imported)."""
    main = CommandParser(
        prog="thbcad",
        description="Freeform illumination lenses: from a target picture to a verified STEP solid.",
    )
    main.listing = f"{_commands_text()}\n\nthbcad COMMAND --help explains a command.\n{EXIT_CODES}\n"
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
        _common_options(commands[name], name in WITH_SCREEN)
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


def _commands_text() -> str:
    """Return a line for each command, in groups, for the help of the program."""
    lines = []
    for group, names in GROUPS.items():
        lines += [f"{group}:", *(_command_line(name, COMMANDS[name][0]) for name in names), ""]
    return "\n".join(lines[:-1])


def _command_line(name: str, sentence: str) -> str:
    """Return a command and what it does, in at most 80 columns."""
    words = textwrap.wrap(sentence, HELP_WIDTH - HELP_COLUMN)
    return f"\n{' ' * HELP_COLUMN}".join([f"  {name:{HELP_COLUMN - 2}}{words[0]}", *words[1:]])


def _common_options(command: CommandParser, screen: bool) -> None:
    """Add the options of all commands.  screen : the command has a first screen and more to say."""
    printed = command.add_mutually_exclusive_group()
    printed.add_argument("--json", action="store_true", help="print the result as JSON")
    if screen:
        printed.add_argument("--full", action="store_true", help="print everything that is known")
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
    command.add_argument(
        "result",
        metavar="RESULT",
        help="result folder, problem.toml, or with --source the STEP file of a lens",
    )
    command.option(
        "--source",
        "LIGHT",
        "the light of a lens: sun, led:SIZEmm, FILE.ies, FILE.ldt (also @DISTANCEmm), or a problem",
    )
    command.option("--at", "MM", "from the rear of that lens to a screen (default: 100)", type=float)
    command.option("--material", "NAME", "of that lens (default: PMMA)")
    command.option("--index", "N", "of that lens, in place of its material", type=float)
    command.switch("--turn", "light meets the other side of that lens first")
    command.option("--rays", "N", "N x N rays (default: 513)", type=int)
    command.choice("--precision", ("double", "single"), "of the sequential trace (default: double)")
    command.out("DIR", "folder to write (default: RESULT/trace, of a problem exports/NAME/trace)")


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
    "design": ("optimise the lens, write and verify the STEP solid, write a report", _design_options),
    "new": ("print a commented problem file to start from", _new_options),
    "check": ("predict lens, light, error and run time in seconds, without optimising", _check_options),
    "verify": (
        "check the STEP file of a result, or any STEP file, with other programs",
        _verify_options,
    ),
    "export": (
        "write the lens in another format, and compare that file with the lens",
        _export_options,
    ),
    "sheet": ("draw the lens with dimensions and ISO 10110 indications", sheet_options),
    "pack": (
        "zip everything that another program or the shop needs",
        pack_options,
    ),
    "trace": (
        "trace a result, a problem, or a lens from a STEP file",
        _trace_options,
    ),
    "etendue": (
        "say whether any lens can make this light from this source",
        _etendue_options,
    ),
    "relight": ("show a finished design with another source", relight_options),
    "road": ("judge a road lit by this lens or luminaire file, by EN 13201", road_options),
    "sweep": ("design all combinations of some values, in parallel", sweep_options),
    "tolerance": (
        "say which manufacturing and mounting errors cost most light",
        tolerance_options,
    ),
    "tool": (
        "say whether a tool fits, and what its cusps do to the light",
        tool_options,
    ),
    "asbuilt": (
        "show the light of a manufactured lens, from its measured surface",
        asbuilt_options,
    ),
    "audit": ("measure twelve claims of the README here, in a minute or two", audit_options),
    "bench": ("run a benchmark of a checkout, and compare it with its limits", bench_options),
    "completion": ("print a shell script that completes commands and options", _completion_options),
}
