"""Tasks on processes of this machine and on the workers of a dask cluster: results, failures, killed workers;
a lack of memory, bad arguments."""

import errno
import os
import re
import signal
import time
from contextlib import closing
from importlib.util import find_spec
from threading import Lock

import pytest

from examples.thesis.chapter7.two_source_landscape import all_values
from optics.base.runtime import NumericalError, UserError
from optics.base.workers import lacks_memory, run_tasks, worker_pool
from optics.base.workers.task_loop import MOST_IN_FLIGHT
from oracles.sweep_programs import cluster
from tests.optics.base.workers import tasks

# found, not loaded: that takes a second in every process that collects this file
without_dask = pytest.mark.skipif(find_spec("distributed") is None, reason="distributed is not installed")


@pytest.fixture(scope="module")
def pool():
    with worker_pool(2) as found:
        yield found


@pytest.fixture(scope="module")
def dask(tmp_path_factory):
    with (
        cluster(tmp_path_factory.mktemp("dask") / "cluster") as made,
        worker_pool(None, made.address) as found,
    ):
        yield found


@pytest.fixture(params=["pool", pytest.param("dask", marks=[pytest.mark.slow, without_dask])])
def any_pool(request):
    return request.getfixturevalue(request.param)


def test_every_item_has_its_result(any_pool):
    found = sorted(run_tasks(tasks.add, range(40), any_pool, 5), key=lambda r: r.index)
    assert [r.value for r in found] == list(range(5, 45))
    assert all(r.seconds >= 0 and r.peak_mb > 1 and not r.failure for r in found)


def test_all_values_are_those_of_a_loop_in_the_order_of_the_items(pool):
    assert all_values(tasks.add, range(9), pool, 5) == all_values(tasks.add, range(9), None, 5)
    with pytest.raises(NumericalError, match="task 2 of 3 failed: 1 is odd"):
        all_values(tasks.fail_odd, range(3), pool)


def workers_of(pool):
    """Return the processes of two workers; on a busy machine one may be late."""
    seen = set()
    with closing(run_tasks(tasks.process_after, range(1000), pool, 0.01)) as results:
        for result in results:
            seen.add(result.value)
            if len(seen) == 2:
                return seen
    raise AssertionError("one worker did everything")


def test_both_workers_work(pool):
    assert len(workers_of(pool)) == 2


def test_a_task_that_raises_has_a_sentence_and_the_others_go_on(any_pool):
    found = {r.index: r for r in run_tasks(tasks.fail_odd, range(6), any_pool)}
    assert [found[k].value for k in (0, 2)] == [0, 2]
    assert found[3].failure == "3 is odd"
    assert found[4].failure == "internal error: ZeroDivisionError: by four"
    assert not any(r.killed for r in found.values())


def test_what_cannot_be_sent_has_a_sentence(any_pool):
    items = [1, lambda: 0, Lock(), tasks.Unreadable(), 2]
    found = {r.index: r for r in run_tasks(tasks.add, items, any_pool, 5)}
    assert [found[k].value for k in (0, 4)] == [6, 7]
    for k in (1, 2, 3):
        assert re.match(r"the item of a task cannot be sent .*; it must be what pickle", found[k].failure)
        assert not found[k].killed


def test_what_cannot_be_answered_has_a_sentence(any_pool):
    items = ["unsent", "unread", "exit", "well"]
    found = {r.index: r for r in run_tasks(tasks.answer_or_end, items, any_pool)}
    for k in (0, 1):
        assert re.match(r"what a task returns cannot be sent .*; it must be what pickle", found[k].failure)
    assert found[2].failure == "internal error: SystemExit: the task is tired"
    assert found[3].value == "well"
    assert not any(r.killed for r in found.values())


@pytest.mark.parametrize("common", [lambda: 0, tasks.Unreadable()], ids=["unsent", "unread"])
def test_what_all_tasks_share_and_cannot_be_sent_is_named(any_pool, common):
    with pytest.raises(UserError, match=r"what all tasks share cannot be sent .*; it must be what pickle"):
        list(run_tasks(tasks.add, [1], any_pool, common))


def with_killers(pool, folder):
    """Return the results of twelve tasks, of which two kill their workers, by their numbers."""
    items = [(k, folder) for k in range(12)]
    return {r.index: r for r in run_tasks(tasks.kill_marked, items, pool, {3, 7})}


def test_tasks_that_kill_their_workers_are_blamed_alone(any_pool, tmp_path):
    found = with_killers(any_pool, tmp_path)
    assert {k for k, r in found.items() if r.killed} == {3, 7}
    assert "its worker ended" in found[3].failure
    assert [found[k].value for k in sorted(set(found) - {3, 7})] == [0, 1, 2, 4, 5, 6, 8, 9, 10, 11]


def test_a_task_that_kills_its_worker_is_tried_twice_and_others_once(pool, tmp_path):
    """Dask tries by itself, too."""
    with_killers(pool, tmp_path)
    tries = {int(path.name): len(path.read_text()) for path in tmp_path.iterdir()}
    assert {k: n for k, n in tries.items() if n > 1} == {3: 2, 7: 2}


