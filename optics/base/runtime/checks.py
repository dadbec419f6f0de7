"""Results with limits, as every verification lists them, and the grade that they make together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

Grade = Literal["made", "light misses", "file or part fails", "not decided"]
Result = Literal["passed", "failed", "undecided"]
Subject = Literal["file", "light"]

RESOLVED = 2.0  # standard errors by which a value must differ from its limit, for the comparison to count
MARKS: dict[Result, str] = {"passed": "ok    ", "failed": "FAILED", "undecided": "?     "}


@dataclass(frozen=True)
class Check:
    """One result with its limit.

    value : None where it is not known; the remark says why.
    limit : the most that the value may be; the least where `at_least`.
    error : of the value, as a standard deviation.
    subject : what is judged: the light, or the file with the part and the limits for making it.
    remark : what else is to be said of the result.
    """

    name: str
    value: float | None
    limit: float
    unit: str
    at_least: bool = False
    error: float = 0.0
    subject: Subject = "file"
    remark: str = ""

    @classmethod
    def none_of(cls, name: str, found: int) -> Check:
        """Return the Check of things of which there must be none.  found : how many there are."""
        return cls(name, int(found), 0, "")

    @property
    def result(self) -> Result:
        """Whether the limit is kept; undecided within RESOLVED standard errors of it, or without a value."""
        if self.value is None or (self.error and abs(self.value - self.limit) <= RESOLVED * self.error):
            return "undecided"
        kept = self.value >= self.limit if self.at_least else self.value <= self.limit
        return "passed" if kept else "failed"

    @property
    def ok(self) -> bool:
        return self.result == "passed"

    @property
    def wanted(self) -> str:
        """The limit in words, such as "at most 0.1"."""
        return f"at {'least' if self.at_least else 'most'} {self.limit:g}"

    @property
    def got(self) -> str:
        """The value in words, with its error and its unit."""
        if self.value is None:
            return "not known"
        error = f" +- {self.error:.1g}" if self.error and self.result == "undecided" else ""
        digits = next((n for n in range(3, 17) if float(f"{self.value:.{n}g}") != self.limit), 3)
        shown = f"{self.value:.{3 if self.value == self.limit else digits}g}"
        shown = f"{float(shown):.0f}" if 1e3 <= abs(self.value) < 1e6 else shown
        return f"{shown}{error} {self.unit}".rstrip()


def grade(checks: Iterable[Check]) -> Grade:
    """Return what all checks together say: the worst that one of them says."""
    found = {(check.subject, check.result) for check in checks}
    if ("file", "failed") in found:
        return "file or part fails"
    if ("light", "failed") in found:
        return "light misses"
    return "not decided" if any(result == "undecided" for _, result in found) else "made"


def verification(checks: Sequence[Check]) -> dict[str, Any]:
    """Return the checks as plain data for JSON files, with the grade; `ok` is that of "made"."""
    found = grade(checks)
    rows = [asdict(c) | {"ok": c.ok, "result": c.result} for c in checks]
    return {"ok": found == "made", "grade": found, "checks": rows}


def checks_of(checked: Mapping[str, Any]) -> list[Check]:
    """Return the checks of what `verification` returns."""
    return [Check(**{k: v for k, v in c.items() if k not in ("ok", "result")}) for c in checked["checks"]]


def check_lines(checked: dict[str, Any]) -> list[str]:
    """Return a line for every check of `verification`: passed or not, name, value, limit.

    Lines for notes and for everything that is left out follow.
    """
    lines = []
    for check in checks_of(checked):
        remark = f"; {check.remark}" if check.remark else ""
        lines.append(f"{MARKS[check.result]} {check.name}: {check.got} ({check.wanted}){remark}")
    notes = [f"note: {sentence}" for sentence in checked.get("notes", ())]
    return lines + notes + [f"left out: {sentence}" for sentence in checked.get("left_out", ())]
