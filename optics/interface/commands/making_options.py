"""The options of commands that take a result, and those that several commands have."""

from __future__ import annotations

from optics.interface.commands.command_parser import CommandParser

UNITS = ("m", "mm", "um", "nm")
ROAD_CLASSES = tuple(f"{kind}{number}" for kind in "MP" for number in range(1, 7))
ROAD_ROWS = ("right", "left", "opposite", "staggered")


def sweep_options(command: CommandParser) -> None:
    """Add the options of `thbcad sweep`."""
    problem_options(command)
    command.option(
        "--vary",
        "KEY=VALUES",
        "values of a key: START:STOP:COUNT with both ends, or a list such as [1, 2, 5]; may be "
        "repeated, every combination is designed",
        action="append",
        required=True,
    )
    command.option("--out", "DIR", "folder to write (default: exports/NAME_sweep of the problem file)")
    worker_options(command)
    command.switch(
        "--resume",
        "the folder must hold this sweep; what is done is not computed again, with or without this",
    )
    command.switch("--lenses", "also keep the lens of every variant; those stored without are designed again")
    command.force("drop what the folder holds, and replace files that another program wrote")


def tolerance_options(command: CommandParser) -> None:
    """Add the options of `thbcad tolerance`."""
    command.add_argument("result", metavar="RESULT", help="result folder of a design")
    command.repeated(
        "--set",
        "NAME=AMOUNT",
        "another amount, such as lens.decentre=0.02 (mm); 0 leaves the tolerance out; may be repeated",
    )
    command.option("--tolerances", "FILE.toml", "amounts in a file, in tables such as [lens]")
    command.repeated(
        "--limit",
        "LIMIT",
        "what light must keep, for which the amount of each tolerance is looked for: min_over_mean=0.7, "
        "efficiency=0.85, rel_l2=0.05, or a rise of rel_l2 such as 0.01; may be repeated (default: "
        "min_over_mean=0.7 of uniform light that no rays are counted in, else 0.01)",
    )
    command.switch("--float-shift", "the light may shift as a whole on the target, which follows it")
    command.option(
        "--samples",
        "N",
        "also trace so many lenses with all errors at once, 8 times a power of two such as 512; "
        "front.form and rear.form are amounts then, nm rms of random form errors (default: 50 where free)",
        type=int,
        default=0,
    )
    command.option(
        "--periods", "SHORTEST:LONGEST", "with --samples: of these form errors, mm (default: 2:20)"
    )
    worker_options(command)
    command.out("DIR", "folder to write (default: RESULT)")


def tool_options(command: CommandParser) -> None:
    """Add the options of `thbcad tool`."""
    command.add_argument("result", metavar="RESULT", help="result folder of a design")
    kinds = command.add_mutually_exclusive_group()
    kinds.add_argument("--ball", type=float, metavar="MM", help="radius of a ball end that cuts in rows")
    kinds.add_argument(
        "--nose", type=float, metavar="MM", help="radius of a nose that turns on a spiral (slow tool servo)"
    )
    command.option(
        "--step",
        "MM",
        "with --ball: distance of rows (default: the largest whose cusps blur nowhere by more than a "
        "pixel, or than half the blur that there is)",
        type=float,
    )
    command.option(
        "--speed",
        "MM/MIN",
        "with --ball: along the rows, for the hours of a pass (default: 1000)",
        type=float,
    )
    command.choice("--rows", ("x", "y"), "with --ball: along which rows run (default: x)", default="x")
    command.option("--feed", "MM", "with --nose: for each revolution (default: as of --step)", type=float)
    command.option("--rpm", "N", "with --nose: revolutions for each minute", type=float)
    command.option("--acceleration", "M/S2", "with --nose: that the z axis can do, m/s^2", type=float)
    command.choice("--surface", ("front", "rear"), "to be cut (default: every one that is no plane)")
    command.out("DIR", "folder to write (default: RESULT/tool)")


def asbuilt_options(command: CommandParser) -> None:
    """Add the options of `thbcad asbuilt`."""
    command.add_argument("result", metavar="RESULT", help="result folder of a design")
    command.option("--measured", "FILE", "rows x y z, grid sag .dat, X3P, Zygo, GXYZF", required=True)
    command.choice("--surface", ("front", "rear"), "default: the one that is freeform")
    command.choice("--unit", UNITS, "of x and y (default: mm)", default="mm")
    command.choice("--height-unit", UNITS, "of heights or errors (default: that of --unit)")
    command.switch("--errors", "the third column is made - designed height")
    command.switch("--mirror", "x is turned over, as measured from behind")
    command.choice("--turn", (0, 90, 180, 270), "degrees from +x to +y (default: 0)", type=int, default=0)
    command.switch("--down", "heights are positive against the light")
    command.switch("--centre", "the middle of what was measured is the vertex of the surface")
    command.choice(
        "--align",
        ("datums", "best-fit"),
        "which frame the made lens gets; both are reported (default: datums)",
        default="datums",
    )
    command.switch("--step", "also write lens.step of the made lens")
    command.out("DIR", "folder to write (default: RESULT/asbuilt)")


