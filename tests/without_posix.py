"""Python as our packages would find it on Windows, as far as Linux can show that."""

import os

from tests.cases import ROOT

HOOK = '''
import builtins, multiprocessing, os, signal, types

MODULES = {"crypt", "fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"}
SIGNALS = {"SIGABRT", "SIGFPE", "SIGILL", "SIGINT", "SIGSEGV", "SIGTERM", "SIG_DFL", "SIG_IGN"}
POSIX_SIGNAL = {name for name in dir(signal) if name.startswith("SIG")} - SIGNALS | {
    "alarm", "getitimer", "pause", "pthread_kill", "pthread_sigmask", "setitimer", "siginterrupt",
    "sigpending", "sigtimedwait", "sigwait", "sigwaitinfo",
}
POSIX_OS = {
    "O_ASYNC", "O_DIRECTORY", "O_NOFOLLOW", "O_NONBLOCK", "chown", "ctermid", "fchmod", "fchown", "fork",
    "forkpty", "getegid", "geteuid", "getgid", "getloadavg", "getpgid", "getpgrp", "getpriority", "getsid",
    "getuid", "killpg", "lchown", "mkfifo", "mknod", "nice", "openpty", "posix_fadvise", "posix_fallocate",
    "posix_spawn", "pread", "pwrite", "sched_getaffinity", "sched_setaffinity", "setpgid", "setsid",
    "statvfs", "sync", "sysconf", "uname", "wait", "wait3", "wait4",
}

class Screen(types.ModuleType):
    """A module without some of its names."""

    def __init__(self, module, hidden):
        super().__init__(module.__name__)
        self._module, self._hidden = module, hidden

    def __getattr__(self, name):
        if name in self._hidden:
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
        return getattr(self._module, name)

SCREENS = {"os": Screen(os, POSIX_OS), "signal": Screen(signal, POSIX_SIGNAL)}
real_import = builtins.__import__

def screened(name, globals=None, *more):
    """Import as ever, except for `thbcad` and `optics`."""
    ours = ((globals or {}).get("__package__") or "").partition(".")[0] in ("thbcad", "optics")
    if ours and name in MODULES:
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    found = real_import(name, globals, *more)
    return SCREENS.get(found.__name__, found) if ours else found

builtins.__import__ = screened
multiprocessing.set_start_method("spawn")
del os.fork
'''


def without_posix(folder):
    """Return the environment of Pythons in which the packages find no POSIX; folder : an empty one."""
    (folder / "sitecustomize.py").write_text(HOOK, "utf-8")
    return os.environ | {"PYTHONPATH": os.pathsep.join(map(str, (folder, ROOT)))}
