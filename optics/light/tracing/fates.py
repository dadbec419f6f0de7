"""Fates of light: how every part of the source's flux ends, in sequence and with all reflections."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields

# every fate with the sentence that reports print
SENTENCES = {
    "beside_lens": "passes beside the lens",
    "front_reflected": "is reflected at the front",
    "missed_rear": "meets an edge instead of the rear",
    "unresolved": "is undecided: the search for a meeting point failed",
    "total_internal": "is reflected totally at the rear",
    "rear_reflected": "is reflected at the rear",
    "on_target": "leaves by the rear and meets the target",
    "off_target": "leaves by the rear and passes beside the target",
    "absorbed": "is absorbed in the lens",
    "blocked": "is blocked by a stop, by an absorbing wall, or beside the clear aperture",
    "reflected_outside": "is reflected at the front and never enters",
    "edges_on_target": "leaves by an edge and meets the target",
    "edges_off_target": "leaves by an edge and passes beside the target",
    "front_on_target": "leaves by the front and meets the target",
    "front_off_target": "leaves by the front and passes beside the target",
    "back": "leaves and never reaches the target plane",
    "trapped": "falls below the threshold, or meets too many faces",
    "failed": "is lost: no face was found in glass, or none was certain to be the first",
}


@dataclass(frozen=True)
class SequentialFates:
    """The source flux by fate, W, by way of front and rear alone; the fates sum to the source flux.

    front_reflected, rear_reflected : Fresnel losses.  total_internal : or refracted backwards.
    on_target, off_target : meets the target rectangle, or its plane beside it.
    absorbed : on the way from front to rear.
    blocked : by stops on the way, and on front and rear beside their clear apertures.
    """

    beside_lens: float
    front_reflected: float
    missed_rear: float
    unresolved: float
    total_internal: float
    rear_reflected: float
    on_target: float
    off_target: float
    absorbed: float = 0.0
    blocked: float = 0.0

    @property
    def transmitted(self) -> float:
        return self.on_target + self.off_target

    def __add__(self, other: SequentialFates) -> SequentialFates:
        return SequentialFates(*(a + b for a, b in zip(asdict(self).values(), asdict(other).values())))

    def __mul__(self, factor: float) -> SequentialFates:
        return SequentialFates(*(factor * flux for flux in asdict(self).values()))

    def __truediv__(self, count: int) -> SequentialFates:
        return SequentialFates(*(flux / count for flux in asdict(self).values()))


@dataclass(frozen=True)
class Fates:
    """The source flux by fate, W, with all reflections at all faces; the fates sum to the source flux.

    blocked : by stops, beside clear apertures, and by absorbing walls.
    """

    beside_lens: float
    reflected_outside: float
    on_target: float
    off_target: float
    edges_on_target: float
    edges_off_target: float
    front_on_target: float
    front_off_target: float
    back: float
    trapped: float
    failed: float
    absorbed: float = 0.0
    blocked: float = 0.0

    @property
    def onto(self) -> float:
        """Flux on the target rectangle, by any way through the lens."""
        return self.on_target + self.edges_on_target + self.front_on_target

    @property
    def beside(self) -> float:
        """Flux in the target plane beside the rectangle, by any way through the lens."""
        return self.off_target + self.edges_off_target + self.front_off_target


def flux_by_fate(fates: SequentialFates | Fates) -> dict[str, float]:
    """Return the flux by the name of its fate, W; absorbed and blocked light only where there is some."""
    return {name: flux for name, flux in asdict(fates).items() if flux or name not in ("absorbed", "blocked")}


FATES = tuple(field.name for field in fields(Fates))
