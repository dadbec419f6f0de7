"""Words for light by a lens, or by a mirror, whose metrics name its reflectance."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from math import prod, sqrt
from typing import Any

from optics.light.tracing import normal_incidence_transmittance
from optics.scene.paths import LightPath


def passing_share(path: LightPath) -> dict[str, float | None]:
    """Return which share of light a mirror, a lens or a row passes on at normal incidence, by its metric."""
    if len(path.surfaces) == 1 and path.surfaces[0].kind == "reflect":
        return {"reflectance": path.surfaces[0].share}
    shares = [surface.share for surface in path.surfaces]
    if shares == [None, None]:
        return {"normal_incidence_transmittance": normal_incidence_transmittance(path.media[1].index)}
    bare = (
        1.0 if surface.kind == "reflect" else sqrt(normal_incidence_transmittance(b.index / a.index))
        for surface, (a, b) in zip(path.surfaces, pairwise(path.media))
    )
    passing = prod(own if share is None else share for own, share in zip(bare, shares))
    lens = [surface.kind for surface in path.surfaces] == ["refract", "refract"]
    return {"coated_transmittance" if lens else "row_transmittance": passing}


def passing_words(metrics: Mapping[str, Any]) -> str:
    """Return how much light could arrive at best, in words."""
    if "reflectance" in metrics:
        return f"the mirror reflects {metrics['reflectance']:.1%}"
    if "coated_transmittance" in metrics:
        return f"front and rear as coated pass {metrics['coated_transmittance']:.1%} at normal incidence"
    if "row_transmittance" in metrics:
        return f"the elements pass {metrics['row_transmittance']:.1%} at normal incidence"
    return f"two uncoated faces at normal incidence pass {metrics['normal_incidence_transmittance']:.1%}"
