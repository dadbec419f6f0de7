"""The command run in this process, and the files that it left."""

from types import SimpleNamespace

from optics.interface.commands import main


def run(capsys, *arguments):
    code = main([str(a) for a in arguments])
    captured = capsys.readouterr()
    return SimpleNamespace(code=code, out=captured.out, err=captured.err)


def names(folder):
    return sorted(p.name for p in folder.iterdir())
