"""The pages of a design that runs, has stopped, or is done, as HTML that holds everything in itself."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from itertools import cycle

import numpy as np

from optics.base.runtime import ProgressEvent
from optics.designing.optimisation import Row
from optics.designing.progress import time_words
from optics.reporting.report import figures_html, page_head
from thbcad.pictures import line_path, svg

REPORT = "report.html"
RELOADED = 2  # seconds
WIDTH, HEIGHT, COLOURS = 600.0, 260.0, ("#1b6ca8", "#c05a00")  # of the loss curve
LEAST = 1e-12  # misfit that is shown
GRID = "display:grid;grid-template-columns:repeat(auto-fit,minmax(18rem,1fr));gap:1.5rem"
NOT_FRESH = "These numbers are of light that the optimiser fits; the verdict at the end is of fresh light."


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
