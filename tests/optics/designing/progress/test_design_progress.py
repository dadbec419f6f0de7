"""Progress of a design: recorded runs replayed by a clock, a bar, and plain lines."""

import io
import json
import re
from itertools import pairwise
from threading import Event
from types import SimpleNamespace

import pytest

from optics.designing.optimisation import Stage
from optics.designing.progress.design_progress import DesignProgress, Size
from optics.designing.progress.progress_bar import Bar, Lines, drawing, time_words
from optics.scene.keys import AUTO
from optics.scene.problem import FINEST_AUTO
from tests.cases import DATA

RUNS = json.loads((DATA / "recorded_runs.json").read_text())
LATE = "disk on black"  # planned after 35 %


def plan_of(run):
    return [
        Stage(
            level=level,
            iterations=iterations,
            screen=SimpleNamespace(pixels=pixels),
            rays=rays,
            final=False,
            exact=False,
            finish=finish,
            again=finish and before[4],
            aimed=aimed,
            other_ways=other_ways,
        )
        for before, (level, iterations, pixels, rays, finish, aimed, other_ways) in pairwise(
            [run["plan"][0], *run["plan"]]
        )
    ]


def system_of(run):
    """The system of a run as it is asked for: what is automatic takes the finest level."""
    size = run["size"]
    start = "flat" if size.get("flat") else "transport"
    level, width = (AUTO, FINEST_AUTO - 1) if size["automatic"] else (0, 0)
    free = SimpleNamespace(max_level=level, finest=width, spans=(run["asked"] >> width,), degree=0)
    free = {name: free for name in range(size["surfaces"])}
    return SimpleNamespace(
        target=SimpleNamespace(settings=SimpleNamespace(pixels=(1, size["pixels"]))),
        problem=SimpleNamespace(
            optic=SimpleNamespace(free=free, automatic=False),
            optimizer=SimpleNamespace(iterations=[60], start=start),
        ),
        freeforms=tuple(free.values()),
        source=SimpleNamespace(extended=size["extended"]),
        by_edges=size["by_edges"],
        blurred=size["blurred"],
    )


def replayed(run, seconds, show=lambda moment: None):
    """Tell a DesignProgress what happened in a run of so many seconds; between events the bar looks too.

    Return every ProgressEvent with its time.
    """
    clock, plan, seen = SimpleNamespace(now=0.0), plan_of(run), []

    def told(moment):
        seen.append((clock.now, moment))
        show(moment)

    with DesignProgress(told, lambda: clock.now) as progress:
        progress.asked(system_of(run))
        for fraction, event, *values in run["events"]:
            while clock.now + 0.01 * seconds < fraction * seconds:
                clock.now += 0.01 * seconds
                progress._progress.report()
            clock.now = fraction * seconds
            if event == "planned":
                progress.planned(Size(**run["size"]), plan)
            elif event == "over":
                progress.over(values[0])
            else:
                stage, dof, evaluation, fit = values
                row = SimpleNamespace(evaluation=evaluation, fit=fit) if evaluation else None
                progress(plan, plan[stage], dof, row)
    return seen


@pytest.mark.parametrize("name", [name for name in RUNS if name != LATE])
def test_after_a_third_of_a_recorded_run_the_time_left_is_known_within_a_fifth(name):
    for seconds in (5.0, 30.0, 300.0):
        seen = replayed(RUNS[name], seconds)
        time, moment = next((t, m) for t, m in seen if t >= seconds / 3)
        assert moment.left == pytest.approx(seconds - time, rel=0.2)
        # and from then on within a fifth of the run
        assert max(abs(m.left - (seconds - t)) for t, m in seen if t > time) < 0.2 * seconds


@pytest.mark.parametrize("seconds", [5.0, 30.0, 300.0])
def test_a_run_that_is_planned_after_a_third_is_known_within_a_quarter_from_then_on(seconds):
    """Its level is the least; before, more than twice the time is expected, for the usual one."""
    run = RUNS[LATE]
    seen = replayed(run, seconds)
    assert next(share for share, event, *_ in run["events"] if event == "planned") > 1 / 3
    time, moment = next((t, m) for t, m in seen if m.phase != "setup")
    assert moment.left == pytest.approx(seconds - time, rel=0.25)
    assert max(abs(m.left - (seconds - t)) for t, m in seen if t > time) < 0.2 * seconds
    assert max(m.left / (seconds - t) for t, m in seen if seconds / 3 < t < time) < 2.5


@pytest.mark.parametrize("name", RUNS)
def test_the_time_left_is_never_ten_times_off_not_even_at_the_start(name):
    """On machines twice as fast and half as slow again, and the first hundredth of a run aside."""
    for times in (0.5, 1.0, 1.5):
        seconds = times * RUNS[name]["seconds"]
        for time, moment in replayed(RUNS[name], seconds):
            if 0.01 * seconds < time < 0.9 * seconds:
                assert 0.1 < moment.left / (seconds - time) < 10, (times, time, moment)


