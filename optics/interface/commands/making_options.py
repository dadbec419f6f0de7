"""The options of commands on making a design, and those that several commands have."""

from __future__ import annotations

import argparse

UNITS = ("m", "mm", "um", "nm")


def sweep_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `thbcad sweep`."""
    problem_options(command)
    command.add_argument(
        "--vary",
        action="append",
        required=True,
        metavar="KEY=VALUES",
        help="values of a key: START:STOP:COUNT with both ends, or a list such as [1, 2, 5]; may be "
        "repeated, every combination is designed",
    )
    command.add_argument(
        "--out", metavar="DIR", help="folder to write (default: exports/NAME_sweep of the problem file)"
    )
    worker_options(command)
    command.add_argument(
        "--resume",
        action="store_true",
        help="the folder must hold this sweep; what is done is not computed again, with or without this",
    )
    command.add_argument(
        "--lenses",
        action="store_true",
        help="also keep the lens of every variant; those stored without are designed again",
    )
    force_option(command)


def tolerance_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `thbcad tolerance`."""
    command.add_argument("result", metavar="RESULT", help="result folder of a design")
    command.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=AMOUNT",
        help="another amount, such as lens.decentre=0.02 (mm); 0 leaves the tolerance out; may be repeated",
    )
    command.add_argument(
        "--tolerances", metavar="FILE.toml", help="amounts in a file, in tables such as [lens]"
    )
    command.add_argument(
        "--limit",
        action="append",
        default=[],
        metavar="LIMIT",
        help="what light must keep, for which the amount of each tolerance is looked for: min_over_mean=0.7, "
        "efficiency=0.85, rel_l2=0.05, or a rise of rel_l2 such as 0.01; may be repeated (default: "
        "min_over_mean=0.7 of uniform light that no rays are counted in, else 0.01)",
    )
    command.add_argument(
        "--float-shift",
        action="store_true",
        help="the light may shift as a whole on the target, which follows it",
    )
    command.add_argument(
        "--samples",
        type=int,
        default=0,
        metavar="N",
        help="also trace so many lenses with all errors at once, 8 times a power of two such as 512; "
        "front.form and rear.form are amounts then, nm rms of random form errors (default: 50 where free)",
    )
    command.add_argument(
        "--periods",
        metavar="SHORTEST:LONGEST",
        help="with --samples: of these form errors, mm (default: 2:20)",
    )
    worker_options(command)
    command.add_argument("--out", metavar="DIR", help="folder to write (default: RESULT)")
    force_option(command)


def tool_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `thbcad tool`."""
    command.add_argument("result", metavar="RESULT", help="result folder of a design")
    kinds = command.add_mutually_exclusive_group()
    kinds.add_argument("--ball", type=float, metavar="MM", help="radius of a ball end that cuts in rows")
    kinds.add_argument(
        "--nose", type=float, metavar="MM", help="radius of a nose that turns on a spiral (slow tool servo)"
    )
    command.add_argument(
        "--step",
        type=float,
        metavar="MM",
        help="with --ball: distance of rows (default: the largest whose cusps blur nowhere by more than a "
        "pixel, or than the blur that there is)",
    )
    command.add_argument(
        "--speed",
        type=float,
        metavar="MM/MIN",
        help="with --ball: along the rows, for the hours of a pass (default: 1000)",
    )
    command.add_argument(
        "--rows", choices=("x", "y"), default="x", help="with --ball: along which rows run (default: x)"
    )
    command.add_argument(
        "--feed",
        type=float,
        metavar="MM",
        help="with --nose: for each revolution (default: as of --step)",
    )
    command.add_argument("--rpm", type=float, metavar="N", help="with --nose: revolutions for each minute")
    command.add_argument(
        "--acceleration", type=float, metavar="M/S2", help="with --nose: that the z axis can do, m/s^2"
    )
    command.add_argument(
        "--surface", choices=("front", "rear"), help="to be cut (default: every one that is no plane)"
    )
    command.add_argument("--out", metavar="DIR", help="folder to write (default: RESULT/tool)")
    force_option(command)


def asbuilt_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `thbcad asbuilt`."""
    command.add_argument("result", metavar="RESULT", help="result folder of a design")
    command.add_argument(
        "--measured", metavar="FILE", required=True, help="rows x y z (XYZ, .dat, .csv), or a grid sag .dat"
    )
    command.add_argument("--surface", choices=("front", "rear"), help="default: the one that is freeform")
    command.add_argument("--unit", choices=UNITS, default="mm", help="of x and y (default: mm)")
    command.add_argument(
        "--height-unit", choices=UNITS, help="of heights or errors (default: that of --unit)"
    )
    command.add_argument("--errors", action="store_true", help="the third column is made - designed height")
    command.add_argument("--mirror", action="store_true", help="x is turned over, as measured from behind")
    command.add_argument(
        "--turn", type=int, choices=(0, 90, 180, 270), default=0, help="degrees from +x to +y (default: 0)"
    )
    command.add_argument("--down", action="store_true", help="heights are positive against the light")
    command.add_argument(
        "--align",
        choices=("datums", "best-fit"),
        default="datums",
        help="which frame the made lens gets; both are reported (default: datums)",
    )
    command.add_argument("--step", action="store_true", help="also write lens.step of the made lens")
    command.add_argument("--out", metavar="DIR", help="folder to write (default: RESULT/asbuilt)")
    force_option(command)


def problem_options(command: argparse.ArgumentParser) -> None:
    """Add the problem file, and what changes its keys."""
    command.add_argument("problem", metavar="PROBLEM.toml", help="problem file")
    command.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="change a key of the problem file, such as target.distance=400; VALUE is TOML, quotes around "
        "a text may be left out; may be repeated",
    )


def force_option(command: argparse.ArgumentParser) -> None:
    """Add --force."""
    command.add_argument(
        "--force", action="store_true", help="replace files that another problem or program wrote"
    )


def worker_options(command: argparse.ArgumentParser) -> None:
    """Add the workers that do many tasks."""
    command.add_argument(
        "--workers", type=int, metavar="N", help="processes of this machine (default: as many as cores)"
    )
    command.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="of a dask cluster whose workers are taken instead, such as tcp://host:8786",
    )
