"""A design stopped at every file operation: no file claims what is not so, and the next run ends well.

All that computes is replaced by what one real run computed; all that writes is real.
"""

import hashlib
import shutil
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from importlib import import_module
from types import SimpleNamespace

import pytest

from optics.base.runtime import process_for
from optics.designing.optimisation import State
from optics.interface.commands import main
from tests.optics.cases import write_problem
from tests.optics.interface.commands.cases import QUICK, TIMED, assert_no_false_claim, assert_whole, content
from tests.optics.interface.commands.faulty_disk import FaultyDisk, Killed
from thbcad.io import write_bytes

NEW = QUICK | {"lens.rear.freeform.max_level": 0, "title": "new", "run.threads": 1}
EXPECTED = {"SIGINT": 130, "SIGTERM": 143, "ENOSPC": 2, "SIGKILL": None}
FEWEST_OPERATIONS = 60


STEPS = (  # of a design that compute: module and function
    ("optics.interface.api.design_run", "shape_lens"),
    ("optics.interface.api.design_result", "measured"),
    ("optics.interface.api.design_files", "_checks"),
    ("optics.interface.api.design_figures", "elements_sight"),
    ("optics.interface.api.design_figures", "photograph"),
    ("optics.interface.api.design_figures", "photo_caption"),
    ("optics.interface.commands.design_command", "system_of"),
)


class Answers:
    """Stands for the helper processes: records what it answers, or answers what was recorded."""

    def __init__(self, process=None):
        self.process, self.kept, self.step = process, {}, b""

    def ask(self, module, function, *arguments):
        answer = Future()
        if self.process:
            self.kept[function] = self.process.ask(module, function, *arguments).result()
            if function == "export_step":
                self.step = arguments[2].read_bytes()
        elif function == "export_step":
            try:
                write_bytes(arguments[2], self.step)
            except OSError as error:
                answer.set_exception(error)
                return answer
        answer.set_result(self.kept[function])
        return answer

    def done(self):
        """Nothing is asked any more."""


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """Design a problem, and keep all that is computed for later runs."""
    root = tmp_path_factory.mktemp("kept")
    kept = SimpleNamespace(problem=write_problem(root, NEW), values={}, gone_on=set())

    @contextmanager
    def recorded(forked):
        with process_for("all") as process:
            kept.answers = Answers(process)
            yield kept.answers, kept.answers

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("optics.interface.api.helpers", recorded)
        for module, function in STEPS:
            record(patch, module, function, kept.values)
        assert main(["design", str(kept.problem), "--out", str(root / "out"), "--json"]) == 0
    kept.answers.process = None
    return kept


def record(patch, module, function, values):
    """Let a step of a design keep what it returns."""
    genuine = getattr(import_module(module), function)

    def recorded(*arguments):
        values[function] = genuine(*arguments)
        return values[function]

    patch.setattr(f"{module}.{function}", recorded)


@pytest.fixture
def replayed(kept, monkeypatch):
    """Runs of the problem that compute nothing: call it with the options behind `design PROBLEM`."""

    @contextmanager
    def answers(forked):
        yield kept.answers, kept.answers

    def shaped(system, backend, engine, state, start, listener):
        lens, final = kept.values["shape_lens"]
        for stage in (0, final.stage):  # as two levels would
            listener.checkpoint(State(final.started_from_transport, stage, final.sags, final.history))
        return lens, final

    monkeypatch.setattr("optics.interface.api.helpers", answers)
    for module, function in STEPS:
        monkeypatch.setattr(f"{module}.{function}", lambda *_, value=kept.values[function]: value)
    monkeypatch.setattr("optics.interface.api.design_run.shape_lens", shaped)
    monkeypatch.setattr("optics.interface.api.design_figures.scene_paths", lambda *_: [])
    monkeypatch.setattr(
        "optics.interface.api.prepared_problem.resolved", lambda system, backend: (system, None)
    )

    def run(out, *options):
        return main(["design", str(kept.problem), "--out", str(out), "--json", *options])

    run.gone_on = kept.gone_on  # what lay in folders in which a run went on and ended well
    return run


def held(folder, old):
    """Return a hash of what lies in a folder, but for times and the random ends of temporary names."""

    def of_file(path):
        name = path.relative_to(folder)
        if path.name.startswith("."):  # a temporary file: none is read
            return str(name).rpartition(".")[0]
        if path.name in TIMED:  # whole, and of the files beside it: or `assert_no_false_claim` fails
            return name, bool(old) and path.read_bytes() == (old / name).read_bytes()
        return name, path.is_file() and content(path)

    return hashlib.sha256(repr([of_file(path) for path in sorted(folder.rglob("*"))]).encode()).digest()


def assert_nothing_false_when_stopped(replayed, capsys, folder, fault, at, old=None):
    """Stop a run at an operation, and check what lies there and, unless so much lay there before, how it
    goes on.

    old : an older result of another problem, over which it runs.
    """
    if old:
        shutil.copytree(old, folder)
    else:
        folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    disk = FaultyDisk(fault, at)
    code = None
    with disk.installed(), suppress(Killed):
        code = replayed(folder, "--force")
    captured = capsys.readouterr()
    if disk.count >= at and code != 0:  # the last removals of a run may fail without harm
        assert code == EXPECTED[fault]
        assert "Traceback" not in captured.err
    assert (folder / "notes.txt").read_text() == "mine"
    assert_no_false_claim(folder)
    go_on = "--resume" if at % 2 and (folder / "checkpoint.json").exists() else "--force"
    if (state := (go_on, held(folder, old))) not in replayed.gone_on:
        assert replayed(folder, go_on) == 0
        assert_whole(folder)
        assert (folder / "notes.txt").read_text() == "mine"
        replayed.gone_on.add(state)
    shutil.rmtree(folder)


@pytest.fixture
def operations(golden, replayed, tmp_path, capsys):
    """The number of file operations of a run over an older result."""
    folder = shutil.copytree(golden.path, tmp_path / "counted")
    with FaultyDisk().installed() as disk:
        assert replayed(folder, "--force") == 0
    assert_whole(folder)
    assert disk.count >= FEWEST_OPERATIONS
    return disk.count


@pytest.mark.every(2)
@pytest.mark.parametrize(
    "fault",
    ["SIGINT", "SIGKILL", *(pytest.param(fault, marks=pytest.mark.slow) for fault in ("SIGTERM", "ENOSPC"))],
)
def test_a_run_stopped_at_some_file_operations_claims_nothing_false(
    golden, replayed, operations, capsys, tmp_path, fault
):
    for at in range(5 + 3 * list(EXPECTED).index(fault), operations + 1, operations // 5):
        assert_nothing_false_when_stopped(replayed, capsys, tmp_path / f"{at}", fault, at, golden.path)


@pytest.mark.slow
@pytest.mark.parametrize("over", [True, False], ids=["over an older result", "in an empty folder"])
@pytest.mark.parametrize("fault", EXPECTED)
def test_a_run_stopped_at_every_file_operation_claims_nothing_false(
    golden, replayed, operations, capsys, tmp_path, fault, over
):
    """At every third for SIGTERM, which ends a run by the same exception as SIGINT."""
    for at in range(1, operations + 1, 3 if fault == "SIGTERM" else 1):
        assert_nothing_false_when_stopped(
            replayed, capsys, tmp_path / f"{at}", fault, at, golden.path if over else None
        )
