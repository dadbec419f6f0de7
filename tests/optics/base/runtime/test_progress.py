"""Progress of a job, by a clock that the test moves: time left, and a fraction that never falls."""

import pytest
from hypothesis import given, strategies as st

from optics.base.runtime import Phase, Progress

PHASES = [Phase("read", 1.0), Phase("work", 6.0), Phase("write", 3.0)]


class Job:
    """A Progress with its own clock and all that it shows."""

    def __init__(self, phases=PHASES):
        self.now, self.moments = 100.0, []
        self.progress = Progress(phases, self.moments.append, lambda: self.now)

    def wait(self, seconds):
        self.now += seconds
        return self.progress

    def left(self):
        self.progress.report()
        return self.moments[-1].left


@pytest.mark.parametrize("speed", [0.1, 1.0, 10.0])
def test_a_machine_of_any_speed_is_timed_by_its_own(speed):
    """At half of the second phase 4 of 10 parts are done and 6 left, up to the first guess of the speed."""
    job = Job()
    job.wait(1 * speed).begin("work")
    job.wait(3 * speed).advance(0.5)
    assert job.moments[-1].left == pytest.approx(6 * speed, rel=0.1)
    assert job.moments[-1].fraction == pytest.approx(0.4, abs=0.03)
    assert (job.moments[-1].phase, job.moments[-1].seconds) == ("work", pytest.approx(3 * speed))


def test_a_phase_that_is_slower_than_expected_is_timed_by_its_own_speed():
    job = Job()
    job.wait(1).begin("work")
    job.wait(15).advance(0.5)  # 5 times slower
    # 15 s of the same, and 3 s at the speed of all so far: 16 s instead of 4
    assert job.moments[-1].left == pytest.approx(15 + 12, rel=0.1)


@pytest.mark.parametrize("speed", [0.1, 1.0, 10.0])
def test_phases_on_one_core_are_timed_by_each_other_and_by_all(speed):
    """Reading tells 1, work four times that; together 25 s of 7: writing, 3 s, takes sqrt(25 / 7) each."""
    one, many = (
        [Phase("read", 1.0, 1.0, alone), PHASES[1], Phase("write", 3.0, 1.0, alone)] for alone in (1, 0)
    )
    left = []
    for job in (Job(one), Job(many)):
        job.wait(1 * speed).begin("work")
        job.wait(24 * speed).begin("write")
        left.append(job.moments[-1].left)
    assert left[1] == pytest.approx(3 * 25 / 7 * speed, rel=0.05)
    assert left[0] == pytest.approx(3 * (25 / 7) ** 0.5 * speed, rel=0.1)


def test_time_passes_in_a_phase_that_says_nothing():
    job = Job()
    job.wait(1).begin("work")
    first = job.left()
    job.wait(2)
    assert job.left() == pytest.approx(first - 2)
    job.wait(20)  # longer than expected: what is left does not become negative
    assert job.left() > 3


def test_a_plan_may_change_and_phases_may_be_left_out():
    job = Job()
    job.progress.expect([Phase("read", 1.0), Phase("more", 5.0), Phase("write", 3.0), Phase("rest", 1.0)])
    job.wait(1).begin("write")
    job.wait(3).begin("rest")
    assert job.moments[-1].left == pytest.approx(1, rel=0.05)
    with pytest.raises(ValueError, match="more"):
        job.progress.begin("more")


STEPS = st.lists(
    st.tuples(st.floats(0, 50), st.sampled_from(["advance", "report", "begin"]), st.floats(0, 1.5))
)


@given(STEPS)
def test_the_fraction_never_falls_never_exceeds_1_and_ends_at_1(steps):
    job = Job()
    coming = ["work", "write"]
    for seconds, action, part in steps:
        progress = job.wait(seconds)
        if action == "begin" and coming:
            progress.begin(coming.pop(0))
        elif action == "advance":
            progress.advance(part)
        else:
            progress.report()
    job.progress.finish()
    fractions = [moment.fraction for moment in job.moments]
    assert fractions == sorted(fractions)
    assert fractions[0] >= 0
    assert fractions[-1] == 1
    assert all(moment.left >= 0 for moment in job.moments)
