"""Options that several commands have."""

from __future__ import annotations

import argparse


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
