"""Checks that failed, in words: what was got, what was wanted, and what may help."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from optics.report.metric_words import number_text

if TYPE_CHECKING:
    from optics.problem import Problem

LIMIT = re.compile(r"(?P<quantity>.+) (?P<side>short of|beyond) limits\.(?P<key>\w+)(?:, )?(?P<where>.*)")
FINER = "lower max_level of the free surface or raise optimizer.roughness_weight"
THICKER = "raise lens.thickness"
FLATTER = "lower z_freedom, or take a target that is smaller or farther away"
REMEDIES = {
    "thickness": THICKER,
    "centre_thickness": THICKER,
    "edge_thickness": THICKER,
    "radius": FINER,
    "concave_radius": FINER,
    "slope": FLATTER,
    "sag_range": FLATTER,
    "feature": "lower max_level or spans of the free surface",
    "mass": "lower lens.thickness, or make the lens smaller",
}


def failure_text(check: dict[str, Any], problem: Problem) -> str:
    """Return "quantity: got ..., wanted ...; remedy" of a failed check.

    check : as in `optics.runtime.verification`; its value at a limit is by how much the lens misses it
    """
    unit = f" {check['unit']}".rstrip()
    found = LIMIT.fullmatch(check["name"])
    if found is None:
        got, wanted = number_text(float(check["value"])), number_text(float(check["limit"]))
        return f"{check['name']}: got {got}{unit}, wanted at most {wanted}{unit}"
    limit, short = getattr(problem.limits, found["key"]), found["side"] == "short of"
    got = number_text(float(limit - check["value"] if short else limit + check["value"]))
    wanted = f"{'at least' if short else 'at most'} {number_text(float(limit))}{unit}"
    where = f" {found['where']}" if found["where"] else ""
    remedy = f"{REMEDIES[found['key']]}, or allow it by limits.{found['key']}"
    return f"{found['quantity']}: got {got}{unit}{where}, wanted {wanted}; {remedy}"
