"""The tolerances that a system has, by name, each with a unit and the amount that a good shop holds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import partial
from math import radians
from numbers import Real
from typing import Literal

from optics.base.runtime import UserError
from optics.scene.problem import MirrorElement, Optic, Placed
from optics.scene.system import System, indexing_material
from optics.tolerancing.perturbations.perturbation import Perturbation
from thbcad.lens import Lens

# mm: a fine length of 0.5 to 6 mm, such as a lens's seat (ISO 2768-1, class f), and one of 6 to 30 mm, at
# which a source is mounted; where the target is set up in a room with a ruler, and its distance with a tape
SEAT, SOURCE_SEAT, ROOM, THROW = 0.05, 0.1, 0.5, 1.0
# degrees: such a seat's error over a lens of 57 mm; twice; a room
TILT, SOURCE_TILT, ROOM_TILT = 0.05, 0.1, 0.5
STRAIGHT = 1 - 1e-12  # cosine of the angle of a beam that runs along z
THICKNESS, INDEX = 0.05, 0.0005  # mm, 1: Optimax's chart of manufacturing tolerances, its column "precision"
POWER = 0.1  # %: of the vertex radius of an asphere, Optimax's chart of limits for aspheres
SIZE = 2.0  # %: edges of an emitting area of 1 mm that are known within 10 um
TEMPERATURE = 20.0  # K: a room's 20 C against a luminaire's 40 C
AXES = "xyz"
Holder = Literal["shop", "mount"]
MOST = 1e6  # of an amount, in any unit
# tolerances that not every lens or mirror has
SOMETIMES = ("front.decentre", "front.power", "rear.power", "face.power", "temperature")
MEDIUM = "thickness", "index", "temperature"  # what only a lens can have


@dataclass(frozen=True)
class Tolerance:
    """What may be wrong by up to +- amount.

    unit : "mm", "degrees", "1", "%" or "K".  change : the Perturbation for the amount 1 of it.
    held_by : the shop that makes the part, or who mounts part, source and target.
    """

    name: str
    unit: str
    amount: float
    change: Perturbation
    held_by: Holder = "shop"

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


def tolerances_of(system: System, amounts: Mapping[str, float] | None = None) -> tuple[Tolerance, ...]:
    """Return the tolerances of a system, those of amount 0 left out.

    amounts : other amounts by name; "lens.tilt" stands for "lens.tilt_x", "lens.tilt_y" and "lens.tilt_z".

    Raises UserError : an unknown name, for which the nearest is proposed, or an amount that is not a number
        from 0.
    """
    known = {t.name: t for t in _usual(system)}
    chosen = {name: t.amount for name, t in known.items()}
    for name, amount in (amounts or {}).items():
        names = [n for n in known if n == name or (n[-2] == "_" and n[:-2] == name)]
        if not names and not (amount == 0 and _own(system, name)[1] in SOMETIMES):
            raise UserError(_why_not(system, name, known))
        checked = _checked(name, amount)
        chosen |= {one: checked for one in names}
    return tuple(replace(t, amount=chosen[n]) for n, t in known.items() if chosen[n])


def _own(system: System, name: str) -> tuple[Optic | None, str]:
    """Return the element that a name begins with, and the rest; all names of a lens on the axis are its."""
    if not system.problem.element:
        return system.problem.optic, name
    called, _, own = name.partition(".")
    return next((optic for optic in system.problem.optics if optic.called == called), None), own


def _why_not(system: System, name: str, known: Mapping[str, Tolerance]) -> str:
    """Return why there is no tolerance of a name."""
    optic, own = _own(system, name)
    part = name.rpartition(".")[0] if system.problem.element else f"the {name.rpartition('.')[0]}"
    if isinstance(optic, MirrorElement) and own in MEDIUM:
        return f"{optic.called} is a mirror, which has no {own}; leave {name} out"
    if optic is not None and own == "temperature":
        return (
            f"how {'the lens' if own == name else optic.called} changes with temperature is not known: "
            f"{optic.key('material')} names no material with dn/dT and expansion; leave {name} out, or name "
            "one, such as PMMA"
        )
    if own in SOMETIMES and own.endswith(".power"):
        return f"{part} is plane, so that it has no radius; leave {name} out"
    if optic is not None and own.startswith(("front.decentre", "decentre")):
        return f"{part} is plane, so that it has no middle; leave {name} out"
    begins = [*(optic.called for optic in system.problem.optics), "source", "target"]
    if system.problem.element and name.partition(".")[0] not in begins:
        first = next(iter(known))
        return f"tolerances of this scene begin with {', '.join(begins)}, such as {first}, got {name!r}"
    near = get_close_matches(name, [*known, *{n[:-2] for n in known if n[-2] == "_"}], 1)
    meant = f" (did you mean {near[0]}?)" if near else ""
    return f"there is no tolerance {name!r} of this system{meant}; there are {', '.join(known)}"


def _checked(name: str, amount: object) -> float:
    if isinstance(amount, bool) or not isinstance(amount, Real) or not 0 <= float(amount) <= MOST:
        raise UserError(
            f"the tolerance {name} must be a number from 0 to {MOST:g}, such as {name}=0.05, got {amount!r}"
        )
    return float(amount)


def _usual(system: System) -> list[Tolerance]:
    """Return all tolerances of a system, with their usual amounts."""
    rows = [row for optic, lens in system.unshaped.elements for row in _of_element(system, optic, lens)]
    source = system.source
    # parallel light along z has no distance
    defocus = 0.0 if source.beam and source.frame.rotation[2, 2] >= STRAIGHT else SOURCE_SEAT
    rows += _placed("source", SOURCE_SEAT, defocus, SOURCE_TILT, "xy" if source.axial else AXES, "source")
    if source.scalable:
        rows.append(Tolerance("source.size", "%", SIZE, Perturbation(source_size=0.01), "mount"))
    # directions have no position
    room, throw = (0.0, 0.0) if system.target.far_field else (ROOM, THROW)
    return rows + _placed("target", room, throw, ROOM_TILT, AXES, "target")


def _of_element(system: System, optic: Optic, lens: Lens) -> list[Tolerance]:
    """Return the tolerances of an element.  lens : it, or its blank."""
    placed, front = isinstance(optic, Placed), lens.front
    errors, own = partial(Perturbation.on, optic, system.problem.optic), f"{optic.called}." if placed else ""
    # a fixed element stays the same where it turns about its axis, and a plane one where it is moved across
    decentre = 0.0 if placed and front.is_plane and lens.rear.is_plane else SEAT
    turned = AXES if optic.free or not placed else "xy"
    rows = _placed(optic.called, decentre, SEAT, TILT, turned, "lens", errors)
    if not isinstance(optic, MirrorElement):
        rows.append(Tolerance(f"{own}thickness", "mm", THICKNESS, errors(thickness=1.0)))
        rows.append(Tolerance(f"{own}index", "1", INDEX, errors(index=1.0)))
        # against the rear: halves of a mould, or the seat between two cuts
        decentre = 0.0 if front.is_plane else SEAT
        turned = "xy" if front.sag is None else AXES
        rows += _placed(f"{own}front", decentre, 0.0, TILT, turned, "front", errors)
    for name in ("front", "rear"):
        if not getattr(lens, name).conic.is_plane:
            change = errors(**{f"{name}_power": 0.01})
            rows.append(Tolerance(f"{own}{optic.face_name(name)}.power", "%", POWER, change))
    material = indexing_material(system.problem, optic)
    if material is not None and (material.dn_dt or material.expansion):
        rows.append(Tolerance(f"{own}temperature", "K", TEMPERATURE, errors(temperature=1.0), "mount"))
    return rows


def _placed(
    part: str,
    decentre: float,
    defocus: float,
    tilt: float,
    turned: str,
    field: str,
    errors: Callable[..., Perturbation] = Perturbation,
) -> list[Tolerance]:
    """Return the tolerances of where a part stands; those of amount 0 do not exist.

    field : begins the names of what changes.  errors : called with it, returns the Perturbation.
    """
    rows: list[Tolerance] = []
    held_by: Holder = "shop" if field == "front" else "mount"  # the front moves within the part
    shifts = {"decentre_x": decentre, "decentre_y": decentre, "defocus": defocus}
    for axis, (name, amount) in enumerate(shifts.items()):
        if amount:
            change = errors(**{f"{field}_shift": tuple(float(axis == k) for k in range(3))})
            rows.append(Tolerance(f"{part}.{name}", "mm", amount, change, held_by))
    for axis, letter in enumerate(AXES):
        if letter in turned:
            change = errors(**{f"{field}_tilt": tuple(radians(1.0) * (axis == k) for k in range(3))})
            rows.append(Tolerance(f"{part}.tilt_{letter}", "degrees", tilt, change, held_by))
    return rows
