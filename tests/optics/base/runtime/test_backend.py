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
