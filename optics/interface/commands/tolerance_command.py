"""`thbcad tolerance`: what errors of making and mounting do to the light of a design."""

from __future__ import annotations

import sys
from argparse import Namespace
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from optics.base.runtime import Phase, Progress, UserError, note
from optics.designing.progress import drawing
from optics.exchange.results import require_own, run_id, writable_folder, write_recorded
from optics.interface.api import Design, form_tolerances, monte_carlo, require_monte_carlo, tolerances
from optics.interface.commands.outcome import Outcome
from optics.interface.commands.tolerance_amounts import Amounts, amounts_of, limits_of, periods_of
from optics.interface.screens import tolerance_screen
from optics.reporting.report import PageSection, section_page
from optics.tolerancing.form_errors import FORM_HEAD, FormErrors, form_obstacle, form_rows, form_sentences
from optics.tolerancing.monte_carlo_samples import MonteCarlo
from optics.tolerancing.perturbations import HEAD, ToleranceBudget, effect_rows, shop_sentences

RECORD, PAGE = "tolerance.json", "tolerance.html"
PERIODS = "2:20"  # of form errors, mm
SHARES = ("part", "share in the expected rise of rel_l2^2")  # head of a table
WORST = 3  # tolerances whose change of the light is drawn
INTRODUCTION = (
    "What errors of making and mounting do to the light of this design. Every number is of a trace of the "
    "perturbed lens by front and rear, within 1 % of finer traces; 'predicted' is by the derivatives of the "
    "landing points. The design itself is in report.html."
)


@dataclass(frozen=True, eq=False)
class _Study:
    """What is known of the errors of a design.

    form : None where `obstacle` says why not.  made : None where no lenses are to be made.
    """

    design: Design
    budget: ToleranceBudget
    form: FormErrors | None
    obstacle: str
    made: MonteCarlo | None

    def data(self) -> dict[str, Any]:
        data = self.budget.data() | {"run_id": run_id(self.design.problem, self.design.lens)}
        data["form_error"] = {"sentences": self.of_form()} | ({} if self.form is None else self.form.data())
        return data | ({} if self.made is None else {"monte_carlo": self.made.data()})

    def beside_the_report(self) -> list[str]:
        """Return how the light that is traced here differs from that of the report, where it does."""
        metrics, here, sentences = self.design.metrics, f"{self.budget.rel_l2:.2%}", []
        if self.design.problem.optic.array is not None:
            sentences.append(
                "These are tolerances of one lens of the plate over its own source: a plate that turns, or "
                "grows with temperature, also moves its outer lenses away from theirs, which is not traced."
            )
        if metrics["paths"] == "all":
            sentences.append(
                f"Light that is reflected in the lens is left out here: with it the design has rel_l2 = "
                f"{metrics['rel_l2_debiased']:.2%}, by front and rear alone {here}."
            )
        if self.budget.noise:
            sentences.append(
                "Fewer rays are counted here than for the report; without their noise rel_l2 is "
                f"{here} by front and rear, there {metrics['rel_l2_sequential']:.2%}."
            )
        return sentences

    def of_form(self) -> list[str]:
        if self.form is None:
            return [self.obstacle]
        return [
            f"Form errors are judged by rel_l2 alone: each band may raise it from {self.form.rel_l2:.2%} by "
            f"{self.form.rise:.2%}.",
            *form_sentences(self.form),
        ]

    def of_made(self) -> list[str]:
        return [] if self.made is None else self.made.sentences()


