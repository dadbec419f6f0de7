"""The indications of a sheet: what is computed, what is customary, what is left open, and what is given;
and the sheet with them, read back."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path

from optics.base.runtime import Check, UserError
from optics.exchange.export.drawing_checks import drawing_checks
from optics.exchange.export.sheet_facts import FACES, TOLERANCES, Origin, SheetFacts
from thbcad.drawings import Grid, Panel, Sheet, lens_sheet
from thbcad.lens import Lens

AGREED = "to be agreed"
LONGEST = 120  # characters of a value
RIM = 1e-9  # of the gauge: a point on the rim lies outside
GRADES = ((10.0, "3x0.16"), (30.0, "5x0.25"), (100.0, "5x0.4"), (inf, "5x0.63"))  # up to a width, mm
PARTS = {"moulded": "moulded plastic part", "cut": "part that is cut, in the manner of ISO 10110"}
ORIGINS = (
    "computed: by this program. customary: a proposal, or an amount that thbcad tolerance was given. "
    "open: to be agreed. given: by the user. Nothing here is said to conform to a standard: standards are "
    "named for what entries mean."
)
NO_TOLERANCES = "thbcad tolerance has not run on this result: what it would compute is left open."
WITHOUT_BODY = "Views show the lens without lens.body, whose walls lens.step holds."
ESCAPED = {ord(letter): f"\\{letter}" for letter in "\\()"}  # in texts of PDF


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

    name : one that ends in * stands for front and rear
    computed : a text, or one with another origin; where it is None, what is customary stands there; without
        that the entry is open
    fixed : what is computed is a fact of the result.  asked : the entry stands only where it is given
    """

    name: str
    sentence: str
    computed: Callable[[SheetFacts, str], str | tuple[str, Origin] | None] = lambda facts, face: None
    customary: str = ""
    fixed: bool = False
    asked: bool = False

    def value(self, facts: SheetFacts) -> tuple[str, Origin]:
        found = self.computed(facts, "rear" if self.name.endswith("rear") else "front")
        if found is not None:
            return (found, "computed") if isinstance(found, str) else found
        size = 2 * max(facts.lens.front.half_width + facts.lens.rear.half_width)
        grade = next(grade for most, grade in GRADES if size <= most)
        return (self.customary.format(grade=grade), "customary") if self.customary else (AGREED, "open")


def _in(form: str, value: object) -> str | None:
    """Return a value in a form, None where it is None or 0."""
    return form.format(value) if value else None


def _toleranced(nominal: str, unit: str, amount: tuple[str, Origin] | None) -> tuple[str, Origin]:
    """Return a size with its tolerance."""
    return (f"{nominal} +- {amount[0]}{unit}", amount[1]) if amount else (f"{nominal}, {TOLERANCE}", "open")


def _index(facts: SheetFacts, face: str) -> tuple[str, Origin]:
    problem = facts.system.problem
    nominal = f"n = {problem.optic.known_index:.7g} at {problem.source.wavelength:g} nm"
    return _toleranced(nominal, "", facts.amount("index"))


def _thickness(facts: SheetFacts, face: str) -> tuple[str, Origin]:
    return _toleranced(f"{facts.axis_thickness:.6g} mm", " mm", facts.amount("thickness"))


def _texture(facts: SheetFacts, face: str) -> str | None:
    return _in("rms slope {:g} rad at most", getattr(facts.system.problem.optic, face).slope_rms)


def _finish(facts: SheetFacts, face: str) -> str | None:
    """Return the texture, or how smooth an insert must be for the shortest periods that the light feels."""
    if (texture := _texture(facts, face)) or (finest := facts.finest(face)) is None:
        return texture
    allowed, (low, high) = finest
    return (
        f"polished insert, Rq {allowed:g} nm at most, periods {low:g} to {high:g} mm"
        if allowed < RQ_OVER_RA * POLISHED
        else None
    )


def _coating(facts: SheetFacts, face: str) -> str:
    share = getattr(facts.system.problem.optic, face).reflectance
    return "none" if share is None else f"reflects {share:.3g} of the light"


def _centring(facts: SheetFacts, face: str) -> tuple[str, Origin] | None:
    tilt = facts.amount("front.tilt_x", "front.tilt_y", factor=60.0)
    shift = facts.amount("front.decentre_x", "front.decentre_y")
    if tilt is None:
        return None
    origin: Origin = "computed" if "computed" in (tilt[1], shift and shift[1]) else "customary"
    return f"{tilt[0]}'" + (f" ({shift[0]} mm)" if shift else ""), origin


