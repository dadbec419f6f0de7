"""File operations of a run, counted, and stopped at any one of them."""

import errno
import os
import signal
from contextlib import contextmanager

OPERATIONS = ("mkdir", "open", "write", "fsync", "ftruncate", "chmod", "replace", "unlink", "rmdir")
ALLOCATING = ("mkdir", "open", "write", "fsync")  # what a full disk refuses
MODIFYING = os.O_CREAT | os.O_WRONLY | os.O_RDWR


class Killed(BaseException):
    """Stands for SIGKILL: from here on the process does nothing more to the disk."""


class FaultyDisk:
    """Counts the operations that change files; at number `at` the fault happens.

    fault : "SIGINT", "SIGTERM", "SIGKILL", "ENOSPC", or None to count only.
    """

    def __init__(self, fault=None, at=None):
        self.fault, self.at, self.count = fault, at, 0

    @contextmanager
    def installed(self):
        genuine = {name: getattr(os, name) for name in OPERATIONS}
        for name, function in genuine.items():
            setattr(os, name, self._guarded(name, function))
        try:
            yield self
        finally:
            for name, function in genuine.items():
                setattr(os, name, function)

    def _guarded(self, name, function):
        def operation(*arguments, **options):
            if name == "open" and not arguments[1] & MODIFYING:
                return function(*arguments, **options)
            self.count += 1
            self._happen(name)
            return function(*arguments, **options)

        return operation

    def _happen(self, name):
        if self.at is None or self.count < self.at:
            return
        if self.fault == "SIGKILL":
            raise Killed
        if self.fault == "ENOSPC" and name in ALLOCATING:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        if self.fault in ("SIGINT", "SIGTERM") and self.count == self.at:
            os.kill(os.getpid(), getattr(signal, self.fault))