def tolerance(options: Namespace) -> Outcome:
    """Trace the lens of a result folder with everything a little wrong, and say what the shop must hold."""
    amounts, limits = amounts_of(options), limits_of(options.limit)
    periods = periods_of(PERIODS if options.periods is None else options.periods)
    design = Design.load(options.result)
    workers, scheduler = options.workers, options.scheduler
    if options.samples:
        require_monte_carlo(design, options.samples, amounts.forms, periods, workers, scheduler)
    elif workers is not None or scheduler is not None:
        raise UserError("--workers and --scheduler go with --samples: single tolerances are traced here")
    elif options.periods is not None:
        raise UserError("--periods goes with --samples: it is of random form errors")
    elif amounts.forms:
        note(f"{', '.join(amounts.forms)}.form: random form errors are for --samples alone")
    folder = Path(options.out or options.result)
    writable_folder(folder)
    require_own(folder, (PAGE, RECORD), RECORD, options.force)
    study = _study(design, amounts, limits, periods, options)

    data = study.data()
    write_recorded(folder, RECORD, data, {PAGE: _page(study).encode()})
    budget, rows = study.budget, [HEAD, *effect_rows(study.budget)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(HEAD))]
    table = ["  ".join(text.ljust(width) for text, width in zip(row, widths)).rstrip() for row in rows]
    lines = [
        *study.beside_the_report(),
        *shop_sentences(study.budget),
        "",
        *table,
        "",
        *study.of_made(),
        *study.of_form(),
    ]
    notes = [*([study.obstacle] if study.obstacle else []), *study.of_made()]
    screen = tolerance_screen(budget, study.form, notes, design.problem.title, folder / PAGE)
    return Outcome(data, [*lines, f"wrote {folder / PAGE} and {folder / RECORD}"], screen=screen)


def _study(
    design: Design,
    amounts: Amounts,
    limits: dict[str, float] | None,
    periods: tuple[float, float],
    options: Namespace,
) -> _Study:
    with _Shown("tolerances") as shown:
        budget = tolerances(design, amounts.tolerances, limits, shown, options.float_shift)
    made = form = None
    if options.samples:
        with _Shown("lenses") as shown:
            made = monte_carlo(
                design,
                budget,
                options.samples,
                amounts.forms,
                periods,
                options.workers,
                options.scheduler,
                lambda done, of: shown.advance(done, of, f"{done} of {of}"),
            )
    obstacle = form_obstacle(design.system) or ""
    if not obstacle:
        try:
            with _Shown("form errors") as shown:
                form = form_tolerances(design, budget.limit, shown)
        except UserError as error:  # the tolerances are known by now, and worth more than none
            obstacle = f"form errors could not be computed: {error}"
    return _Study(design, budget, form, obstacle, made)


def _page(study: _Study) -> str:
    """Return tolerance.html."""
    # matplotlib
    from optics.reporting.figures import change_figure, cost_figure, form_figures_of, monte_carlo_figures_of

    budget, design, made, form = study.budget, study.design, study.made, study.form
    screen, ranked = design.system.target.screen(), budget.by_cost()
    pictures = [("amounts in allowed ones", cost_figure(budget))] if ranked[0].cost else []
    for effect in ranked[:WORST]:
        name = effect.tolerance.name
        pictures.append((f"change of the light by {name}", change_figure(effect, screen)))
    sentences = [*study.beside_the_report(), *shop_sentences(budget)]
    sections = [PageSection("What shop and mount must hold", sentences, pictures=pictures)]
    if made is not None:
        shares = [(name, f"{share:.1%}") for name, share in made.shares().items()]
        of_lenses = study.of_made(), SHARES, shares, monte_carlo_figures_of(made)
        sections.append(PageSection("Lenses with all errors at once", *of_lenses))
    of_form = ((), ()) if form is None else (form_rows(form), [*form_figures_of(form).values()])
    sections += [
        PageSection("Every tolerance by itself, the costliest first", head=HEAD, rows=effect_rows(budget)),
        PageSection("Form errors", study.of_form(), FORM_HEAD, *of_form),
    ]
    return section_page(f"{design.problem.title or 'Lens'}: tolerances", INTRODUCTION, sections)


class _Shown:
    """The progress of one kind of work, drawn on stderr.  work : in a word."""

    def __init__(self, work: str) -> None:
        self._work = work
        self._bar = drawing(sys.stderr)
        self._progress: Progress | None = None

    def __call__(self, name: str, number: int, count: int) -> None:
        """Say that a part of the work begins.  number : of the part, from 0."""
        self.advance(number, count, f"{number + 1} of {count}, {name}")

    def advance(self, done: int, count: int, detail: str) -> None:
        """Say how much of the work is done."""
        if self._progress is None:
            self._progress = Progress([Phase(self._work, 1.0)], self._bar)
        self._progress.advance(done / count, detail)

    def __enter__(self) -> _Shown:
        return self

    def __exit__(self, *error: object) -> None:
        if self._progress is not None and error[0] is None:
            self._progress.finish()
        self._bar.close()