@pytest.mark.parametrize("name", RUNS)
def test_packages_that_load_slowly_do_not_count_as_a_slow_machine(name):
    """Five seconds more before anything is computed, as from a cold disk."""
    run, late = RUNS[name], 5.0
    seconds = run["seconds"] + late
    events = [[(late + share * run["seconds"]) / seconds, *event] for share, *event in run["events"]]
    seen = replayed(run | {"events": events}, seconds)
    planned = next((time, moment) for time, moment in seen if moment.phase == "start surface")
    assert planned[1].left < 8 * (seconds - planned[0])


@pytest.mark.parametrize("name", RUNS)
def test_the_fraction_of_a_run_rises_to_1_and_every_phase_is_named(name):
    seen = replayed(RUNS[name], 10.0)
    fractions = [moment.fraction for _, moment in seen]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1
    names = list(dict.fromkeys(moment.phase for _, moment in seen))
    assert names[:2] == ["setup", "start surface"]
    assert names[-4:] == ["export", "measure", "verify", "figures"]
    assert all(re.fullmatch(r"(mesh of )?(sharp )?level \d|finish( again)?", name) for name in names[2:-4])
    assert len(names) == 6 + len(RUNS[name]["plan"])


def test_more_evaluations_than_iterations_do_not_overfill_a_stage_and_fewer_are_no_step_back():
    run = RUNS["pearl"]
    plan, clock, seen = plan_of(run), SimpleNamespace(now=0.0), []
    with DesignProgress(seen.append, lambda: clock.now) as progress:
        progress.planned(Size(**run["size"]), plan)
        progress.over("setup")
        progress(plan, plan[0], 100, None)
        progress(plan, plan[-1], 100, None)
        for evaluation in range(1, 200):
            clock.now += 0.1
            progress(plan, plan[-1], 100, SimpleNamespace(evaluation=evaluation, fit=0.1))
        progress.over("optimise")
    fractions = [moment.fraction for moment in seen]
    assert fractions == sorted(fractions)
    assert max(m.fraction for m in seen if m.phase == "level 5") < 1


def test_plain_lines_name_every_phase_with_its_time_the_part_done_and_the_time_left():
    stream = io.StringIO()
    replayed(RUNS["pearl"], 60.0, Lines(stream))
    text = stream.getvalue().splitlines()
    assert "\r" not in stream.getvalue()
    over = [line for line in text if re.search(r", \d+\.\d s \(", line)]
    names = [re.match("[a-z]+( of)?( level)?( \\d)?", line)[0] for line in over]
    assert names == [
        "setup",
        "start",
        "mesh of level 3",
        "mesh of level 4",
        "level 5",
        "export",
        "measure",
        "verify",
        "figures",
    ]
    for line in text[:-1]:
        assert re.search(r"\(\d+% done, about [\d.]+ (s|min) left\)$", line), line
    assert text[-1].endswith("(100% done)")
    assert len(text) > len(over)  # a long stage says more than once where it is
    assert re.search(r"level 5: 46051 DOF, 33 evaluations, misfit 0\.0\d+, \d+\.\d s", stream.getvalue())


class Drawn:
    """What a bar was told; in place of tqdm."""

    def __init__(self, **options):
        self.options, self.n, self.words, self.lines = options, 0.0, [], []
        self.closed = False

    def set_description_str(self, words, refresh):
        self.words.append(words)

    def update(self, step):
        assert step >= 0
        self.n += step

    def refresh(self):
        pass

    def write(self, line, file):
        self.lines.append(line)

    def close(self):
        self.closed = True


def test_a_bar_shows_the_phase_and_the_time_left_and_ends_full():
    made = []
    bar = Bar(io.StringIO(), lambda **options: made.append(Drawn(**options)) or made[0])
    assert not made  # nothing is drawn before there is something to say
    replayed(RUNS["tophat_square"], 20.0, bar)
    bar.close()
    (drawn,) = made
    assert drawn.n == pytest.approx(1.0)
    assert drawn.closed
    assert drawn.words[-1] == "done"
    assert any(re.fullmatch(r"about \d+ s left, verify", words) for words in drawn.words)
    assert [line.split(":")[0] for line in drawn.lines] == ["level 2"]


def test_a_bar_is_drawn_again_while_a_phase_says_nothing():
    told = Event()
    bar = Bar(io.StringIO(), Drawn)
    bar.keep_alive(told.set)
    assert told.wait(30)
    bar.close()


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.0, "1 s"), (9.4, "9 s"), (9.6, "10 s"), (33.0, "35 s"), (100.0, "2 min"), (7200.0, "2.0 h")],
)
def test_times_are_said_with_as_many_digits_as_are_known(seconds, words):
    assert time_words(seconds) == words


def test_clients_of_notebook_kernels_are_no_notebooks():
    """They import ipykernel; a bar that widgets draw would be written to their stdout."""
    pytest.importorskip("ipykernel.kernelapp")
    assert isinstance(drawing(io.StringIO()), Lines)
