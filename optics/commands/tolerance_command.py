"""`thbcad tolerance`: what errors of making and mounting do to the light of a design."""

from __future__ import annotations

import sys
import tomllib
from argparse import Namespace
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from optics.api import Design, form_tolerances, tolerances
from optics.commands.outcome import Outcome
from optics.form_errors import FORM_HEAD, form_obstacle, form_rows, form_sentences
from optics.progress import drawing
from optics.results import HASHES, hashes, require_own, run_id, writable_folder
from optics.runtime import Phase, Progress, UserError
from optics.tolerancing import HEAD, effect_rows, shop_sentences

if TYPE_CHECKING:
    from optics.form_errors import FormErrors
    from optics.tolerancing import ToleranceBudget

RECORD, PAGE = "tolerance.json", "tolerance.html"
WORST = 3  # tolerances whose change of the light is drawn
LARGEST_FILE = 1 << 20  # bytes of a file of amounts
INTRODUCTION = (
    "What errors of making and mounting do to the light of this design. Every number is of an exact trace of "
    "the perturbed lens by front and rear; 'predicted' is a quadratic model through traces that move the "
    "light by a tenth of a pixel. The design itself is in report.html."
)


def tolerance(options: Namespace) -> Outcome:
    """Trace the lens of a result folder with everything a little wrong, and say what the shop must hold."""
    amounts = _of_file(options.tolerances) | dict(map(_amount, options.set))
    design = Design.load(options.result)
    folder = Path(options.out or options.result)
    writable_folder(folder)
    require_own(folder, (PAGE, RECORD), RECORD, options.force)
    with closing(_Shown()) as shown:
        budget = tolerances(design, amounts, options.limit, shown)
    form, sentences = _form(design, options.limit)
    from thbcad.io import json_text, write_text

    data = budget.data() | {"run_id": run_id(design.problem, design.lens)}
    data["form_error"] = {"sentences": sentences} | ({} if form is None else form.data())
    write_text(folder / PAGE, _page(design, budget, form, sentences))
    write_text(folder / RECORD, json_text(data | {HASHES: hashes(folder, (PAGE,))}))
    return Outcome(data, [*_lines(budget), *sentences, f"wrote {folder / PAGE} and {folder / RECORD}"])


def _form(design: Design, limit: float) -> tuple[FormErrors | None, list[str]]:
    """Return what form errors do, None where that is not computed, and what is to be said of it."""
    if obstacle := form_obstacle(design.system):
        return None, [obstacle]
    with closing(_Shown()) as shown:
        form = form_tolerances(design, limit, shown)
    return form, form_sentences(form)


def _page(design: Design, budget: ToleranceBudget, form: FormErrors | None, of_form: Sequence[str]) -> str:
    """Return tolerance.html.  of_form : what is said of form errors."""
    from optics.making_figures import change_figure, form_figures_of, share_figure
    from optics.report import PageSection, section_page

    screen, effects = design.system.target.screen(), {e.tolerance.name: e for e in budget.effects}
    pictures = [("shares in the expected rise of rel_l2^2", share_figure(budget))]
    for name in [*budget.shares()][:WORST]:
        pictures.append((f"change of the light by {name}", change_figure(effects[name], screen)))
    sections = (
        PageSection("What the shop must hold", shop_sentences(budget), pictures=pictures),
        PageSection("Every tolerance by itself", head=HEAD, rows=effect_rows(budget)),
        PageSection(
            "Form errors",
            of_form,
            FORM_HEAD,
            [] if form is None else form_rows(form),
            [] if form is None else [*form_figures_of(form).values()],
        ),
    )
    return section_page(f"{design.problem.title or 'Lens'}: tolerances", INTRODUCTION, sections)


def _lines(budget: ToleranceBudget) -> list[str]:
    rows = [HEAD, *effect_rows(budget)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(HEAD))]
    table = ["  ".join(text.ljust(width) for text, width in zip(row, widths)).rstrip() for row in rows]
    return [*table, "", *shop_sentences(budget)[:2]]


def _amount(text: str) -> tuple[str, Any]:
    """Return name and amount of "NAME=AMOUNT"."""
    name, equals, value = (part.strip() for part in text.partition("="))
    try:
        return name, float(value) if equals else _refuse(text)
    except ValueError:
        return _refuse(text)


def _refuse(text: str) -> Any:
    raise UserError(f"--set takes NAME=AMOUNT with a number, such as lens.decentre=0.02, got {text!r}")


def _of_file(path: str | None) -> dict[str, Any]:
    """Return the amounts of a TOML file by name."""
    if path is None:
        return {}
    file = Path(path)
    try:
        if file.stat().st_size > LARGEST_FILE:
            raise UserError(f"{file} is larger than a file of amounts may be, {LARGEST_FILE} bytes")
        return dict(_flat(tomllib.loads(file.read_text("utf-8"))))
    except OSError as error:
        raise UserError(f"cannot read {file}: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise UserError(f"{file} is no TOML: {error}") from None


def _flat(table: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Return the values of nested tables by dotted name."""
    rows = []
    for key, value in table.items():
        rows += _flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else [(prefix + key, value)]
    return rows


class _Shown:
    """The progress from tolerance to tolerance, drawn on stderr."""

    def __init__(self) -> None:
        self._bar = drawing(sys.stderr)
        self._progress: Progress | None = None

    def __call__(self, name: str, number: int, count: int) -> None:
        names = [f"{k + 1} of {count}" for k in range(count)]
        if self._progress is None:
            self._progress = Progress([Phase(one, 1.0) for one in ("design", *names)], self._bar)
        self._progress.begin(names[number])
        self._progress.advance(0.0, name)

    def close(self) -> None:
        if self._progress is not None:
            self._progress.finish()
        self._bar.close()