def road_options(command: CommandParser) -> None:
    """Add the options of `thbcad road`."""
    command.add_argument(
        "result", metavar="RESULT", help="result folder of a design, or an .ies or .ldt file"
    )
    command.choice(
        "--class",
        ROAD_CLASSES,
        "of EN 13201-2: P1 to P6 by illuminance, M1 to M6 by luminance",
        dest="lighting_class",
        required=True,
    )
    command.option("--height", "M", "of the lamps above the road", type=float, required=True)
    command.option("--spacing", "M", "between the lamps of a row", type=float, required=True)
    command.choice("--rows", ROAD_ROWS, "where lamps stand (default: right)", default="right")
    command.option("--lanes", "N", "all in one direction (default: 2)", type=int, default=2)
    command.option("--lane-width", "M", "default: 3.5", type=float, default=3.5)
    command.option(
        "--overhang", "M", "of the lamps over the edge of the road (default: 0)", type=float, default=0.0
    )
    command.option(
        "--tilt", "DEGREES", "by which lamps look up, across the road (default: 0)", type=float, default=0.0
    )
    command.option("--lenses", "N", "like ones in each lamp (default: 1)", type=int, default=1)
    command.option(
        "--maintenance", "FACTOR", "what is left of the initial light (default: 0.8)", type=float, default=0.8
    )
    command.option("--r-table", "FILE", "of the road, for classes M: 29 lines of 20 numbers, as CIE 144 has")
    ray_options(command)


def sheet_options(command: CommandParser) -> None:
    """Add the options of `thbcad sheet`."""
    command.add_argument("result", metavar="RESULT", help="result folder of a design")
    command.option("--out", "FILE", "file to write, .svg, .pdf or .dxf", required=True)
    command.choice(
        "--manner", ("moulded", "cut"), "how the lens is made (default: moulded)", default="moulded"
    )
    command.repeated(
        "--set-indication",
        "NAME=VALUE",
        "give an indication, such as grade='PMMA 8N' or gate=-12,0; may be repeated",
    )
    chord_option(command)
    command.force()


def pack_options(command: CommandParser) -> None:
    """Add the options of `thbcad pack`."""
    command.add_argument("result", metavar="RESULT", help="result folder of a design")
    command.choice(
        "--for",
        ("zemax", "lighttools", "speos", "shop"),
        "whom the pack is for; shop: who makes the lens, without rays and light",
        dest="program",
        required=True,
    )
    command.out("FILE", "zip to write", required=True)


def relight_options(command: CommandParser) -> None:
    """Add the options of `thbcad relight`."""
    command.add_argument("result", metavar="RESULT", help="result folder of a design")
    command.option(
        "--source",
        "LIGHT",
        "sun, led:SIZEmm, FILE.ies, FILE.ldt (these also with @DISTANCEmm), or a problem file",
        required=True,
    )
    command.out("FILE.png", "picture: asked for, as designed, in other light")


def bench_options(command: CommandParser) -> None:
    """Add the options of `thbcad bench`."""
    command.add_argument("name", metavar="NAME", nargs="?", help="a module of benchmarks/, such as overview")
    command.switch("--store", "also keep the results in docs/data/NAME.json")
    command.switch("--quick", "a small version (of thesis or others)")
    command.option("--only", "N", "one study (of thesis) or lens (of gallery)", type=int)
    command.switch("--resume", "run only what is missing (of thesis)")
    command.switch(
        "--markdown",
        "run nothing: write docs/benchmarks.md and the marked numbers of README and docs from docs/data",
    )


def audit_options(command: CommandParser) -> None:
    """Add the options of `thbcad audit`."""
    command.option("--out", "DIR", "new folder that keeps the designs, the damaged file and audit.json")


def chord_option(command: CommandParser) -> None:
    """Add --chord."""
    command.option(
        "--chord",
        "MM",
        "error that meshes and drawings may have, in mm (default: 1e-3)",
        type=float,
        default=1e-3,
    )


def ray_options(command: CommandParser) -> None:
    """Add what an intensity is traced with."""
    command.option("--rays", "N", "of light, about (default: 1000000)", type=int, default=1_000_000)
    command.option(
        "--step",
        "DEGREES",
        "of gamma in intensities, a part of 180; that of C is twice as large (default: 2.5)",
        type=float,
        default=2.5,
    )


def problem_options(command: CommandParser) -> None:
    """Add the problem file, and what changes its keys."""
    command.add_argument("problem", metavar="PROBLEM.toml", help="problem file")
    command.repeated(
        "--set",
        "KEY=VALUE",
        "change a key of the problem file, such as target.distance=400; VALUE is TOML, quotes around "
        "a text may be left out; may be repeated",
    )


def worker_options(command: CommandParser) -> None:
    """Add the workers that do many tasks."""
    command.option("--workers", "N", "processes of this machine (default: as many as cores)", type=int)
    command.option(
        "--scheduler", "ADDRESS", "of a dask cluster whose workers are taken instead, such as tcp://host:8786"
    )
