"""The few numbers that say how good a lens is, each with its name and its meaning in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape
from typing import Any

from optics.reporting.report.metric_words import PERCENT, number_text
from optics.scene.photometry import Units

SECONDS_OF_A_MINUTE = 60
LONG = 120.0  # s, from which on a time is said in minutes


def key_numbers(metrics: Mapping[str, Any], units: Units) -> Iterator[tuple[str, str, str]]:
    """Yield (name, value with its unit, meaning) of the main metrics, in plain words."""
    error = number_text(metrics["rel_l2_debiased"], PERCENT)
    yield (
        "Difference from the light asked for",
        f"{error} %",
        "root mean square over the target, relative to that of the light asked for; 0 is perfect",
    )
    yield (
        "Light on the target",
        f"{number_text(metrics['efficiency'], PERCENT)} %",
        f"of the light of the source; {number_text(metrics['normal_incidence_transmittance'], PERCENT)} % "
        "pass two uncoated faces at normal incidence",
    )
    yield (
        "Stray light",
        f"{number_text(metrics['stray'], PERCENT)} %",
        "of the light of the source leaves the lens and misses the target",
    )
    mean = next((name for name in metrics if name.startswith("target_mean_")), None)
    if mean:
        shown = units.in_plane
        yield (
            f"Mean {shown.quantity}",
            f"{number_text(metrics[mean])} {shown.shown}",
            "of the whole target",
        )
    yield (
        "Free numbers",
        f"{metrics['dof']}",
        "coefficients of the splines that the optimiser chose",
    )
    yield "Time", _duration(metrics["wall_s"]["total"]), "from the problem to the verified file"


def key_list(metrics: Mapping[str, Any], units: Units) -> str:
    """Return the main metrics as a list in HTML."""
    items = (
        f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd><dd>{escape(meaning)}</dd></div>"
        for name, value, meaning in key_numbers(metrics, units)
    )
    return f'<dl class="key">{"".join(items)}</dl>'


def _duration(seconds: float) -> str:
    if seconds < LONG:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), SECONDS_OF_A_MINUTE)
    return f"{minutes} min {rest} s"
