"""What the machine is on which a result was measured; nothing that names its owner."""

from __future__ import annotations

import os
import platform


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
