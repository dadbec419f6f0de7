"""Python as our packages would find it on Windows, as far as Linux can show that."""

import os
import signal

from tests.cases import ROOT

MODULES = {"crypt", "fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"}
OF_WINDOWS = {"SIGABRT", "SIGFPE", "SIGILL", "SIGINT", "SIGSEGV", "SIGTERM", "SIG_DFL", "SIG_IGN"}
HIDDEN = {
    "signal": {name for name in dir(signal) if name.startswith("SIG")} - OF_WINDOWS
    | {"alarm", "getitimer", "pause", "pthread_kill", "pthread_sigmask", "setitimer", "siginterrupt"}
    | {"sigpending", "sigtimedwait", "sigwait", "sigwaitinfo"},
    "os": {
        *(
            "O_ASYNC",
            "O_DIRECTORY",
            "O_NOFOLLOW",
            "O_NONBLOCK",
            "chown",
            "ctermid",
            "fchmod",
            "fchown",
            "fork",
        ),
        *("forkpty", "getegid", "geteuid", "getgid", "getloadavg", "getpgid", "getpgrp", "getpriority"),
        *("getsid", "getuid", "killpg", "lchown", "mkfifo", "mknod", "nice", "openpty", "posix_fadvise"),
        *("posix_spawn", "pread", "pwrite", "sched_getaffinity", "sched_setaffinity", "setpgid", "setsid"),
        *("statvfs", "sync", "sysconf", "uname", "wait", "wait3", "wait4"),
    },
}
HOOK = f"""
import builtins, multiprocessing, os, signal, types

HIDDEN = {HIDDEN}

class Screen(types.ModuleType):
    '''A module without some of its names.'''

    def __init__(self, module):
        super().__init__(module.__name__)
        self.module = module

    def __getattr__(self, name):
        if name in HIDDEN[self.__name__]:
            raise AttributeError("there is no " + name)
        return getattr(self.module, name)

SCREENS = {{module.__name__: Screen(module) for module in (os, signal)}}
real_import = builtins.__import__

def screened(name, globals=None, locals=None, fromlist=(), level=0):
    '''Import as ever, except for `thbcad` and `optics`.'''
    found = real_import(name, globals, locals, fromlist, level)
    if ((globals or {{}}).get("__package__") or "").partition(".")[0] not in ("thbcad", "optics"):
        return found
    if name in {MODULES}:
        raise ModuleNotFoundError("there is no " + name, name=name)
    return SCREENS.get(found.__name__, found)

builtins.__import__ = screened
multiprocessing.set_start_method("spawn")
del os.fork
"""


def without_posix(folder):
    """Return the environment of Pythons in which the packages find no POSIX; folder : an empty one."""
    (folder / "sitecustomize.py").write_text(HOOK, "utf-8")
    return os.environ | {"PYTHONPATH": os.pathsep.join(map(str, (folder, ROOT)))}
