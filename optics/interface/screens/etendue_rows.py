"""The first screen of `thbcad etendue`: whether any lens can make the requested light."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from optics.interface.screens.screen import Entry, Screen
from optics.scene.system import System

PERCENT = 100
SHOWN = 5e-4  # rel_l2: a smaller lower bound says nothing


def etendue_screen(
    system: System, data: Mapping[str, Any], without: str, efficiency: float, out: Path | None
) -> Screen:
    """Return the screen of what etendue allows.

    data : of `thbcad etendue --json`.  without : why etendue gives no limit, or "".
    efficiency : fraction of the source's light on the target that the limits are for.  out : the picture.
    """
    sizes = data["etendue_mm2_sr"]
    target = f"target {sizes['target']:.4g} mm^2 sr" if sizes["target"] is not None else ""
    rows = [] if without else [Entry("etendue", f"source {sizes['source']:.4g} mm^2 sr", target)]
    if without:
        rows.append(Entry("why", without))
    else:
        flux, most = system.problem.flux, data["universal"][system.units.key("on_target")]
        rows.append(
            Entry("light", f"at most {most / flux:.0%} of the source's light on the target, by any path")
        )
        least = data["universal"]["rel_l2"]
        floor = "no lower limit" if not least else f"at least {PERCENT * least:.3g} %"
        rows.append(
            Entry("error", f"{floor} at {efficiency:.0%} of the light, for any lens in this envelope")
        )
    blur = data.get("one_blur", {}).get("source_proportions")
    if blur is not None and blur["lower_bound"] >= SHOWN:
        bound = f"error at least {PERCENT * blur['lower_bound']:.3g} %"
        rows.append(
            Entry("blur", f"{bound} if every point of the lens blurs alike (a smooth lens nearly does)")
        )
    if out is not None:
        rows.append(Entry("files", str(out)))
    return Screen(system.problem.title, _state(data, without), (*rows, Entry("", "more: --full")))


def _state(data: Mapping[str, Any], without: str) -> str:
    """Return the answer to the question whether any lens can make the light."""
    if without:
        return "etendue sets no limit here"
    least = data["universal"]["rel_l2"]
    if least is None:
        return "impossible: no lens brings so much light to the target"
    return (
        "etendue allows this light" if least == 0 else f"impossible below an error of {PERCENT * least:.3g} %"
    )
