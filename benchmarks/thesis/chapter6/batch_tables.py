"""Tables of batches and of the ends of runs, for the pages of the pearl and of the extended source."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from benchmarks.thesis.pages import Table
from benchmarks.thesis.records import Found, Numbers, Results

SAME = 1e-6  # relative: losses of two tracers closer than that coincide
Column = tuple[str, str, Callable[[Any], str]]  # head, key, number -> words


def dof(value: float) -> str:
    return f"{value:.0f}"


def three(value: float) -> str:
    return f"{value:.3f}"


def four(value: float) -> str:
    return f"{value:.4f}"


def short(value: float) -> str:
    return f"{value:.3g}"


def alpha(value: float) -> str:
    return "all cells" if value < 0 else f"{value:.2f}"


FIGURES: tuple[Column, ...] = (
    ("rel_l2, box pixels", "rel_l2", four),
    ("efficiency", "efficiency", three),
    ("stray", "stray", four),
    ("roughness", "roughness", three),
)


def batches(caption: str, numbers: Numbers, asked: Sequence[int], columns: Sequence[Column]) -> Table:
    """Return the table of the batches of a run.

    asked : the thesis's degrees of freedom, one per batch; none where it names none.
    """
    rows = []
    for k in range(len(numbers["step"])):
        row = [str(k + 1), dof(numbers["dof"][k]), *([dof(asked[k])] if asked else [])]
        for _, key, word in columns:
            row.append(word(numbers[key][k]) if k < len(numbers[key]) else "-")
        rows.append(row)
    head = ["batch", "DOF", *(["DOF of the thesis"] if asked else []), *(name for name, _, _ in columns)]
    return Table(caption, head, rows)


def ends(caption: str, results: Results, names: Mapping[str, str], columns: Sequence[Column]) -> Table:
    """Return the table of what runs ended with.

    names : of the runs, with their words; runs that were not made are left out.
    """
    rows = []
    for name, words in names.items():
        if name in results:
            found = results[name]
            rows.append([words, *(_word(found, key, word) for _, key, word in columns)])
    return Table(caption, ["run", *(head for head, _, _ in columns)], rows)


def last(found: Found, key: str) -> float:
    """Return a number of a run, of its last batch where it has several."""
    value = found.numbers[key]
    return float(value[-1] if isinstance(value, list) else value)


def evaluations(found: Found) -> int:
    """Return the evaluations of loss and gradient of a run."""
    if "evaluations" in found.numbers:
        return int(found.numbers["evaluations"])
    return int(found.numbers["iterations"] * len(found.numbers["step"]))


def apart(numbers: Numbers) -> list[float | None]:
    """Return the relative differences of the losses by the two tracers; None of lenses that cannot exist."""
    pairs = zip(numbers["step_loss"], numbers["loss_of_check"])
    return [None if own is None else abs(second / own - 1) for second, own in pairs]


def departure(numbers: Numbers) -> float:
    """Return the greatest relative difference of the losses by the two tracers, over the batches."""
    return max((value for value in apart(numbers) if value is not None), default=0.0)


def power(value: float | None) -> str:
    return "no lens" if value is None else f"{value:.0e}"


def yes(value: bool) -> str:
    return "yes" if value else "no"


def percent(value: float) -> str:
    return f"{100 * value:.0f} %"


def _word(found: Found, key: str, word: Callable[[Any], str]) -> str:
    if key == "evaluations":
        return str(evaluations(found))
    return word(last(found, key)) if key in found.numbers else "-"
