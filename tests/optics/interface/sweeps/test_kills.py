"""kill -9 of worker, client and scheduler in mid-sweep: nothing stored is lost, the table is completed."""

import csv
import signal
from pathlib import Path

import pytest

from oracles.sweep_programs import (
    DISTANCES,
    SOME,
    children,
    cluster,
    kill,
    some_stored,
    start_sweep,
    stored,
    wait_for,
)

pytestmark = pytest.mark.slow


def table(out):
    with (out / "sweep.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def require_complete(out):
    rows = table(out)
    assert len(rows) == DISTANCES
    assert [row["target.distance"] for row in rows] == sorted({r["target.distance"] for r in rows}, key=float)
    assert {row["status"] for row in rows} == {"done"}
    assert len(stored(out)) == DISTANCES


def require_kept(before, after):
    """Rows that were stored are there, and were not computed again."""
    assert before
    assert before.items() <= after.items()


def finish(process):
    out, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    return out


def test_a_killed_worker_costs_no_row(tmp_path):
    sweep = start_sweep(tmp_path, "--workers", 2)
    some_stored(tmp_path, sweep)
    before = stored(tmp_path)
    kill(children(sweep.pid)[0])
    finish(sweep)
    require_complete(tmp_path)
    require_kept(before, stored(tmp_path))


def test_a_killed_client_leaves_no_worker_and_resume_completes_the_table(tmp_path):
    sweep = start_sweep(tmp_path, "--workers", 2)
    some_stored(tmp_path, sweep)
    workers = children(sweep.pid)
    assert len(workers) == 2
    kill(sweep.pid)
    sweep.communicate()
    wait_for(lambda: not any(map(running, workers)))
    before = stored(tmp_path)
    finish(start_sweep(tmp_path, "--workers", 2, "--resume"))
    require_complete(tmp_path)
    require_kept(before, stored(tmp_path))


def test_ctrl_c_stops_at_once_and_keeps_what_is_done(tmp_path):
    signal.signal(signal.SIGINT, signal.default_int_handler)  # the tests may run in the background
    sweep = start_sweep(tmp_path, "--workers", 2)
    some_stored(tmp_path, sweep)
    sweep.send_signal(signal.SIGINT)
    _, errors = sweep.communicate(timeout=20)
    assert sweep.returncode == 130
    assert "the same command with --resume goes on" in errors
    assert errors.endswith("thbcad: interrupted\n")
    assert "Traceback" not in errors
    assert len(stored(tmp_path)) >= SOME


def running(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.fixture
def dask(tmp_path):
    pytest.importorskip("distributed")
    with cluster(tmp_path / "cluster") as made:
        yield made


def test_a_killed_worker_of_a_cluster_costs_no_row(dask, tmp_path):
    out = tmp_path / "out"
    sweep = start_sweep(out, "--scheduler", dask.address)
    some_stored(out, sweep)
    before = stored(out)
    kill(dask.worker_processes()[0])
    finish(sweep)
    require_complete(out)
    require_kept(before, stored(out))


def test_a_killed_scheduler_ends_the_client_in_one_sentence_and_resume_completes_the_table(dask, tmp_path):
    out = tmp_path / "out"
    sweep = start_sweep(out, "--scheduler", dask.address)
    some_stored(out, sweep)
    kill(dask.scheduler.pid)
    _, errors = sweep.communicate(timeout=60)
    assert sweep.returncode == 2
    said = [line for line in errors.splitlines() if line.startswith("thbcad: ")]
    assert len(said) == 1
    assert "the dask scheduler at" in said[0]
    assert "the same command with --resume goes on" in said[0]
    assert "Traceback" not in errors
    before = stored(out)
    with cluster(tmp_path / "again") as again:
        finish(start_sweep(out, "--scheduler", again.address, "--resume"))
    require_complete(out)
    require_kept(before, stored(out))


def test_a_killed_client_of_a_cluster_goes_on_there_or_here(dask, tmp_path):
    out = tmp_path / "out"
    sweep = start_sweep(out, "--scheduler", dask.address)
    some_stored(out, sweep)
    kill(sweep.pid)
    sweep.communicate()
    before = stored(out)
    finish(start_sweep(out, "--scheduler", dask.address, "--resume"))
    require_complete(out)
    require_kept(before, stored(out))
