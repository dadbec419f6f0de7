"""Fates of light: how every part of the source's flux ends, in sequence and with all reflections."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from typing import NamedTuple, TypeVar

Number = TypeVar("Number", int, float)
# every fate of the light of a lens alone with the sentence that reports print
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
    "blocked": "is blocked by a stop, the screen or an absorbing wall, or beside the clear aperture",
    "reflected_outside": "is reflected at the front and never enters",
    "edges_on_target": "leaves by an edge and meets the target",
    "edges_off_target": "leaves by an edge and passes beside the target",
    "front_on_target": "leaves by the front and meets the target",
    "front_off_target": "leaves by the front and passes beside the target",
    "neighbours_on_target": "leaves a plate by another lens's front or rear and meets the target",
    "neighbours_off_target": "leaves a plate by another lens's front or rear and passes beside the target",
    "back": "leaves and never reaches the target plane",
    "trapped": "falls below the threshold, or meets too many faces",
    "failed": "is lost: no face was found in glass, or none was certain to be the first",
}

# how light ends at a face with a name, and on its way there: the word behind that name, and the sentence
OF_FACE = {
    "missed": ("missed", "misses {}"),
    "reflected": ("reflected", "is reflected at {}"),
    "unresolved": ("unresolved", "is undecided: the search for where it meets {} failed"),
    # refracted backwards, too
    "total_internal": ("total reflection", "is reflected totally at {}"),
    "absorbed": ("absorbed", "is absorbed at {}, or on its way there"),
    "blocked": ("blocked", "is blocked on its way to {}, or beside the clear aperture there"),
    "hit_twice": ("hit twice", "hits {} twice, where it means to go on"),
}
OF_SCENE = {
    "on_target": "meets the target",
    "off_target": "passes beside the target",
    "blocked": "is blocked behind the last surface",
}
# what a lens alone calls the fates of its front and its rear
OF_LENS = {"missed": ("beside_lens", "missed_rear"), "reflected": ("front_reflected", "rear_reflected")}


class Fate(NamedTuple):
    """How light ends on its way from surface to surface.

    what : a name of OF_FACE, "on_target" or "off_target".  number : of the surface along its path, -1 is
    behind the last.  face : the name of the surface, such as "M1.face".
    """

    what: str
    number: int = -1
    face: str = ""

    @classmethod
    def at(cls, what: str, number: int, face: str) -> Fate:
        """Return a fate at a surface; those without a name only tell apart what `OF_LENS` does."""
        if face:
            return cls(what, number, face)
        return cls(what, min(number, 1)) if what in OF_LENS else cls(what)

    @property
    def name(self) -> str:
        """In files: the face and how light ends there, or the name that a lens alone has for it."""
        if self.face:
            return f"{self.face} {OF_FACE[self.what][0]}"
        return OF_LENS[self.what][self.number] if self.what in OF_LENS else self.what

    @property
    def rare(self) -> bool:
        """Whether files name it only where some light has it."""
        return bool(self.face) or self.what in ("absorbed", "blocked")


ON_TARGET, OFF_TARGET = Fate("on_target"), Fate("off_target")


@dataclass(frozen=True)
class SequentialFates:
    """The source flux by fate, W, from surface to surface; the fates sum to the source flux."""

    flux: Mapping[Fate, float]

    @property
    def on_target(self) -> float:
        return self.flux[ON_TARGET]

    @property
    def off_target(self) -> float:
        """Of light that meets the plane of the target beside its rectangle, or never."""
        return self.flux[OFF_TARGET]

    @property
    def transmitted(self) -> float:
        return self.on_target + self.off_target

    @property
    def missed_rear(self) -> float:
        """Of light that misses a surface behind the first one."""
        return sum(flux for fate, flux in self.flux.items() if fate.what == "missed" and fate.number)

    @property
    def blocked(self) -> float:
        """By stops and bodies on the way, those that it left among them, and beside clear apertures."""
        return self._sum("blocked") + self._sum("hit_twice")

    @property
    def total(self) -> float:
        """Of all light."""
        return sum(self.flux.values())

    @property
    def by_name(self) -> dict[str, float]:
        """The flux by the name of its fate; what is rare only where there is some."""
        return _in_order(by_name(self.flux))

    def landing(self, on_target: float, off_target: float) -> SequentialFates:
        """Return it with other flux on the target and beside it."""
        return SequentialFates({**self.flux, ON_TARGET: on_target, OFF_TARGET: off_target})

    def and_missing(self, missed: float) -> SequentialFates:
        """Return it with more light that misses the first surface."""
        first = next(fate for fate in self.flux if fate.what == "missed")
        return SequentialFates({**self.flux, first: self.flux[first] + missed})

    def _sum(self, what: str) -> float:
        return sum(flux for fate, flux in self.flux.items() if fate.what == what)

    def __add__(self, other: SequentialFates) -> SequentialFates:
        return SequentialFates({fate: flux + other.flux[fate] for fate, flux in self.flux.items()})

    def __mul__(self, factor: float) -> SequentialFates:
        return SequentialFates({fate: factor * flux for fate, flux in self.flux.items()})

    def __truediv__(self, count: int) -> SequentialFates:
        return SequentialFates({fate: flux / count for fate, flux in self.flux.items()})


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
    neighbours_on_target: float = 0.0
    neighbours_off_target: float = 0.0

    @property
    def onto(self) -> float:
        """Flux on the target rectangle, by any way through the lens."""
        return self.on_target + self.edges_on_target + self.front_on_target + self.neighbours_on_target

    @property
    def beside(self) -> float:
        """Flux in the target plane beside the rectangle, by any way through the lens."""
        return self.off_target + self.edges_off_target + self.front_off_target + self.neighbours_off_target

    @property
    def crosstalk(self) -> float:
        """Flux that goes to the target, or beside it, by a neighbour's front or rear."""
        return self.neighbours_on_target + self.neighbours_off_target

    @property
    def by_name(self) -> dict[str, float]:
        """The flux by the name of its fate; what is absorbed or blocked, or a neighbour's, only where there
        is some."""
        rare = {field.name for field in fields(self) if field.default == 0.0}
        return {name: f for name, f in asdict(self).items() if f or name not in rare}


def fate_sentences(fates: Iterable[str]) -> dict[str, str]:
    """Return what becomes of light by the name of its fate.

    fates : the names, of a lens alone or of the faces of a scene.
    """
    names = set(fates)
    if "beside_lens" in names:
        return SENTENCES
    ends = [
        (name, word, text) for name in names for word, text in OF_FACE.values() if name.endswith(f" {word}")
    ]
    return OF_SCENE | {name: text.format(name.removesuffix(f" {word}")) for name, word, text in ends}


def by_name(shares: Mapping[Fate, Number]) -> dict[str, Number]:
    """Return what light has by the names of its fates; a face that it meets twice has one of each."""
    found: dict[str, Number] = {}
    for fate, share in shares.items():
        if share or not fate.rare:
            found[fate.name] = found.get(fate.name, type(share)(0)) + share
    return found


def _in_order(flux: dict[str, float]) -> dict[str, float]:
    """Return fates of faces first, and then all others as in SENTENCES."""
    others = {name: flux[name] for name in SENTENCES if name in flux}
    return {name: f for name, f in flux.items() if name not in others} | others


FATES = tuple(field.name for field in fields(Fates))
