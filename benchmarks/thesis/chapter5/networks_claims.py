"""What the thesis says of networks as parametrisation, judged by the runs of study 5."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.thesis.chapter5.networks_runs import MARKS, SHOWN, STEPS, TUNING
from benchmarks.thesis.pages import Claim
from benchmarks.thesis.records import Found, Results

NEAR = 1.5  # times the best loss: converged
FAR = 1.5  # times the loss of US: far higher
FASTER = 0.8  # of the iterations of no network at its best step: significantly faster
CATCHES_UP = (
    "At 1e-4 the dense network catches up with the curves of 1e-3, after about 400 of 1000 iterations."
)
CONVERGES = "At 1e-4 the uniform sparse network reaches the same loss by 1000 iterations."
COMPARED = ("NN", "US", "UD")
WORDS = {"NN": "no network", "US": "uniform sparse", "UD": "uniform dense", "RS": "random sparse"}


def claims(results: Results) -> list[Claim]:
    """Return the claims of section 5.5 with their verdicts."""
    return [
        _random_start(results),
        _large_step(results),
        _middle_step(results, "UD", CATCHES_UP),
        _middle_step(results, "US", CONVERGES),
        _small_step(results),
        _smoother(results),
        _amplifies(results),
        _accelerate(results),
    ]


def with_seeds(results: Mapping[str, Found], kind: str, step: str) -> list[Mapping[str, Any]]:
    """Return the numbers of all seeds of a kind and a step."""
    name = f"{kind} {step}"
    return [found.numbers for key, found in results.items() if key == name or key.startswith(f"{name} seed ")]


def least(results: Results) -> float:
    """Return the least final loss of the thesis's runs."""
    return min(results[f"{k} {s}"].numbers["loss"] for k in COMPARED for s in STEPS)


def reached(results: Results, name: str) -> int | None:
    """Return the first iteration with NEAR times the least loss, None where there is none."""
    mark = int(np.argmax(NEAR * least(results) >= MARKS))
    found: int | None = results[name].numbers["passed"][mark]
    return found


def best_step(results: Results, kind: str, steps: Iterable[str]) -> tuple[str, int | None]:
    """Return the step with the fewest iterations to NEAR times the least loss, and these."""
    times = {s: reached(results, f"{kind} {s}") for s in steps if f"{kind} {s}" in results}
    best = min(times, key=lambda s: np.inf if times[s] is None else times[s])
    return best, times[best]


def _random_start(results: Results) -> Claim:
    means = {k: [_mean(with_seeds(results, k, s), "loss") for s in STEPS] for k in ("RS", "US")}
    ratios = [a / b for a, b in zip(means["RS"], means["US"])]
    return Claim(
        "The sparse network ends far higher from a random start than from a uniform one, at every step.",
        "5.5, figure 5.12",
        f"The final loss is {_list(means['RS'])} from the random start and {_list(means['US'])} from the "
        f"uniform one at steps {_steps()} (mean of seeds). It holds if every ratio is above {FAR}; they are "
        f"{_list(ratios)}.",
        min(ratios) > FAR,
    )


def _large_step(results: Results) -> Claim:
    times = {k: reached(results, f"{k} 1e-3") for k in COMPARED}
    longest = 0.7 * _iterations(results)
    return Claim(
        "At 1e-3 no network, the uniform sparse and the uniform dense one all converge to the same loss, "
        "after about 600 of 1000 iterations.",
        "5.5, figure 5.12",
        f"{NEAR} times the least loss, {NEAR * least(results):.3f}, is reached {_times(times)}. "
        f"It holds if all need at most 70 % of the {_iterations(results)}.",
        all(t is not None and t <= longest for t in times.values()),
    )


def _middle_step(results: Results, kind: str, says: str) -> Claim:
    time = reached(results, f"{kind} {SHOWN}")
    return Claim(
        says,
        "5.5, figure 5.12",
        f"At {SHOWN} it reaches {NEAR * least(results):.3f} {_time(time)}. It holds if it does so within "
        f"{_iterations(results)}.",
        time is not None,
    )


