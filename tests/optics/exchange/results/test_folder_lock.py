"""The lock of a result folder, among processes: with POSIX, and without."""

import os
import subprocess
import sys

import pytest

from tests.cases import ROOT
from tests.without_posix import without_posix

HOLD = """
import sys, time
from pathlib import Path
from optics.base.runtime import POSIX
from optics.exchange.results.folder_lock import run_lock
with run_lock(Path(sys.argv[1]), "mine"):
    print(POSIX, flush=True)
    time.sleep(1000)
"""
ASK = """
import sys
from pathlib import Path
from optics.exchange.results.folder_lock import require_no_run, run_lock
folder = Path(sys.argv[1])
for ask in (require_no_run, lambda folder: run_lock(folder, "theirs").__enter__()):
    try:
        ask(folder)
        print("free")
    except Exception as error:
        print(type(error).__name__, error)
"""


def asked(folder, environment):
    """Return what a process is told that looks at a folder and then wants to write there."""
    done = subprocess.run(
        [sys.executable, "-c", ASK, folder], env=environment, capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()


@pytest.mark.every(2)
@pytest.mark.parametrize("posix", [True, False], ids=["with POSIX", "without"])
def test_one_process_holds_a_folder_until_it_ends_however(posix, tmp_path):
    folder, hook = tmp_path / "folder", tmp_path / "hook"
    folder.mkdir()
    hook.mkdir()
    environment = os.environ | {"PYTHONPATH": str(ROOT)} if posix else without_posix(hook)
    first = subprocess.Popen(
        [sys.executable, "-c", HOLD, folder], env=environment, stdout=subprocess.PIPE, text=True
    )
    assert first.stdout.readline() == f"{posix}\n"
    who = f"process {first.pid}, 'mine'" if posix else "another process"
    told = f"UserError another run writes to {folder} ({who}); wait until it ends, or choose another --out"
    assert asked(folder, environment) == [told, told]
    first.kill()
    first.communicate()
    assert asked(folder, environment) == ["free", "free"]
