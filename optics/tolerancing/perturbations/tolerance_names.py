"""The tolerances that a system has, by name, each with a unit and the amount that a good shop holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from math import isfinite, radians
from typing import Any

from optics.base.runtime import UserError
from optics.scene.system import OpticalSystem
from optics.tolerancing.perturbations.perturbation import Perturbation

# mm: a fine length of 0.5 to 6 mm, such as a lens's seat (ISO 2768-1, class f), and one of 6 to 30 mm, at
# which a source is mounted; where the target is set up in a room with a ruler, and its distance with a tape
SEAT, SOURCE_SEAT, ROOM, THROW = 0.05, 0.1, 0.5, 1.0
# degrees: such a seat's error over a lens of 57 mm; twice; a room
TILT, SOURCE_TILT, ROOM_TILT = 0.05, 0.1, 0.5
THICKNESS, INDEX = 0.05, 0.0005  # mm, 1: Optimax's chart of manufacturing tolerances, its column "precision"
POWER = 0.1  # %: of the vertex radius of an asphere, Optimax's chart of limits for aspheres
SIZE = 2.0  # %: edges of an emitting area of 1 mm that are known within 10 um
TEMPERATURE = 20.0  # K: a room's 20 C against a luminaire's 40 C
AXES = "xyz"
# tolerances that not every lens has
SOMETIMES = ("front.decentre", "front.power", "rear.power", "temperature")


@dataclass(frozen=True)
class Tolerance:
    """What may be wrong by up to +- amount.

    unit : "mm", "degrees", "1", "%" or "K".  change : the Perturbation for the amount 1 of it.
    """

    name: str
    unit: str
    amount: float
    change: Perturbation

    @property
    def words(self) -> str:
        """The amount with its unit."""
        return self.in_words(self.amount)

    def in_words(self, amount: float) -> str:
        """Return an amount with its unit, three digits."""
        return f"{amount:.3g}" if self.unit == "1" else f"{amount:.3g} {self.unit}"

    def at(self, amount: float) -> Perturbation:
        """Return the Perturbation for an amount."""
        return amount * self.change


def tolerances_of(system: OpticalSystem, amounts: Mapping[str, float] | None = None) -> tuple[Tolerance, ...]:
    """Return the tolerances of a system, those of amount 0 left out.

    amounts : other amounts by name; "lens.tilt" stands for "lens.tilt_x", "lens.tilt_y" and "lens.tilt_z".

    Raises UserError : an unknown name, for which the nearest is proposed, or an amount that is not a number
        from 0.
    """
    known = {t.name: t for t in _usual(system)}
    chosen = {name: t.amount for name, t in known.items()}
    for name, amount in (amounts or {}).items():
        absent = name in SOMETIMES and name not in known and amount == 0  # what is not there may be left out
        names = [] if absent else _meant(name, known)
        checked = _checked(name, amount)
        chosen |= {one: checked for one in names}
    return tuple(Tolerance(n, t.unit, chosen[n], t.change) for n, t in known.items() if chosen[n])


def _meant(name: str, known: Mapping[str, Tolerance]) -> list[str]:
    """Return the names of tolerances that a name stands for."""
    names = [n for n in known if n == name or (n[-2] == "_" and n[:-2] == name)]
    if names:
        return names
    if name == "temperature":
        raise UserError(
            "how the lens changes with temperature is not known: lens.material names no material with dn/dT "
            "and expansion; leave temperature out, or name one, such as PMMA"
        )
    if name.endswith(".power"):
        raise UserError(
            f"the {name.removesuffix('.power')} is plane, so that it has no radius; leave {name} out"
        )
    if name.startswith("front.decentre"):
        raise UserError(f"the front is plane, so that it has no middle; leave {name} out")
    near = get_close_matches(name, [*known, *{n[:-2] for n in known if n[-2] == "_"}], 1)
    meant = f" (did you mean {near[0]}?)" if near else ""
    raise UserError(f"there is no tolerance {name!r} of this system{meant}; there are {', '.join(known)}")


def _checked(name: str, amount: object) -> float:
    if isinstance(amount, bool) or not isinstance(amount, int | float) or not isfinite(amount) or amount < 0:
        raise UserError(f"the tolerance {name} must be a number from 0, such as {name}=0.05, got {amount!r}")
    return float(amount)


def _usual(system: OpticalSystem) -> list[Tolerance]:
    """Return all tolerances of a system, with their usual amounts."""
    rows = [*_placed("lens", SEAT, SEAT, TILT, AXES)]
    rows.append(Tolerance("thickness", "mm", THICKNESS, Perturbation(thickness=1.0)))
    rows.append(Tolerance("index", "1", INDEX, Perturbation(index=1.0)))
    front = system.lens.front  # against the rear: halves of a mould, or the seat between two cuts
    decentre = 0.0 if front.is_plane else SEAT
    rows += _placed("front", decentre, 0.0, TILT, "xy" if front.sag is None else AXES)
    for name in ("front", "rear"):
        if not getattr(system.lens, name).conic.is_plane:
            rows.append(Tolerance(f"{name}.power", "%", POWER, _changed(f"{name}_power", 0.01)))
    material, source = system.material, system.source
    if material is not None and (material.dn_dt or material.expansion):
        rows.append(Tolerance("temperature", "K", TEMPERATURE, Perturbation(temperature=1.0)))
    defocus = 0.0 if source.from_afar else SOURCE_SEAT  # parallel light has no distance
    rows += _placed("source", SOURCE_SEAT, defocus, SOURCE_TILT, "xy" if source.axial else AXES)
    if source.scalable:
        rows.append(Tolerance("source.size", "%", SIZE, Perturbation(source_size=0.01)))
    # directions have no position
    room, throw = (0.0, 0.0) if system.target.far_field else (ROOM, THROW)
    return rows + _placed("target", room, throw, ROOM_TILT, AXES)


def _placed(part: str, decentre: float, defocus: float, tilt: float, turned: str) -> list[Tolerance]:
    """Return the tolerances of where a part stands; those of amount 0 do not exist."""
    rows = []
    for axis in range(3):
        along = tuple(float(axis == k) for k in range(3))
        name = "defocus" if axis == 2 else f"decentre_{AXES[axis]}"
        amount = defocus if axis == 2 else decentre
        if amount:
            rows.append(Tolerance(f"{part}.{name}", "mm", amount, _changed(f"{part}_shift", along)))
    for axis in range(3):
        if AXES[axis] in turned:
            about = tuple(radians(1.0) * (axis == k) for k in range(3))
            name = f"{part}.tilt_{AXES[axis]}"
            rows.append(Tolerance(name, "degrees", tilt, _changed(f"{part}_tilt", about)))
    return rows


def _changed(field: str, value: Any) -> Perturbation:
    """Return the Perturbation of one field."""
    return Perturbation(**{field: value})
