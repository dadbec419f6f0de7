"""One thread for numpy's BLAS, in tests and in programs that they start: the tests run side by side."""

import os

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
