"""An audit as lines for a terminal and as data."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap
from typing import Any

from optics.interface.audit.claims import Judged

WIDTH = 80  # columns
CLAIMED, HERE = 50, 21  # columns of the table
ANSWERS = {True: "yes", False: "no", None: "-"}


def audit_data(rows: Sequence[Judged], seconds: float) -> dict[str, Any]:
    """Return an audit as plain data; `ok` where every claim was tried and holds.

    seconds : of the whole audit.
    """
    return {
        "ok": all(row.found.holds for row in rows),
        "seconds": seconds,
        "claims": [
            {
                "number": number,
                "key": claim.key,
                "claimed": claim.claimed,
                "limit": claim.limit,
                "value": found.value,
                "here": found.here,
                "holds": found.holds,
                "remark": found.remark,
            }
            for number, (claim, found) in enumerate(rows, 1)
        ],
    }


def audit_lines(rows: Sequence[Judged], seconds: float) -> list[str]:
    """Return how many claims hold, the table, and the details of the claims, in at most 80 columns."""
    numbered = list(enumerate(rows, 1))
    details = [
        line for number, row in numbered if row.found.remark for line in _wrapped(number, row.found.remark)
    ]
    return [
        f"{_headline(rows)}{f'{seconds:.0f} s':>{WIDTH - len(_headline(rows))}}",
        "",
        _line("", "claimed", "here", "ok"),
        *(_line(str(k), row.claim.claimed, row.found.here, ANSWERS[row.found.holds]) for k, row in numbered),
        "",
        *details,
    ]


def _headline(rows: Sequence[Judged]) -> str:
    found = [row.found.holds for row in rows]
    untried = f", {found.count(None)} not tried" if None in found else ""
    return f"{found.count(True)} of {len(rows)} claims hold here{untried}"


def _line(number: str, claimed: str, here: str, answer: str) -> str:
    return f"{number:>2}  {claimed:<{CLAIMED}} {here:<{HERE}} {answer}".rstrip()


def _wrapped(number: int, remark: str) -> list[str]:
    return wrap(remark, WIDTH, initial_indent=f"{number:>2}  ", subsequent_indent="    ")
