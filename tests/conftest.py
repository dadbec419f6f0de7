"""One thread for numpy's BLAS, and one hypothesis profile for all tests.

The tests run side by side, and so do the programs that they start.  Hypothesis tries the same examples on
every run, and without a time limit: the machine may be busy.
"""

import os

from hypothesis import settings

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
settings.register_profile("thbcad", deadline=None, derandomize=True, max_examples=60)
settings.load_profile("thbcad")
