"""The machine on which a result was measured, without its owner, and what a process does with its memory."""

from __future__ import annotations

import ctypes
import gc
import os
import platform

RARELY = (100_000, 20, 100)  # new objects until a search, and searches of one generation per one of the next


def machine_facts() -> dict[str, str | int]:
    """Return processor, cores (that this process may use), memory in GiB, system and Python."""
    return {
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30),
        "system": _system(),
        "python": platform.python_version(),
    }


def machine() -> str:
    """Return one line that names the machine."""
    facts = machine_facts()
    return f"{facts['processor']}, {facts['cores']} cores, Python {facts['python']}"


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            return next(line.split(":", 1)[1].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def _system() -> str:
    try:
        return platform.freedesktop_os_release()["PRETTY_NAME"]
    except (OSError, KeyError):
        return platform.system()


def collect_rarely() -> None:
    """Make a process of one command search rarely.

    Commands make few circles, and Python searches all loaded packages for them: 0.3 s of a design.
    """
    gc.set_threshold(*RARELY)


def give_back_memory() -> None:
    """Give memory that this process no longer uses back to the system.

    The C library keeps what is free below what is used; glibc can be asked for it.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def collect_and_give_back() -> None:
    """Look for circles among the objects of the last work, such as figures, and give memory back."""
    gc.collect(1)
    give_back_memory()