TOLERANCE = f"tolerance {AGREED}"
POLISHED = 10  # nm, Ra that is usual of polished inserts
RQ_OVER_RA = 1.25  # of heights that are normally distributed
AMOUNT = "the amount of tolerance.json, or what is allowed where less"
TILT = f"tilt (decentre) of the front against the rear: {AMOUNT}"
ZONE = "width of a zone over the clear aperture; shorter periods are held by slope"
SLOPE = "rms by bands of period, each band by itself"
TEXTURE = "where computed, as the light was traced"
FINISH = f"{TEXTURE}, or as a band of the form errors allows"
POINTS = "X,Y in mm, several apart by semicolons; outside the clear aperture"
WALLS = "where computed, as lens.step has it"
SHARP = "R 0.2 mm at most"
AXES = "z along the axis with the light, front from z = 0, rear from z = {:g} mm"
DATUMS = "A the plane z = 0, B the axis, C the plane y = 0"
LENS = (
    _Entry("material", "of the design", lambda f, _: f.system.product.material, fixed=True),
    _Entry("index", f"its tolerance: {AMOUNT}", _index),
    _Entry("thickness", f"on the axis; its tolerance: {AMOUNT}", _thickness),
    _Entry("clear_aperture.*", "round the axis", lambda f, face: f.clear(face).text(), fixed=True),
    _Entry("slope.*", SLOPE, lambda f, face: f.slopes(face)),
)
FILE = (
    _Entry("coordinates", "of lens.step", lambda f, _: AXES.format(f.lens.thickness), fixed=True),
    _Entry("test_points", "sag from the base vertices", lambda f, _: "5 x 5 on each surface", fixed=True),
    _Entry("step", "file that holds the exact shape", lambda f, _: "lens.step", fixed=True),
    _Entry("sha256", "of lens.step", lambda f, _: f.sha256, fixed=True),
)
MOULDED = (
    _Entry("profile.*", f"of a surface, as in ISO 1101 and 1660: {ZONE}", lambda f, face: f.profile(face)),
    _Entry("centring", TILT, _centring),
    _Entry("draft", WALLS, lambda f, _: _in("{:g} degrees", f.body and f.body.draft), fixed=True),
    _Entry("radii", WALLS, lambda f, _: _in("R {:g} mm", f.body and f.body.edge_radius), SHARP, True),
    _Entry("parting_line", f"outside the clear aperture; {WALLS}", lambda f, _: f.parting, fixed=True),
    _Entry("gate", POINTS),
    _Entry("ejectors", POINTS),
    _Entry("finish.*", FINISH, _finish, f"polished insert, Ra {POLISHED} nm at most"),
    _Entry("tolerance_class", "of plastic, for other sizes, as in ISO 20457", customary="TG4"),
    _Entry("grade", "of the material, and its maker"),
    _Entry("shrinkage", "sizes are those of the part", lambda f, _: "not applied", fixed=True),
)
CUT = (
    _Entry("0/", "birefringence, nm/cm, as in ISO 10110-18", customary="20"),
    _Entry("1/", "bubbles and inclusions, as in ISO 10110-18", customary="{grade}"),
    _Entry("2/", "homogeneity and striae, as in ISO 10110-18"),
    _Entry("3/*", f"form -(B), as in ISO 10110-5: {ZONE}", lambda f, face: _in("-({})", f.profile(face))),
    _Entry("4/", f"as in ISO 10110-6: {TILT}", _centring),
    _Entry("5/*", "imperfections, as in ISO 10110-7", customary="{grade}"),
    _Entry("6/*", "laser damage threshold", asked=True),
    _Entry("texture.*", f"as in ISO 10110-8; {TEXTURE}", _texture, "P3"),
    _Entry("coating.*", "as in ISO 10110-9, and as the light was traced", _coating),
    _Entry("datums", "of the general surfaces, as in ISO 10110-19", customary=DATUMS),
)
TABLES = {
    manner: {
        name: replace(entry, name=name)
        for entry in (*LENS, *own, *FILE)
        for name in (entry.name.replace("*", face) for face in FACES)
    }
    for manner, own in (("moulded", MOULDED), ("cut", CUT))
}


def indications_of(facts: SheetFacts, manner: str, given: Mapping[str, str]) -> list[Indication]:
    """Return the indications of a manner; what is given stands in the place of what is proposed.

    Raises UserError : what is given has an unknown name or one of the other manner, contradicts lens.step, is
        no line of text, or puts gate or ejectors where they may not stand.
    """
    entries = TABLES[manner]
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
            value, origin = entry.value(facts)
            found.append(Indication(name, value, origin, entry.sentence))
    return found


def _require_settable(name: str, value: str, entries: Mapping[str, _Entry], facts: SheetFacts) -> None:
    """Raise ValueError where an indication cannot be given, or not with this value."""
    if name not in entries:
        if any(name in table for table in TABLES.values()):
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


def sheet_of(facts: SheetFacts, indications: Sequence[Indication], manner: str, chord: float) -> Sheet:
    """Return the sheet of a result; chord : mm, the error that curves of its views may have.

    Raises ValueError : as `lens_sheet`.
    """
    rows = [(one.name, f"{one.value}  [{one.sentence}]", one.origin) for one in indications]
    front, rear = (Grid(f"sag of the {face}, mm", *facts.test_points(face)) for face in FACES)
    panel = Panel(
        heading=f"Indications: {PARTS[manner]}",
        rows=tuple(rows),
        grids=(front, rear),
        foot=tuple(notes_of(facts)),
        clear=(facts.clear("front"), facts.clear("rear")),
    )
    return lens_sheet(facts.lens, facts.system.product, chord, panel=panel)


def notes_of(facts: SheetFacts) -> list[str]:
    """Return what is to be said of all indications."""
    form = (facts.tolerance or {}).get("form_error", {})
    if facts.tolerance is None:
        said = NO_TOLERANCES
    elif "sides" in form:
        said = (
            f"Form errors are those of {TOLERANCES}: each band by itself raises rel_l2 from "
            f"{form['rel_l2']:.2%} by {form['rise']:.2%}."
        )
    else:
        said = f"{TOLERANCES} holds no form errors: {' '.join(form.get('sentences', ()))}"
    return [said, *([WITHOUT_BODY] if facts.system.body else []), ORIGINS]


def sheet_checks(lens: Lens, sheet: Sheet, path: Path, name: str) -> list[Check]:
    """Return the Checks of a sheet that was written: as `drawing_checks`; of a PDF its texts alone."""
    if name != "pdf":
        return drawing_checks(lens, sheet, path, name)
    data = path.read_bytes()
    texts = (label.text.translate(ESCAPED).encode("cp1252", "replace") for label in sheet.labels)
    return [Check.none_of("texts missing in the PDF file", sum(b"(%b)" % text not in data for text in texts))]
