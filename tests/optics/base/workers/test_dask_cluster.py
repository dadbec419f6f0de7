"""Tasks on the workers of a dask cluster: the same results and sentences as on processes of this machine."""

from importlib.util import find_spec

import pytest

from optics.base.runtime import UserError
from optics.base.workers import run_tasks, worker_pool
from oracles.sweep_programs import cluster
from tests.optics.base.workers import tasks

pytestmark = [  # found, not loaded: that takes a second in every process that collects this file
    pytest.mark.slow,
    pytest.mark.skipif(find_spec("distributed") is None, reason="distributed is not installed"),
]


@pytest.fixture(scope="module")
def pool(tmp_path_factory):
    with (
        cluster(tmp_path_factory.mktemp("dask") / "cluster") as made,
        worker_pool(None, made.address) as found,
    ):
        yield found


def test_every_item_has_its_result(pool):
    found = sorted(run_tasks(tasks.add, range(40), pool, 5), key=lambda r: r.index)
    assert [r.value for r in found] == list(range(5, 45))


def test_a_task_that_raises_has_a_sentence_and_the_others_go_on(pool):
    found = {r.index: r for r in run_tasks(tasks.fail_odd, range(6), pool)}
    assert [found[k].value for k in (0, 2)] == [0, 2]
    assert found[3].failure == "3 is odd"
    assert found[4].failure == "internal error: ZeroDivisionError: by four"


def test_what_cannot_be_sent_has_a_sentence(pool):
    (found,) = run_tasks(tasks.add, [lambda: 0], pool, 5)
    assert found.failure


def test_tasks_that_kill_their_workers_are_blamed_alone(pool, tmp_path):
    items = [(k, tmp_path) for k in range(12)]
    found = {r.index: r for r in run_tasks(tasks.kill_marked, items, pool, {3, 7})}
    assert {k for k, r in found.items() if r.killed} == {3, 7}
    assert [found[k].value for k in sorted(set(found) - {3, 7})] == [0, 1, 2, 4, 5, 6, 8, 9, 10, 11]


def test_tasks_whose_worker_is_killed_once_succeed(pool, tmp_path):
    found = list(run_tasks(tasks.kill_once, [(k, tmp_path) for k in range(11)], pool))
    assert sorted(r.value for r in found) == list(range(11))


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "127.0.0.1:nine", "carrier-pigeon://x:1"])
def test_a_scheduler_that_does_not_answer_is_named(address, monkeypatch):
    monkeypatch.setattr("optics.base.workers.dask_cluster.PATIENCE", 1.0)
    with pytest.raises(UserError, match="no dask scheduler answers at"), worker_pool(None, address):
        pass
