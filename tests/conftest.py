"""One thread for all that computes, two hypothesis profiles, a rare search for garbage, and narrow kernels.
Test files whose library is missing are left out.

The tests run side by side, and so do the programs that they start.  Hypothesis tries the same examples on
every run, and without a time limit: the machine may be busy.  `make slow` tries more of them.
"""

import ctypes
import gc
import os
from collections import Counter, defaultdict
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import settings

from optics.base.runtime import load_backend, load_llvm
from tests.cases import ROOT
from tests.missing_libraries import left_out, sentences

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
for profile, examples in (("quick", 8), ("thorough", 60)):
    settings.register_profile(profile, deadline=None, derandomize=True, max_examples=examples)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "quick"))

gc.set_threshold(100_000, 20, 50)


def narrow_kernels():
    """Compile kernels for 8 numbers at a time, as everywhere but on processors with AVX-512.

    There Dr.Jit takes 16, which are compiled in twice the time, half of that of the tests of light.  The
    numbers are the same, bit for bit.
    """
    core = Path(find_spec("drjit").origin).with_name("libdrjit-core.so")
    if not core.exists():  # not Linux
        return
    load_backend("double", 1)
    dr = ctypes.CDLL(str(core))
    # the names that C++ gives to functions of drjit-core/jit.h; in another Dr.Jit they may be others
    names = ("_Z21jit_llvm_vector_widthv", "_Z19jit_llvm_target_cpuv", "_Z24jit_llvm_target_featuresv")
    if not all(hasattr(dr, name) for name in (*names, "_Z19jit_llvm_set_targetPKcS0_j")):
        return
    width, cpu, features = (dr[name] for name in names)
    cpu.restype = features.restype = ctypes.c_char_p
    if width() > 8:
        dr["_Z19jit_llvm_set_targetPKcS0_j"](cpu(), features(), 8)


def pytest_configure():
    """Dr.Jit takes an LLVM when it is imported, as tests that need Mitsuba do while they are collected.

    Files are not forced to the disk: no test loses power, and each would wait some milliseconds.
    """
    load_llvm()
    os.fsync = lambda _: None


def pytest_ignore_collect(collection_path):
    """Leave out test files that need build123d or cadquery where that is missing, unless named one by one."""
    return left_out(collection_path) or None


def pytest_terminal_summary(terminalreporter, config):
    """Report how many files were left out; with -q, pytest shows no header where this could be."""
    for sentence in sentences(config.invocation_params.dir / arg for arg in config.args):
        terminalreporter.write_line(sentence)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Of a product of parameters every second case is slow: `make test` has every value of each.

    Of what is marked `every(n)` all but each n-th case are.
    """
    decided = {item.function for item in items if item.get_closest_marker("slow")}
    places = defaultdict(dict)
    quick = Counter()
    for item in items:
        axes = [mark.args[0] for mark in item.iter_markers("parametrize")]
        if len(axes) > 1 and item.function not in decided:
            place = 0
            for axis in axes:
                names = (axis,) if isinstance(axis, str) else tuple(axis)
                seen = places[item.function, names]
                place += seen.setdefault(tuple(id(item.callspec.params[name]) for name in names), len(seen))
            if place % 2:
                item.add_marker("slow")
        every = item.get_closest_marker("every")
        if every and not item.get_closest_marker("slow"):
            if quick[item.function] % every.args[0]:
                item.add_marker("slow")
            quick[item.function] += 1


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Every second worker takes files from the end: neighbours load the same packages, most in one worker."""
    from xdist.scheduler import LoadFileScheduling  # without workers there is none

    class FromBothEnds(LoadFileScheduling):
        def _assign_work_unit(self, node):
            if self.nodes.index(node) % 2:
                self.workqueue.move_to_end(next(reversed(self.workqueue)), last=False)
            super()._assign_work_unit(node)

    return FromBothEnds(config, log)


def pytest_collection_finish(session):
    """All cores of a worker are one; what is loaded now stays: Python need not look through it again."""
    os.sched_getaffinity = lambda _: {0}
    if any(not item.path.is_relative_to(ROOT / "tests" / "thbcad") for item in session.items):
        narrow_kernels()
    gc.collect()
    gc.freeze()
