"""Sweeps as programs, and a dask cluster of own processes, to be killed."""

import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"

SMALL = (  # a design of a tenth of a second, which is made many times
    "target.pixels=[24, 24]",
    "lens.rear.freeform.max_level=0",
    "optimizer.iterations=1",
    "optimizer.start=flat",
)
DISTANCES, SOME = 24, 4  # variants, and those that are stored when something is killed
ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT)}
PATIENCE = 60  # seconds: the machine may be busy


def start_sweep(out, *options):
    """Start `thbcad sweep` of small designs."""
    command = [sys.executable, "-m", "optics", "sweep", EXAMPLES / "tophat_circle.toml", "--out", out]
    for change in SMALL:
        command += ["--set", change]
    command += ["--vary", f"target.distance=200:400:{DISTANCES}", *options]
    return subprocess.Popen(
        list(map(str, command)), env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def stored(out):
    """Return {changes: seconds} of what is stored by now."""
    try:
        with sqlite3.connect(f"file:{out}/sweep.sqlite?mode=ro", uri=True) as connection:
            return dict(connection.execute("SELECT changes, seconds FROM variants"))
    except sqlite3.Error:
        return {}


def some_stored(out, process):
    """Wait until a sweep has stored some variants."""
    wait_for(lambda: len(stored(out)) >= SOME or process.poll() is not None)
    if process.poll() is not None:
        raise AssertionError(process.communicate())


def wait_for(condition):
    """Wait until a condition holds, and return what it gives."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        found = condition()
        if found:
            return found
        time.sleep(0.02)
    raise AssertionError("it took too long")


def children(process):
    """Return the processes that a process has started."""
    with suppress(OSError):
        text = Path(f"/proc/{process}/task/{process}/children").read_text()
        return [int(child) for child in text.split()]
    return []


def kill(process):
    with suppress(ProcessLookupError):
        os.kill(process, signal.SIGKILL)


class Cluster:
    """A dask scheduler and two workers, each beneath a process that starts it again."""

    def __init__(self, folder, port=0):
        self._folder, self._processes = folder, []
        self.scheduler = self._start(
            *("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard"),
            *("--scheduler-file", folder / "scheduler.json"),
        )
        self.address = wait_for(self._address)
        self.workers = [self._worker() for _ in range(2)]

    def _worker(self):
        return self._start(
            *("distributed.cli.dask_worker", self.address, "--nthreads", "1", "--no-dashboard"),
            *("--local-directory", self._folder),
        )

    def worker_processes(self):
        """Return the processes that do tasks."""
        found = [children(nanny.pid) for nanny in self.workers]
        return [busiest(processes) for processes in found if processes]

    def stop(self):
        for process in self._processes:
            for child in children(process.pid):
                kill(child)
            process.kill()
            process.wait()

    def _start(self, *words):
        log = (self._folder / f"log_{len(self._processes)}").open("w")
        command = [sys.executable, "-m", *map(str, words)]
        process = subprocess.Popen(command, env=ENVIRONMENT, stdout=log, stderr=log)
        self._processes.append(process)
        return process

    def _address(self):
        with suppress(OSError, ValueError):
            return json.loads((self._folder / "scheduler.json").read_text())["address"]


def busiest(processes):
    """Return the process with most memory: a worker, not what watches over its files."""

    def pages(process):
        with suppress(OSError):
            return int(Path(f"/proc/{process}/statm").read_text().split()[1])
        return 0

    return max(processes, key=pages)


@contextmanager
def cluster(folder, port=0):
    folder.mkdir()
    made = Cluster(folder, port)
    try:
        yield made
    finally:
        made.stop()
