"""Words for light by a lens, or by a mirror, whose metrics name its reflectance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from optics.light.tracing import normal_incidence_transmittance
from optics.scene.paths import LightPath


def passing_share(path: LightPath) -> dict[str, float | None]:
    """Return which share of light a mirror, or bare glass at normal incidence, passes on, by its metric."""
    first = path.surfaces[0]
    if first.kind == "reflect":
        return {"reflectance": first.share}
    return {"normal_incidence_transmittance": normal_incidence_transmittance(path.media[1].index)}


def passing_words(metrics: Mapping[str, Any]) -> str:
    """Return how much light could arrive at best, in words."""
    if "reflectance" in metrics:
        return f"the mirror reflects {metrics['reflectance']:.1%}"
    return f"two uncoated faces at normal incidence pass {metrics['normal_incidence_transmittance']:.1%}"
