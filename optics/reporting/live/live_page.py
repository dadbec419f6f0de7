"""The pages of a design that runs, has stopped, or is done, as HTML that holds everything in itself, written
from time to time."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from html import escape
from itertools import cycle
from math import isfinite
from threading import Lock
from time import perf_counter, strftime
from typing import Any

import numpy as np

from optics.base.runtime import ProgressEvent
from optics.designing.optimisation import Listener, Row, Stage, stage_objective
from optics.designing.progress import time_words
from optics.light.analysis import picture_limit, uniformity_of_pixels
from optics.light.blur import spot_rms
from optics.light.engines import Engine
from optics.light.measuring import symmetry_axes
from optics.reporting.report import figures_html, light_pictures, page_head
from optics.scene.receivers import merged
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.pictures import line_path, svg

REPORT = "report.html"
RELOADED = 2  # seconds
WIDTH, HEIGHT, COLOURS = 600.0, 260.0, ("#1b6ca8", "#c05a00")  # of the loss curve
LEAST = 1e-12  # misfit that is shown
GRID = "display:grid;grid-template-columns:repeat(auto-fit,minmax(18rem,1fr));gap:1.5rem"
NOT_FRESH = "These numbers are of light that the optimiser fits; the verdict at the end is of fresh light."
SECONDS = 2.0  # between two pages, at least, but at the end of a stage
NOTHING = ProgressEvent("setup", 0.0, "", 0.0, 0.0)


@dataclass(frozen=True)
class LiveState:
    """What is known of a run.

    so_far : sentences on its light.  pictures : (caption, PNG) of the light at the end of a stage.
    time : of the page, in words.  stopped : why the run goes on no more, "" where it does.
    done : there is a report.
    """

    title: str
    event: ProgressEvent
    rows: Sequence[Row] = ()
    so_far: Sequence[str] = ()
    pictures: Sequence[tuple[str, bytes]] = ()
    time: str = ""
    stopped: str = ""
    done: bool = False


def live_page(state: LiveState) -> str:
    """Return the page of a run: it loads itself again, has stopped, or leads to the report."""
    event, after = state.event, f"0;url={REPORT}" if state.done else f"{RELOADED}"
    again = "" if state.stopped else f'<meta http-equiv="refresh" content="{after}">'
    head = page_head(escape(state.title), again)
    if state.done:
        return f'{head}<p>Done: <a href="{REPORT}">the report</a>.</p></html>\n'
    doing = f"{event.phase}: {event.detail}" if event.detail else event.phase
    words = state.stopped or f"{doing}; {event.fraction:.0%} done, about {time_words(event.left)} left"
    said = state.so_far and (*state.so_far, NOT_FRESH)
    return (
        f'{head}<p class="banner {"bad" if state.stopped else "open"}">{escape(words)}</p>'
        f'<p><progress max="1" value="{event.fraction:.3f}" style="width:100%"></progress></p>'
        f"{''.join(f'<p>{escape(sentence)}</p>' for sentence in said)}"
        f'<div style="{GRID}">{figures_html(state.pictures)}{_loss_curve(state.rows)}</div>'
        f"<p>As of {escape(state.time)}; where that is long ago, the run was killed.</p></html>\n"
    )


def _loss_curve(rows: Sequence[Row]) -> str:
    """Return the misfit over the evaluations as a figure, a line for each stage; "" of fewer than two."""
    if len(rows) < 2:
        return ""
    evaluations = np.array([row.evaluation for row in rows], float)
    heights = np.log10([max(row.fit, LEAST) for row in rows])
    first, last, low, high = evaluations[0], evaluations[-1], heights.min(), heights.max()
    x = WIDTH * (evaluations - first) / max(last - first, 1.0)
    y = HEIGHT * (high - heights) / ((high - low) or 1.0)
    lines, stages = "", np.array([row.stage for row in rows])
    for colour, stage in zip(cycle(COLOURS), np.unique(stages)):
        points = np.stack([x, y], axis=1)[stages == stage]
        lines += f'<path d="{line_path(points)}" fill="none" stroke="{colour}" stroke-width="2"/>'
    caption = (
        f"Misfit ||E - T|| / ||T||, logarithmic, from {10**high:.3g} (top) to {10**low:.3g}, over "
        f"evaluations {first:.0f} to {last:.0f}; a new colour where a stage begins"
    )
    return f"<figure>{svg(lines, WIDTH, HEIGHT)}<figcaption>{caption}</figcaption></figure>"


class LiveView:
    """A run as a page, once it has begun; what it computes itself is an image at the end of every stage.

    Another thread may tell progress, too.  A page that cannot be written is left out.

    write : called with the page.  clock : seconds.
    """

    def __init__(self, write: Callable[[str], object], clock: Callable[[], float] = perf_counter) -> None:
        self._write, self._clock = write, clock
        self._state: LiveState | None = None
        self._rows: list[Row] = []
        self._event, self._written = NOTHING, -SECONDS
        self._lock = Lock()

    def begin(self, title: str, rows: Sequence[Row] = ()) -> None:
        """Write the first page.  rows : of the run that goes on."""
        self._rows = list(rows)
        self._state = LiveState(title, self._event)
        self._tell(at_once=True)

    def __call__(self, event: ProgressEvent) -> None:
        """Take how far the run is."""
        self._event = event
        self._tell()

    def watching(self, listener: Listener, engine: Engine) -> Listener:
        """Return the listener that this page hears too.  engine : that makes the light."""
        if self._state is None:
            return listener

        def progress(plan: Sequence[Stage], stage: Stage, dof: int, row: Row | None) -> None:
            self._rows += [row] if row else []
            listener.progress(plan, stage, dof, row)

        def seen(stage: Stage, system: System, target: Floats) -> None:
            listener.seen(stage, system, target)
            self._tell(at_once=True, **_light(stage, system, target, engine))

        return replace(listener, progress=progress, seen=seen)

    def stop(self, sentence: str) -> None:
        """Write the last page of a run that has no result."""
        self._tell(at_once=True, stopped=sentence)

    def done(self) -> None:
        """Write the page that leads to the report."""
        self._tell(at_once=True, done=True)

    def _tell(self, at_once: bool = False, **changes: Any) -> None:
        """Change what the page shows, and write it where it is time."""
        with self._lock:
            if self._state is None or self._state.stopped or self._state.done:
                return
            self._state = replace(self._state, **changes)
            if at_once or self._clock() - self._written >= SECONDS:
                self._written = self._clock()
                now = replace(self._state, event=self._event, rows=self._rows, time=strftime("%H:%M:%S"))
                with suppress(OSError):  # the design matters more
                    self._write(live_page(now))


def _light(stage: Stage, system: System, target: Floats, engine: Engine) -> dict[str, Any]:
    """Return what a page shows of a stage: the light as the optimiser measures it, on the stage's pixels."""
    objective = stage_objective(system, stage, target, engine, symmetry_axes(system))
    columns, rows = stage.pixels
    # in the far field intensities are compared
    seen = replace(stage.screen, pixels=(columns, rows))
    shown = seen.projection()
    wanted = merged(stage.screen.crop(objective.target), stage.parts) / shown
    image = objective.image([sag.coefficients for sag in system.sags]) / shown
    name = f"{'' if stage.iterations else 'before '}{stage.name}"
    pictures = [(f"{caption} ({name})", png) for caption, png in light_pictures(wanted, image)]
    misfit, asked = float(np.linalg.norm(image - wanted) / np.linalg.norm(wanted)), system.problem.verify
    region = system.target.uniform_region
    most = picture_limit(asked, region is not None)
    bound = f", and at most {most:g} is asked for" if isfinite(most) else ""
    so_far = [f"{name.capitalize()}: rel_l2 {misfit:.3g} so far{bound}."]
    if region is not None:
        blur = spot_rms(system, system.backend) if system.source.extended or system.blurred else 0.0
        least = uniformity_of_pixels(system, image, seen, blur).min_over_mean
        light = "I_min/I_mean" if stage.screen.angular else "E_min/E_mean"
        if least is not None:
            so_far.append(
                f"U0 = {light} {least:.3g} so far, and at least {asked.min_over_mean:g} is asked for."
            )
    return {"pictures": pictures, "so_far": so_far}
