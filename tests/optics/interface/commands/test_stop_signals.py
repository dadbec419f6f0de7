"""Ctrl-C and SIGTERM: the same end, another exit code, and nothing stays behind."""

import os
import signal
import sys
import threading
import time

import pytest

from optics.interface.commands.stop_signals import stop_signals


@pytest.mark.parametrize(
    ("number", "code", "word"), [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")]
)
def test_a_signal_stops_with_its_code_and_word(number, code, word):
    signal.signal(signal.SIGINT, signal.default_int_handler)  # the tests may run in the background
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with pytest.raises(KeyboardInterrupt), stop_signals() as stop:
        os.kill(os.getpid(), number)
    assert (stop.requested, stop.code, stop.word) == (True, code, word)
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_python_drops_comes_again(number, capfd):
    """In `__del__`, where nothing can be raised."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    hook = sys.unraisablehook
    with pytest.raises(KeyboardInterrupt), stop_signals() as stop:
        work_on(number)
    assert (stop.requested, stop.number) == (True, number)
    assert sys.unraisablehook is hook
    assert capfd.readouterr() == ("", "")


def lose(number):
    class Last:
        def __del__(self):
            os.kill(os.getpid(), number)
            for _ in range(100):  # Python looks for signals at the end of a loop's body
                self.deleted = True

    Last()


def work_on(number):
    lose(number)
    time.sleep(10)


def test_a_signal_does_not_come_again_where_the_work_has_ended():
    """As `work_on` without its wait: afterwards the signal would meet another handler."""
    came = []
    before = signal.signal(signal.SIGINT, lambda number, frame: came.append(number))
    try:
        with stop_signals() as stop:
            lose(signal.SIGINT)
        time.sleep(0.1)
    finally:
        signal.signal(signal.SIGINT, before)
    assert (stop.requested, came) == (True, [])


def test_what_else_python_drops_is_told_as_ever(monkeypatch):
    told = []
    monkeypatch.setattr(sys, "unraisablehook", lambda lost: told.append(lost.exc_type))

    class Last:
        def __del__(self):
            raise ZeroDivisionError

    with stop_signals() as stop:
        Last()
    assert (told, stop.requested) == ([ZeroDivisionError], False)


def test_a_command_in_the_background_does_not_listen_to_ctrl_c():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with stop_signals() as stop:
            os.kill(os.getpid(), signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)
    assert not stop.requested


def test_beside_the_main_thread_no_handler_is_set():
    seen = []

    def other():
        with stop_signals():
            seen.append(signal.getsignal(signal.SIGTERM))

    before = signal.getsignal(signal.SIGTERM)
    thread = threading.Thread(target=other)
    thread.start()
    thread.join()
    assert seen == [before]
