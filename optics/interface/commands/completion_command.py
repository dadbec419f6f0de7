"""`thbcad completion`: a script that completes commands and options in a shell."""

from __future__ import annotations

from argparse import Namespace

from optics.interface.commands.arguments import parsers
from optics.interface.commands.command_parser import PATHS
from optics.interface.commands.outcome import Outcome


def completion(options: Namespace) -> Outcome:
    """Print the script for a shell."""
    import shtab

    main, commands = parsers()
    for command in commands.values():
        for action in command._actions:
            if action.metavar in PATHS:
                action.complete = shtab.FILE  # type: ignore[attr-defined]
    script = shtab.complete(main, shell=options.shell)
    return Outcome({"shell": options.shell, "script": script}, script.splitlines())
