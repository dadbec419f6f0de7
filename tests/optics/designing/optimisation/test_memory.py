"""No kernel reads past the end of an array."""

import pytest

from tests.cases import python


@pytest.mark.slow
def test_kernels_read_no_further_than_their_arrays():
    """Dr.Jit maps numpy's memory and reads whole packets of it: arrays must be copied or padded before they
    are handed over."""
    result = python("from tests.optics.designing.optimisation.guarded import main; main()")
    assert result.returncode == 0, (
        f"ended by signal {-result.returncode}" if result.returncode < 0 else result.stderr
    )
    assert int(result.stdout.split()[1]) > 10  # arrays did come from the guarded allocator
