"""The pages of a design that runs, has stopped, or is done, as HTML that holds everything in itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import groupby
from math import log10

import numpy as np

from optics.base.runtime import ProgressEvent
from optics.designing.optimisation import Row
from optics.designing.progress import time_words
from optics.reporting.report import figures_html, page_head
from thbcad.pictures import line_path, svg

REPORT = "report.html"
RELOADED = 2  # seconds
WIDTH, HEIGHT = 600.0, 260.0  # of the loss curve, in units of its picture
GRID = "display:grid;grid-template-columns:repeat(auto-fit,minmax(18rem,1fr));gap:1.5rem"
NOT_FRESH = "These numbers are of light that the optimiser fits; the verdict at the end is of fresh light."


@dataclass(frozen=True)
class LiveState:
    """What is known of a run.

    so_far : sentences on its light.  pictures : (caption, PNG) of the light at the end of a stage.
    time : of the page, in words.  stopped : why it goes on no more, "" where it does.
    """

    title: str
    event: ProgressEvent
    rows: Sequence[Row] = ()
    so_far: Sequence[str] = ()
    pictures: Sequence[tuple[str, bytes]] = field(default=(), repr=False)
    time: str = ""
    stopped: str = ""


def live_page(state: LiveState) -> str:
    """Return the page of a run; it loads itself again until the run has stopped."""
    event = state.event
    done = event.detail and f": {event.detail}"
    words = f"{event.phase}{done}; {event.fraction:.0%} done, about {time_words(event.left)} left"
    again = "" if state.stopped else f'<meta http-equiv="refresh" content="{RELOADED}">'
    said = state.so_far and (*state.so_far, NOT_FRESH)
    return (
        f"{page_head(escape(state.title), again)}"
        f'<p class="banner {"bad" if state.stopped else "open"}">{escape(state.stopped or words)}</p>'
        f'<p><progress max="1" value="{event.fraction:.3f}" style="width:100%"></progress></p>'
        f"{''.join(f'<p>{escape(sentence)}</p>' for sentence in said)}"
        f'<div style="{GRID}">{figures_html(state.pictures)}{_loss_curve(state.rows)}</div>'
        f"<p>As of {escape(state.time)}; where that is long ago, the run was killed.</p></html>\n"
    )


def done_page(title: str) -> str:
    """Return the page of a run that is done: it leads to the report, at once where a browser allows it."""
    forward = f'<meta http-equiv="refresh" content="0;url={REPORT}">'
    return f'{page_head(escape(title), forward)}<p>Done: <a href="{REPORT}">the report</a>.</p></html>\n'


def _loss_curve(rows: Sequence[Row]) -> str:
    """Return the misfit over the evaluations as a figure, a line for each stage; "" of fewer than two."""
    if len(rows) < 2:
        return ""
    first, last = rows[0].evaluation, rows[-1].evaluation
    heights = [log10(max(row.fit, 1e-12)) for row in rows]
    low, high = min(heights), max(heights)
    across, up = WIDTH / max(1, last - first), HEIGHT / ((high - low) or 1.0)
    points = np.array([(across * (r.evaluation - first), up * (high - h)) for r, h in zip(rows, heights)])
    stages = groupby(range(len(rows)), key=lambda k: rows[k].stage)
    lines = "".join(
        f'<path d="{line_path(points[[*numbers]])}" fill="none" stroke="{colour}" stroke-width="2"/>'
        for colour, (_, numbers) in zip(_two_colours(len(rows)), stages)
    )
    caption = (
        f"Misfit ||E - T|| / ||T||, logarithmic, from {10**high:.3g} (top) to {10**low:.3g}, over "
        f"evaluations {first} to {last}; a new colour where a stage begins"
    )
    return f"<figure>{svg(lines, WIDTH, HEIGHT)}<figcaption>{caption}</figcaption></figure>"


def _two_colours(count: int) -> list[str]:
    return [("#1b6ca8", "#c05a00")[k % 2] for k in range(count)]
