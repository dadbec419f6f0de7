"""The sheet for the shop: the drawing of a lens with its indications, read back."""

from collections.abc import Sequence
from pathlib import Path

from optics.base.runtime import Check
from optics.exchange.export.drawing_checks import drawing_checks
from optics.exchange.export.indications import Indication
from optics.exchange.export.sheet_facts import FACES, TOLERANCES, SheetFacts
from thbcad.drawings import Grid, Panel, Sheet, lens_sheet
from thbcad.lens import Lens

PARTS = {"moulded": "moulded plastic part", "cut": "part that is cut, in the manner of ISO 10110"}
ORIGINS = (
    "computed: by this program. customary: a proposal. open: to be agreed. given: by the user. "
    "Nothing here is said to conform to a standard: standards are named for what entries mean."
)
NO_TOLERANCES = "thbcad tolerance has not run on this result: what it would compute is left open."
WITHOUT_BODY = "Views show the lens without lens.body, whose walls lens.step holds."
ESCAPED = {ord(letter): f"\\{letter}" for letter in "\\()"}  # in texts of PDF


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
