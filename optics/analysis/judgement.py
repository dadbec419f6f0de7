"""Whether a lens does its job: limits of what it delivers, and sentences on where its light goes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from optics.runtime import Check
from optics.tracing import SENTENCES

if TYPE_CHECKING:
    from optics.photometry import Units
    from optics.problem import Verify

# flux by fate that a lens should not lose, and the fraction of the source flux from which a sentence says so
LOSSES = ("beside_lens", "missed_rear", "unresolved", "total_internal", "off_target", "absorbed")
WORTH_A_NOTE = 0.1


def delivery_checks(metrics: dict[str, Any], limits: Verify) -> list[Check]:
    """Return the checks of what the lens delivers: its error, and its light beside the lit pixels.

    The second is 1 - Phi_lit / Phi, where Phi is the flux that leaves the lens towards the target plane.
    """
    passing = metrics["efficiency"] + metrics["stray"]
    lit = metrics["lit_efficiency"] / passing if passing else 0.0
    return [
        Check("rel_l2 of the irradiance against the target", metrics["rel_l2"], limits.rel_l2, ""),
        Check("light behind the lens that misses the lit pixels", 1 - lit, 1 - limits.lit_efficiency, ""),
    ]


def loss_notes(metrics: dict[str, Any], units: Units) -> list[str]:
    """Return a sentence for every way on which much of the source flux is lost."""
    fates = metrics[units.key("fates")]
    flux = sum(map(abs, fates.values()))
    return [
        f"{fates[name] / flux:.0%} of the light {SENTENCES[name]}"
        for name in LOSSES
        if fates.get(name, 0.0) > WORTH_A_NOTE * flux
    ]


def counted_ways(metrics: dict[str, Any]) -> str:
    """Return in words which light the metrics and the irradiance of a Measurement count."""
    return "all paths" if metrics["paths"] == "all" else "front and rear only"


def verdict(checks: Sequence[Check]) -> str:
    """Return one sentence on a design."""
    failed = [c for c in checks if not c.ok]
    if not failed:
        return "every check passed: the lens makes the light asked for, and the file is the lens"
    first = f"{failed[0].name}: {failed[0].value:.3g} {failed[0].unit}".rstrip()
    more = f", and {len(failed) - 1} more" if len(failed) > 1 else ""
    return f"the design misses {first} (at most {failed[0].limit:g}){more}"
