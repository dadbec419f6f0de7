"""Words for light by a lens, or by a mirror, whose metrics name its reflectance."""

from __future__ import annotations

from collections.abc import Mapping
from math import prod, sqrt
from typing import Any

from optics.light.tracing import normal_incidence_transmittance
from optics.scene.paths import LightPath


def passing_share(path: LightPath) -> dict[str, float | None]:
    """Return which share of light a mirror, or a lens at normal incidence, passes on, by its metric."""
    first, bare = path.surfaces[0], normal_incidence_transmittance(path.media[1].index)
    if first.kind == "reflect":
        return {"reflectance": first.share}
    shares = [surface.share for surface in path.surfaces]
    if shares == [None, None]:
        return {"normal_incidence_transmittance": bare}
    return {"coated_transmittance": prod(sqrt(bare) if share is None else share for share in shares)}


def passing_words(metrics: Mapping[str, Any]) -> str:
    """Return how much light could arrive at best, in words."""
    if "reflectance" in metrics:
        return f"the mirror reflects {metrics['reflectance']:.1%}"
    if "coated_transmittance" in metrics:
        return f"front and rear as coated pass {metrics['coated_transmittance']:.1%} at normal incidence"
    return f"two uncoated faces at normal incidence pass {metrics['normal_incidence_transmittance']:.1%}"
