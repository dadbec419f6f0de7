"""A quick problem, the command line as a process, and what a refusal must look like."""

import csv
import json
import os
import signal
import subprocess
import sys
from types import SimpleNamespace

from optics.exchange.results import ResultFolder, sha256_of
from optics.interface.commands import main
from optics.interface.commands.arguments import WITH_SCREEN
from tests.cases import ROOT

QUICK = {"optimizer.iterations": [3], "lens.rear.freeform.max_level": 1, "title": 'quick <b>"&'}
FIGURES = {
    "photo",
    "target",
    "irradiance",
    "error",
    "irradiance_02",
    "sag",
    "mesh",
    "loss",
    "solid",
    "scene",
}

TIMED = {"report.html", "result.json"}  # they show times, or hashes of files that do


def strict_json(text):
    """Return parsed JSON; NaN and Infinity, which JSON does not know, are errors."""

    def refuse(word):
        raise ValueError(f"{word} is not JSON")

    return json.loads(text, parse_constant=refuse)


# `thbcad` as a process, with few cells for the greatest concentration: they take most of the time of `check`
COARSE = """
from optics.light.outgoing import concentration
concentration.CELLS = 64
from optics.__main__ import entry
entry()
"""


def command(*arguments, **options):
    """Start the command line as a process of its own."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        [sys.executable, "-m", "optics", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        # as in a terminal, also where the tests themselves run with Ctrl-C ignored
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        **options,
    )


def in_full(arguments):
    """Return the arguments of a command as texts, with --full if it has a first screen and prints text."""
    words = [str(word) for word in arguments]
    screen = words and words[0] in WITH_SCREEN and not {"--json", "--full", "--help"} & {*words}
    return [*words, "--full"] if screen else words


def run(capsys, *arguments):
    """Run a command here with everything that it can print, and return its exit code and its texts."""
    code = main(in_full(arguments))
    captured = capsys.readouterr()
    return SimpleNamespace(code=code, out=captured.out, err=captured.err)


def printed(capsys, *arguments, code=0):
    """Run a command that must end with an exit code, and return what it prints on stdout."""
    done = run(capsys, *arguments)
    assert done.code == code, done.err
    return done.out


def data_of(capsys, *arguments, code=0):
    """Run a command with --json that must end with an exit code, and return its data."""
    return strict_json(printed(capsys, *arguments, "--json", code=code))


def refused(capsys, *arguments):
    """Run a command that must end with exit code 2 and one line on stderr, and return the line."""
    done = run(capsys, *arguments)
    assert (done.code, done.out) == (2, "")
    (line,) = done.err.splitlines()
    assert line.startswith("thbcad: ")
    assert "Traceback" not in line
    return line


def raising(error):
    """Return a function that raises an error, whatever it is given."""

    def failing(*_, **__):
        raise error

    return failing


def assert_no_false_claim(folder):
    """What speaks of a solid speaks of the one that lies there; a whole result is whole."""
    step = folder / "lens.step"
    for name in ("metrics.json", "verify.json", "manufacture.json"):
        if (folder / name).exists():
            assert strict_json((folder / name).read_text())["step_sha256"] == sha256_of(step)
    if (folder / "report.html").exists():
        assert sha256_of(step) in (folder / "report.html").read_text("utf-8")
    if (folder / "result.json").exists():
        record = ResultFolder(folder).read().record
        assert {name: sha256_of(folder / name) for name in record["sha256"]} == record["sha256"]


def assert_whole(folder):
    assert ResultFolder(folder).read().record["ok"]
    assert not [p.name for p in folder.rglob(".*")]
    assert not (folder / "checkpoint.json").exists()


def content(path):
    """Return the bytes of a file; of the files that hold times all else."""
    if path.name == "history.csv":
        with path.open(newline="") as file:
            return [{k: v for k, v in row.items() if k != "seconds"} for row in csv.DictReader(file)]
    if path.name == "metrics.json":
        return {
            k: v for k, v in json.loads(path.read_text("utf-8")).items() if k not in ("wall_s", "peak_mb")
        }
    return None if path.name in TIMED else path.read_bytes()
