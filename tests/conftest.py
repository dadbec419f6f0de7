"""One thread for numpy's BLAS, two hypothesis profiles, and a rare search for garbage.

The tests run side by side, and so do the programs that they start.  Hypothesis tries the same examples on
every run, and without a time limit: the machine may be busy.  `make slow` tries more of them.
"""

import gc
import os

from hypothesis import settings

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
for profile, examples in (("quick", 8), ("thorough", 60)):
    settings.register_profile(profile, deadline=None, derandomize=True, max_examples=examples)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "quick"))

gc.set_threshold(100_000, 20, 50)


def pytest_collection_finish():
    """What is loaded now stays: Python need not look through it again."""
    gc.collect()
    gc.freeze()
