"""Operations of our own in Dr.Jit."""

import pytest


@pytest.mark.parametrize(
    ("raised", "met"), [(KeyboardInterrupt, KeyboardInterrupt), (ValueError, RuntimeError)]
)
def test_an_interrupt_within_an_operation_is_one_outside(backend, raised, met):
    """Dr.Jit makes a RuntimeError of all that an operation raises, which nobody takes for Ctrl-C."""

    class Operation(backend.dr.CustomOp):
        def eval(self, x):
            raise raised

    with pytest.raises(met):
        backend.custom(Operation, backend.Float(1.0))


@pytest.mark.parametrize(("most", "taken"), [(5, 2), (2, 2), (1, 1), (0, 1), (-3, 1)])
def test_work_on_fewer_threads_has_its_own_again_behind_it(backend, most, taken):
    seen = []

    def interrupted():
        with backend.on_threads(most):
            seen.append(backend.dr.thread_count())
            raise KeyboardInterrupt

    backend.dr.set_thread_count(2)
    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [*seen, backend.dr.thread_count()] == [taken, 2]
    backend.dr.set_thread_count(1)  # as the other tests have it
