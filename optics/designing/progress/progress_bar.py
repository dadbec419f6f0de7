"""The drawing of progress: a bar on terminals and in notebooks, plain lines everywhere else."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cached_property
from importlib.util import find_spec
from threading import Event, Thread
from typing import Any, TextIO

from optics.base.runtime import ProgressEvent

REDRAWN = 0.5  # seconds, between two drawings of the bar in a phase that says nothing
DRAWN = 0.1  # seconds, at least, between two drawings in a phase that says much
SAID = 0.1  # of the whole: between two plain lines of a phase that goes on
FORM = "{percentage:3.0f}% |{bar:20}| {elapsed}, {desc}"
WIDGETS = "{percentage:3.0f}% |{bar}| {elapsed}, {desc}"  # where the bar is drawn by the browser


def time_words(seconds: float) -> str:
    """Return a time as text, with two digits at most."""
    if seconds < 9.5:
        return f"{max(1.0, seconds):.0f} s"
    if seconds < 95:
        return f"{5 * round(seconds / 5)} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 95 else f"{minutes / 60:.1f} h"


class Lines:
    """A line for every phase that is over, and for every tenth of the whole inside a phase.

    The first line waits for the second, so that a problem that is refused at once gets one sentence only.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._last: ProgressEvent | None = None
        self._said = 0.0
        self._first = True
        self._waiting: list[str] = []

    def __call__(self, event: ProgressEvent) -> None:
        last, self._last = self._last, event
        if last and (event.phase != last.phase or event.fraction == 1.0):
            over = event if event.phase == last.phase else last
            self._write(over, f", {over.seconds:.1f} s", event)
        elif event.detail and event.fraction >= self._said + SAID:
            self._write(event, "", event)

    def keep_alive(self, report: Callable[[], None]) -> None:
        """Do nothing: a phase that says nothing has no lines."""

    def close(self) -> None:
        """Do nothing: the lines are written."""

    def _write(self, of: ProgressEvent, seconds: str, now: ProgressEvent) -> None:
        self._said = now.fraction
        detail = f": {of.detail}" if of.detail else ""
        left = f", about {time_words(now.left)} left" if now.fraction < 1 else ""
        line = f"{of.phase}{detail}{seconds} ({now.fraction:.0%} done{left})"
        if self._first:
            self._first = False
            self._waiting.append(line)
            return
        print(*self._waiting, line, sep="\n", file=self._stream, flush=True)
        self._waiting.clear()


class Bar:
    """A bar with the time left and the phase, and a line for every phase with details that is over.

    make : makes the bar, as tqdm does; called with the first ProgressEvent.  form : of the bar, as of tqdm.
    """

    def __init__(self, stream: TextIO, make: Callable[..., Any], form: str = FORM) -> None:
        self._make, self._stream, self._form = make, stream, form
        self._last: ProgressEvent | None = None
        self._ended = Event()
        self._thread: Thread | None = None

    @cached_property
    def _bar(self) -> Any:
        return self._make(total=1.0, bar_format=self._form, file=self._stream, mininterval=DRAWN, miniters=0)

    def __call__(self, event: ProgressEvent) -> None:
        last, self._last = self._last, event
        begins = last is None or event.phase != last.phase
        if last and last.detail and begins:
            self._bar.write(f"{last.phase}: {last.detail}, {last.seconds:.1f} s", file=self._stream)
        detail = f": {event.detail}" if event.detail else ""
        words = f"about {time_words(event.left)} left, {event.phase}{detail}"
        self._bar.set_description_str(words if event.fraction < 1 else "done", refresh=False)
        self._bar.update(event.fraction - self._bar.n)
        if begins or event.fraction == 1:
            self._bar.refresh()

    def keep_alive(self, report: Callable[[], None]) -> None:
        """Draw the bar again and again, in a thread, also while a phase says nothing."""

        def redraw() -> None:
            while not self._ended.wait(REDRAWN):
                report()

        self._thread = Thread(target=redraw, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Leave the bar as it is."""
        self._ended.set()
        if self._thread:
            self._thread.join()
        if self._last:
            self._bar.close()


def drawing(stream: TextIO) -> Bar | Lines:
    """Return what draws progress on a stream: a bar in a notebook and on a terminal, or else plain lines."""
    # whether this process is a notebook's kernel; clients of kernels import ipykernel too
    module = sys.modules.get("ipykernel.kernelapp")
    notebook = module is not None and module.IPKernelApp.initialized()
    if notebook and find_spec("ipywidgets"):
        from tqdm.notebook import tqdm as notebook_tqdm

        return Bar(stream, notebook_tqdm, WIDGETS)
    if notebook or stream.isatty():
        from tqdm import tqdm

        return Bar(stream, tqdm)
    return Lines(stream)
