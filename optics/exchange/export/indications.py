"""The indications of a sheet: what is computed, what is customary, what is left open, and what is given."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import Literal, TypeAlias

from optics.base.runtime import UserError
from optics.exchange.export.sheet_facts import FACES, SheetFacts
from thbcad.moulds import MouldedBody

Origin = Literal["computed", "customary", "open", "given"]
Value: TypeAlias = Callable[[SheetFacts, str], str | None]  # of a face
AGREED = "to be agreed"
LONGEST = 120  # characters of a value
DATUMS = "A the plane z = 0, B the axis, C the plane y = 0"
RIM = 1e-9  # of the gauge: a point on the rim lies outside
GRADES = ((10.0, "3x0.16"), (30.0, "5x0.25"), (100.0, "5x0.4"), (inf, "5x0.63"))  # up to a width, mm


@dataclass(frozen=True)
class Indication:
    """An entry of a sheet.

    origin : "computed" by this program, "customary" as a proposal, "open" to be agreed, "given" by the user.
    sentence : what the value says.
    """

    name: str
    value: str
    origin: Origin
    sentence: str


@dataclass(frozen=True)
class _Entry:
    """A row of the table.

    name : one that ends in * stands for front and rear.  manner : "" for both
    computed : None, or a value of None, is not known: customary stands there, without it the entry is open
    fixed : what is computed is a fact of the file.  asked : the entry stands only where it is given
    """

    name: str
    sentence: str
    computed: Value = lambda facts, face: None
    customary: Value = lambda facts, face: None
    manner: str = ""
    fixed: bool = False
    asked: bool = False

    def value(self, facts: SheetFacts) -> tuple[str, Origin]:
        face = "rear" if self.name.endswith("rear") else "front"
        if (found := self.computed(facts, face)) is not None:
            return found, "computed"
        proposed = self.customary(facts, face)
        return (AGREED, "open") if proposed is None else (proposed, "customary")


def _unit(value: object, form: str) -> str | None:
    return None if value is None else form.format(value)


def _as(value: str) -> Value:
    return lambda facts, face: value


def _profile(form: str) -> Value:
    return lambda facts, face: _unit(facts.profile(face), form)


def _roughness(facts: SheetFacts, face: str) -> str | None:
    slope = getattr(facts.system.problem.optic, face).slope_rms
    return f"rms slope {slope:g} rad at most" if slope else None


def _coating(facts: SheetFacts, face: str) -> str:
    share = getattr(facts.system.problem.optic, face).reflectance
    return "none" if share is None else f"reflects {share:.3g} of the light"


def _grade(facts: SheetFacts, face: str) -> str:
    size = 2 * max(facts.lens.front.half_width + facts.lens.rear.half_width)
    return next(grade for most, grade in GRADES if size <= most)


def _centring(facts: SheetFacts, face: str) -> str | None:
    tilt = facts.amount("front.tilt_x", "front.tilt_y", factor=60.0)
    shift = facts.amount("front.decentre_x", "front.decentre_y")
    return _unit(tilt, "{}'" + (f" ({shift} mm)" if shift else ""))


def _parting(facts: SheetFacts, face: str) -> str | None:
    solid = facts.system.solid(facts.lens)
    return f"z = {solid.parting:.4f} mm" if isinstance(solid, MouldedBody) else None


def _of_body(key: str, form: str) -> Value:
    """Return the value of a number of lens.body; none where it is 0, or there is no body."""
    return lambda facts, face: _unit(getattr(facts.system.body, key, None) or None, form)


AMOUNT = "the amount of tolerance.json, or what is allowed where less"
ZONE = "width of a zone over the clear aperture; shorter periods are held by slope"
SLOPE = "rms by bands of period, each band by itself"
TEXTURE = "where computed, as the light was traced"
POINTS = "X,Y in mm, several apart by semicolons; outside the clear aperture"
WALLS = "where computed, as lens.step has it"
COORDINATES = "z along the axis with the light, front from z = 0, rear from z = {:g} mm"
TABLE = (
    _Entry("material", "of the design", lambda f, _: f.system.product.material, fixed=True),
    _Entry("grade", "of the material, and its maker", manner="moulded"),
    _Entry("index", f"tolerance of the index: {AMOUNT}", lambda f, _: _unit(f.amount("index"), "+- {}")),
    _Entry(
        "thickness", f"tolerance on the axis: {AMOUNT}", lambda f, _: _unit(f.amount("thickness"), "+- {} mm")
    ),
    _Entry("clear_aperture.*", "round the axis", lambda f, face: f.clear(face).text(), fixed=True),
    _Entry(
        "profile.*",
        f"profile of a surface, as in ISO 1101 and 1660: {ZONE}",
        _profile("{}"),
        manner="moulded",
    ),
    _Entry("3/*", f"form -(B), as in ISO 10110-5: {ZONE}", _profile("-({})"), manner="cut"),
    _Entry("slope.*", SLOPE, lambda f, face: f.slopes(face)),
    _Entry(
        "centring", f"tilt (decentre) of the front against the rear: {AMOUNT}", _centring, manner="moulded"
    ),
    _Entry(
        "4/",
        f"as in ISO 10110-6: tilt (decentre) of the front against the rear: {AMOUNT}",
        _centring,
        manner="cut",
    ),
    _Entry("0/", "birefringence, nm/cm, as in ISO 10110-18", customary=_as("20"), manner="cut"),
    _Entry("1/", "bubbles and inclusions, as in ISO 10110-18", customary=_grade, manner="cut"),
    _Entry("2/", "homogeneity and striae, as in ISO 10110-18", manner="cut"),
    _Entry("5/*", "imperfections, as in ISO 10110-7", customary=_grade, manner="cut"),
    _Entry("6/*", "laser damage threshold", manner="cut", asked=True),
    _Entry("texture.*", f"as in ISO 10110-8; {TEXTURE}", _roughness, _as("P3"), "cut"),
    _Entry("coating.*", "as in ISO 10110-9, and as the light was traced", _coating, manner="cut"),
    _Entry("finish.*", TEXTURE, _roughness, _as("polished insert, Ra 10 nm at most"), "moulded"),
    _Entry("draft", WALLS, _of_body("draft", "{:g} degrees"), manner="moulded", fixed=True),
    _Entry("radii", WALLS, _of_body("edge_radius", "R {:g} mm"), _as("R 0.2 mm at most"), "moulded", True),
    _Entry("parting_line", f"outside the clear aperture; {WALLS}", _parting, manner="moulded", fixed=True),
    _Entry("gate", POINTS, manner="moulded"),
    _Entry("ejectors", POINTS, manner="moulded"),
    _Entry(
        "tolerance_class",
        "of plastic, for other sizes, as in ISO 20457",
        customary=_as("TG4"),
        manner="moulded",
    ),
    _Entry("shrinkage", "sizes are those of the part", _as("not applied"), manner="moulded", fixed=True),
    _Entry(
        "coordinates", "x, y, z of lens.step", lambda f, _: COORDINATES.format(f.lens.thickness), fixed=True
    ),
    _Entry("datums", "of the general surfaces, as in ISO 10110-19", customary=_as(DATUMS), manner="cut"),
    _Entry(
        "test_points", "sag from the vertices of the base surfaces", _as("5 x 5 on each surface"), fixed=True
    ),
    _Entry("step", "file that holds the exact shape", _as("lens.step"), fixed=True),
    _Entry("sha256", "of that file", lambda f, _: f.sha256, fixed=True),
)


def indications_of(facts: SheetFacts, manner: str, given: Mapping[str, str]) -> list[Indication]:
    """Return the indications of a manner; what is given stands in the place of what is proposed.

    Raises UserError : what is given has an unknown name or one of the other manner, contradicts lens.step, is
        no line of text, or puts gate or ejectors where they may not stand.
    """
    entries = {entry.name: entry for entry in _entries() if entry.manner in ("", manner)}
    for name, value in given.items():
        try:
            _require_settable(name, value, entries, facts)
        except ValueError as error:
            raise UserError(f"--set-indication {name}: {error}") from None
    found = []
    for name, entry in entries.items():
        if name in given:
            found.append(Indication(name, given[name], "given", entry.sentence))
        elif not entry.asked:
            found.append(Indication(name, *entry.value(facts), entry.sentence))
    return found


def _entries() -> list[_Entry]:
    """Return the rows of the table, those of front and rear one by one."""
    return [
        replace(entry, name=entry.name.replace("*", face))
        for entry in TABLE
        for face in (FACES if entry.name.endswith("*") else ("",))
    ]


def _require_settable(name: str, value: str, entries: Mapping[str, _Entry], facts: SheetFacts) -> None:
    """Raise ValueError where an indication cannot be given, or not with this value."""
    if name not in entries:
        if any(name == entry.name for entry in _entries()):
            raise ValueError("it belongs to the other manner; change --manner, or leave it out")
        raise ValueError(f"there is no such indication; choose from {', '.join(entries)}")
    now, origin = entries[name].value(facts)
    if entries[name].fixed and origin == "computed":
        raise ValueError(
            f"lens.step says {now!r}, which the sheet repeats; change the problem and design again"
        )
    if not value.strip() or not value.isprintable() or len(value) > LONGEST:
        raise ValueError(f"it must have a value of one line, up to {LONGEST} characters, got {value!r}")
    for point in value.split(";") if name in ("gate", "ejectors") else ():
        try:
            x, y = map(float, point.split(","))
        except ValueError:
            raise ValueError(f"it must be {POINTS}, got {point.strip()!r}") from None
        for face in FACES:
            if not facts.clear(face).gauge(x, y) >= 1 - RIM:
                raise ValueError(
                    f"the point {point.strip()} lies in the clear aperture of the {face}; move it out"
                )