def test_a_task_whose_worker_is_killed_once_succeeds(any_pool, tmp_path):
    found = list(run_tasks(tasks.kill_once, [(k, tmp_path) for k in range(11)], any_pool))
    assert sorted(r.value for r in found) == list(range(11))


def test_two_workers_may_not_take_three_quarters_of_the_memory_each(pool):
    whole = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    found = {r.index: r for r in run_tasks(tasks.allocate, [1000, 3 * whole // 4], pool)}
    assert found[0].value == 1000
    assert "out of memory" in found[1].failure


def test_a_lack_of_memory_inside_an_operation_of_drjit_is_said(pool):
    words = "jit_malloc(): out of memory! Could not allocate 1048576 bytes (backend=LLVM, shared=0)."
    for result in run_tasks(tasks.fail_in_drjit, [MemoryError(), RuntimeError(words)], pool):
        assert result.failure == "out of memory; use fewer pixels, rays or levels, or fewer workers"


def test_a_worker_without_a_task_is_not_started_and_takes_no_memory():
    whole = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    for count, started in ((2, 2), (500, 3), (0, 1)):
        with worker_pool(3, tasks=count) as pool:
            assert [worker.memory for worker in pool.present().values()] == [whole // started] * started


def test_items_are_read_as_they_are_needed(pool):
    read = []
    results = run_tasks(tasks.add, (read.append(k) or k for k in range(1000)), pool, 0)
    for _ in range(10):
        next(results)
    results.close()
    assert len(read) <= 10 + 2 * MOST_IN_FLIGHT + 1


def test_no_process_stays_behind():
    with worker_pool(2) as pool:
        workers = workers_of(pool)
    for process in workers:
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)


def test_an_idle_worker_that_is_killed_is_replaced():
    with worker_pool(1) as pool:
        (first,) = run_tasks(tasks.process_after, [0], pool, 0)
        os.kill(first.value, signal.SIGKILL)
        time.sleep(0.1)
        (second,) = run_tasks(tasks.process_after, [0], pool, 0)
    assert second.value != first.value


@pytest.mark.parametrize("workers", [0, -1, 2.0, True, "2", 5000])
def test_a_number_of_workers_that_cannot_be_is_refused(workers):
    with (
        pytest.raises(UserError, match="the number of workers must be a whole number from 1"),
        worker_pool(workers),
    ):
        pass


@without_dask
@pytest.mark.slow
@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "127.0.0.1:nine", "carrier-pigeon://x:1"])
def test_a_scheduler_that_does_not_answer_is_named(address, monkeypatch):
    monkeypatch.setattr("optics.base.workers.dask_cluster.PATIENCE", 1.0)
    with pytest.raises(UserError, match="no dask scheduler answers at"), worker_pool(None, address):
        pass


def test_workers_and_a_scheduler_exclude_each_other():
    with pytest.raises(UserError, match="not both"), worker_pool(2, "tcp://localhost:1"):
        pass


def operation(dr, error):
    """Return what Dr.Jit raises where an operation of ours raises an error."""

    class Fails(dr.CustomOp):
        def eval(self):
            raise error

    with pytest.raises(RuntimeError, match=r"drjit\.custom") as raised:
        dr.custom(Fails)
    return raised.value


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        RuntimeError("jit_malloc(): out of memory! Could not allocate 1048576 bytes (backend=LLVM)."),
        RuntimeError("jit_llvm_compile(): could not allocate 4096 bytes of memory!"),
    ],
    ids=["Python", "arrays", "code"],
)
def test_a_lack_of_memory_inside_an_operation_is_known(backend, error):
    assert lacks_memory(error)
    assert lacks_memory(operation(backend.dr, error))


@pytest.mark.parametrize(
    "error",
    [
        OSError(errno.ENOMEM, "Cannot allocate memory"),
        ImportError("_flapack.so: failed to map segment from shared object"),
        ImportError("_core.so: cannot allocate memory in static TLS block"),
    ],
)
def test_a_lack_of_memory_of_the_system_is_known(error):
    assert lacks_memory(error)


def test_other_errors_are_none(backend):
    assert not lacks_memory(operation(backend.dr, ZeroDivisionError("by four")))
    assert not lacks_memory(ValueError("out of memory"))
    assert not lacks_memory(OSError(errno.ENOENT, "No such file"))
    assert not lacks_memory(ImportError("no module named memory"))


def after_a_lack(error, cause):
    """Return an error that was raised while a lack of memory was dealt with."""
    try:
        try:
            raise MemoryError
        except MemoryError:
            raise error from cause
    except ValueError as raised:
        return raised


def test_a_lack_of_memory_that_another_error_hides_does_not_count():
    assert lacks_memory(after_a_lack(ValueError(), MemoryError()))
    assert not lacks_memory(after_a_lack(ValueError(), None))
    assert not lacks_memory(after_a_lack(ValueError(), OSError()))
    during = ValueError()
    during.__context__ = MemoryError()
    assert lacks_memory(during)
