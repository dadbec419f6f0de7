"""What the thesis says of fixed nets and step sizes, judged by the runs of study 4."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from benchmarks.thesis.chapter5.fixed_nets_runs import CONTROL_NET, TARGETS, trial_names
from benchmarks.thesis.pages import Claim
from benchmarks.thesis.records import Results

Rows = Mapping[int, Mapping[str, Any]]  # numbers by the net

ALIKE = 0.3  # rel_l2: a top hat that looks right at first glance
INSIDE = 0.02  # of the source's flux: light astray that is hardly seen
DETAIL = 1.5  # times the rel_l2 of net CONTROL_NET: detail is missing
HARDLY = 0.8  # times the rel_l2 of net CONTROL_NET: more than a slight improvement lies below
MUCH = 0.5  # times roughness or light astray of the large step
LONGER = 3.0  # times the iterations

SMOOTHER = "Steps of 1e-4 make the lenses of 50^2 and 75^2 control points much smoother."
DARKER = "Steps of 1e-4 leave significantly less light outside, with 50^2 and 75^2 control points."
UNJUDGED = "cannot be judged"


def claims(results: Results) -> list[Claim]:
    """Return the claims of sections 5.3 and 5.4 with their verdicts."""
    hat, pearl = (rows(results, target, "1e-3") for target in TARGETS)
    small = {target: rows(results, target, "1e-4") for target in TARGETS}
    large = {"top hat": hat, "pearl": pearl}
    return [
        _looks_right(hat),
        _inside(hat),
        _irregular(hat),
        _detail(pearl),
        _grows(pearl),
        _calmer(large, small, "roughness", SMOOTHER, "roughness"),
        _calmer(large, small, "astray", DARKER, "light astray"),
        _rough_patches(large, small),
        _longer(large, small),
        _step_alone(hat, rows(results, "top hat", "L-BFGS"), rows(results, "top hat", "transport")),
    ]


def rows(results: Results, target: str, kind: str) -> Rows:
    """Return the numbers of the runs of a target and a kind, by the net."""
    found = [results[name].numbers for name in trial_names(results, target, kind)]
    return {numbers["net"]: numbers for numbers in found}


def _looks_right(hat: Rows) -> Claim:
    errors = [r["rel_l2"] for r in hat.values()]
    return Claim(
        "With steps of 1e-3 and 250 iterations all nets make a light that looks like the top hat.",
        "5.3.1, figure 5.5",
        f"rel_l2 is {_list(errors)}. It holds if all are below {ALIKE}.",
        max(errors) < ALIKE,
    )


def _inside(hat: Rows) -> Claim:
    few = {n: r for n, r in hat.items() if n < CONTROL_NET}
    return Claim(
        "With steps of 1e-3, 10^2 and 25^2 control points give smooth lenses with all light inside the top "
        "hat.",
        "5.3.1, figure 5.5",
        f"Light astray is {_percent(r['astray'] for r in few.values())}, roughness is "
        f"{_list(r['roughness'] for r in few.values())}. It holds if less than "
        f"{100 * INSIDE:.0f} % of the light is astray.",
        max(r["astray"] for r in few.values()) < INSIDE,
    )


def _irregular(hat: Rows) -> Claim:
    few = [r for n, r in hat.items() if n < CONTROL_NET]
    many = {n: r for n, r in hat.items() if n >= CONTROL_NET}
    worse = [min(r[key] for r in many.values()) > max(r[key] for r in few) for key in ("roughness", "astray")]
    return Claim(
        "With steps of 1e-3, 50^2 control points and more give irregular lenses, which scatter light "
        "outside.",
        "5.3.1, figure 5.5",
        f"Roughness is {_list(r['roughness'] for r in many.values())}, light astray is "
        f"{_percent(r['astray'] for r in many.values())}. It holds if both are "
        "greater than those of 10^2 and 25^2.",
        all(worse),
    )


def _detail(pearl: Rows) -> Claim:
    middle = pearl[CONTROL_NET]["rel_l2"]
    coarse = min(r["rel_l2"] for n, r in pearl.items() if n < CONTROL_NET) > DETAIL * middle
    finest = min(r["rel_l2"] for n, r in pearl.items() if n >= CONTROL_NET)
    return Claim(
        "The pearl needs 50^2 control points; 10^2 and 25^2 are too coarse, and 75^2 and 100^2 hardly "
        "better.",
        "5.3.2, figure 5.6",
        f"rel_l2 is {_list(r['rel_l2'] for r in pearl.values())}. It holds if "
        f"the small nets are above {DETAIL} times that of 50^2, and no net is below {HARDLY} times that.",
        coarse and finest > HARDLY * middle,
    )


def _grows(pearl: Rows) -> Claim:
    grow = all(_rising([r[key] for r in pearl.values()]) for key in ("astray", "roughness"))
    return Claim(
        "For the pearl, light outside and irregularity grow with the number of control points.",
        "5.3.2, figure 5.6",
        f"Light astray is {_percent(r['astray'] for r in pearl.values())}, roughness is "
        f"{_list(r['roughness'] for r in pearl.values())}. It holds if both rise from net to net.",
        grow,
    )


def _calmer(large: Mapping[str, Rows], small: Mapping[str, Rows], key: str, says: str, what: str) -> Claim:
    pairs = [(t, n) for t in small for n in small[t] if n < 100]
    at_end = [small[t][n][key] / large[t][n][key] for t, n in pairs]
    marks = [(small[t][n]["at_mark"], large[t][n]) for t, n in pairs]
    at_mark = [mark[key] / row[key] for mark, row in marks if mark]
    return Claim(
        says,
        "5.4, figure 5.7",
        f"At {_cases(pairs)}, {what} is {_list(at_end)} times that of 1e-3. On the way, where the loss of "
        f"1e-3 is reached, it is {_list(at_mark) or 'not known'} times. It holds if all at the end are "
        f"below {MUCH}.",
        max(at_end) < MUCH,
    )


def _rough_patches(large: Mapping[str, Rows], small: Mapping[str, Rows]) -> Claim:
    says, where = "With 1e-4, 100^2 control points still leave rough patches.", "5.4, figure 5.7"
    if any(100 not in rows for rows in small.values()):
        return Claim(says, where, "The quick set has no net of 100^2.", UNJUDGED)
    times = [rows[100]["roughness"] / rows[CONTROL_NET]["roughness"] for rows in small.values()]
    return Claim(
        says,
        where,
        f"Roughness of 100^2 is {_list(times)} times that of 50^2 ({', '.join(small)}). It holds if it is "
        "more than twice as large.",
        min(times) > 2,
    )


def _longer(large: Mapping[str, Rows], small: Mapping[str, Rows]) -> Claim:
    pairs = [(t, n) for t in small for n in small[t]]
    marks = [(small[t][n]["at_mark"], large[t][n]) for t, n in pairs]
    times = [mark["evaluations"] / row["evaluations"] for mark, row in marks if mark]
    return Claim(
        "Steps of 1e-4 need many more iterations than steps of 1e-3.",
        "5.4, figures 5.8, 5.9",
        f"At {_cases(pairs)}, {len(times)} of {len(pairs)} runs of 1e-4 reached the loss of 1e-3, after "
        f"{_list(times)} times the iterations. It holds if all took more than {LONGER:g} times as many.",
        min(times, default=LONGER + 1) > LONGER,
    )


def _step_alone(hat: Rows, newton: Rows, transport: Rows) -> Claim:
    many = [n for n in newton if n >= CONTROL_NET]
    rough = [newton[n]["astray"] for n in many]
    return Claim(
        "The irregular lenses are likely due to the large step.",
        "5.3.2, 5.6",
        f"L-BFGS chooses its own steps. From the same flat start it leaves {_percent(rough)} of the light "
        f"astray for nets of {_nets(many)}, and roughness {_list(newton[n]['roughness'] for n in many)}; "
        f"Adam left {_percent(hat[n]['astray'] for n in many)} and "
        f"{_list(hat[n]['roughness'] for n in many)}. From the transport start it leaves "
        f"{_percent(transport[n]['astray'] for n in many)} and "
        f"{_list(transport[n]['roughness'] for n in many)}. So start and optimiser count besides the step. "
        f"It holds if L-BFGS from the flat start leaves less than {100 * INSIDE:.0f} % astray.",
        max(rough) < INSIDE,
    )


def _rising(values: Sequence[float]) -> bool:
    return all(a < b for a, b in pairwise(values))


def _nets(nets: Sequence[int] | Rows) -> str:
    return ", ".join(f"{n}^2" for n in nets)


def _cases(pairs: Sequence[tuple[str, int]]) -> str:
    return ", ".join(f"{target} {net}^2" for target, net in pairs)


def _list(values) -> str:
    return ", ".join(f"{value:.2g}" for value in values)


def _percent(values) -> str:
    return ", ".join(f"{100 * value:.1f} %" for value in values)
