"""Sliders beside the light that they change, for notebooks (ipywidgets)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from html import escape

import ipywidgets

from optics.base.runtime import UserError
from optics.interface.relighting.explored_light import ExploredLight, Knob
from optics.reporting.report import figures_html, light_pictures

STEPS = 200  # of a slider


def sliders(knobs: Sequence[Knob], light: Callable[[Mapping[str, float]], ExploredLight]) -> ipywidgets.HBox:
    """Return sliders of knobs beside pictures and numbers of the light that their values make."""
    rows = {
        knob.name: ipywidgets.FloatSlider(
            value=knob.value,
            min=knob.low,
            max=knob.high,
            step=(knob.high - knob.low) / STEPS,
            description=f"{knob.name} / {knob.unit}",
            readout_format=".4g",
            style={"description_width": "13em"},
            layout={"width": "30em"},
        )
        for knob in knobs
    }
    shown = ipywidgets.HTML(layout={"width": "100%"})

    def show(change: object = None) -> None:
        try:
            shown.value = light_html(light({name: row.value for name, row in rows.items()}))
        except UserError as error:  # no light passes, or no lens is so wrong
            shown.value = escape(str(error))

    for row in rows.values():
        row.observe(show, "value")
    show()
    return ipywidgets.HBox([ipywidgets.VBox(list(rows.values())), shown])


def light_html(light: ExploredLight) -> str:
    """Return pictures and numbers of light."""
    numbers = light.numbers
    words = [f"rel_l2 {numbers.rel_l2:.4f}", f"efficiency {numbers.efficiency:.3f}"]
    if numbers.min_over_mean is not None:
        words.insert(0, f"U0 = E_min/E_mean {numbers.min_over_mean:.3f}")
    pictures = figures_html(light_pictures(light.target, light.irradiance))
    grid = "display:grid;grid-template-columns:repeat(3,minmax(0,1fr));gap:1em"
    rows, columns = light.irradiance.shape  # fewer than those of the design, whose rel_l2 differs so far
    return f'<b>{", ".join(words)}</b>, on {columns} x {rows} pixels<div style="{grid}">{pictures}</div>'
