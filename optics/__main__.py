"""`python -m optics`: the command line without the installed command."""

from optics.commands import entry

entry()