def _small_step(results: Results) -> Claim:
    losses = {k: _mean(with_seeds(results, k, "1e-5"), "loss") for k in COMPARED}
    open_ends = all(loss > NEAR * least(results) for loss in losses.values())
    return Claim(
        "At 1e-5 nothing converges; the dense network is faster than the sparse one, and this than no "
        "network.",
        "5.5, figure 5.12",
        f"The final losses are {_pairs(losses)}. It holds if all are above {NEAR * least(results):.3f} and "
        "in this order.",
        open_ends and losses["UD"] < losses["US"] < losses["NN"],
    )


def _smoother(results: Results) -> Claim:
    rough = {k: _mean(with_seeds(results, k, "1e-3"), "roughness") for k in COMPARED}
    return Claim(
        "Hypothesis: a network gives smoother lenses, since a weight moves several control points.",
        "5.5",
        f"At 1e-3 the roughness is {_pairs(rough)} (mean of seeds). It holds if both networks are below no "
        "network.",
        max(rough["US"], rough["UD"]) < rough["NN"],
    )


def _accelerate(results: Results) -> Claim:
    plain, plain_time = best_step(results, "NN", {**STEPS, **TUNING})
    smooth, smooth_time = best_step(results, "smooth", {**STEPS, **TUNING})
    nets = {k: best_step(results, k, STEPS) for k in ("US", "UD")}
    times = [t for _, t in nets.values() if t is not None]
    return Claim(
        "A network can accelerate the optimisation significantly.",
        "5.5, 5.6",
        f"At the best of its steps ({plain}) no network reaches {NEAR * least(results):.3f} "
        f"{_time(plain_time)}; a fixed smoothing at {smooth} {_time(smooth_time)}; the "
        f"networks {', '.join(f'{_time(t)} ({WORDS[k]}, {s})' for k, (s, t) in nets.items())}. It "
        f"holds if a network needs less than {100 * FASTER:.0f} % of the iterations of no network, each at "
        "its best step.",
        bool(times and min(times) < FASTER * (np.inf if plain_time is None else plain_time)),
    )


def _amplifies(results: Results) -> Claim:
    dense = f"UD {SHOWN}"
    alike = min((f"NN {s}" for s in {**STEPS, **TUNING}), key=lambda name: _apart(results, name, dense))
    moves = [1e3 * results[name].numbers["usual_move"] for name in (dense, alike, f"NN {SHOWN}")]
    losses = [results[name].numbers["loss"] for name in (dense, alike)]
    return Claim(
        "A network makes Adam converge faster at small steps.",
        "5.5, figure 5.12",
        f"At {SHOWN} the dense network moves a height by {moves[0]:.2g} um in an iteration, no network by "
        f"{moves[2]:.2g} um. No network at {alike.removeprefix('NN ')} moves it by {moves[1]:.2g} um. With "
        f"about equal moves the dense network ends at {losses[0]:.3f}, no network at {losses[1]:.3f}. It "
        f"holds beyond a larger step if the dense network's loss is below {100 * FASTER:.0f} % of the other.",
        losses[0] < FASTER * losses[1],
    )


def _apart(results: Results, name: str, other: str) -> float:
    """Return how far the moves of two runs are apart, as the logarithm of their ratio."""
    first, second = (results[n].numbers["usual_move"] for n in (name, other))
    return float(abs(np.log(first / second)))


def _iterations(results: Results) -> int:
    return results["NN 1e-3"].numbers["evaluations"] - 1


def _mean(rows: Sequence[Mapping[str, Any]], key: str) -> float:
    return float(np.mean([row[key] for row in rows]))


def _steps() -> str:
    return ", ".join(STEPS)


def _list(values: Iterable[float]) -> str:
    return ", ".join(f"{value:.3g}" for value in values)


def _pairs(values: Mapping[str, float]) -> str:
    return ", ".join(f"{value:.3g} ({WORDS[kind]})" for kind, value in values.items())


def _time(value: int | None) -> str:
    return "never" if value is None else f"after {value} iterations"


def _times(values: Mapping[str, int | None]) -> str:
    return ", ".join(f"{_time(value)} ({WORDS[kind]})" for kind, value in values.items())
