"""How much better the light of a transport start is than that of the base surface."""

from __future__ import annotations

from dataclasses import dataclass

from optics.base.runtime import Backend
from optics.designing.starts.traced_light import light_before
from optics.designing.starts.transport_start import TransportFit
from optics.scene.system import System

PIXELS = 64  # in a direction, at most; more are merged: a poor start is wrong by more than a merged pixel
CLOSE = 0.05  # a misfit at which it does not matter that the base surface has less
POOR = 1 / 3  # of the base surface's misfit
FAIR = 0.3  # a misfit that a design repairs: 20 thin pictures on black start from 0.06 to 0.26


@dataclass(frozen=True)
class StartQuality:
    """rel_l2 of the light of a transport start and of the base surface, on merged pixels."""

    start: float
    base: float

    @property
    def useless(self) -> bool:
        """Whether the base surface makes light that is nearer to the target."""
        return self.start >= max(self.base, CLOSE)

    @property
    def poor(self) -> bool:
        """Whether the base surface makes nearer light, or the start leaves so much of its misfit that the
        design may end far off."""
        return self.useless or self.start > max(POOR * self.base, FAIR)

    def sentence(self, gap: float) -> str:
        """Return what is wrong with a poor start.  gap : of its transport map, see `Transport.gap`."""
        compared = "no better than" if self.useless else "more than a third of"
        return (
            f"the transport start has rel_l2 {self.start:.2g}, {compared} the {self.base:.2g} of the base "
            f"surface (dual gap of its map: {gap:.1%})"
        )


def start_quality(system: System, backend: Backend, fit: TransportFit) -> StartQuality | None:
    """Return the quality of a fit of a start; None where light has extent or is blurred.

    Nothing blocks the light, since the map knows of no stops.
    """
    if system.source.extended or system.blurred:
        return None
    coarsening = -(-max(system.target.settings.pixels) // PIXELS)
    moved = system.with_sags([*system.sags[:-1], fit.sag])
    start, base = (
        light_before(shaped, backend, coarsening, shaped.path.without_stops())[1]
        for shaped in (moved, system.unshaped)
    )
    return None if start is None or base is None else StartQuality(start, base)
