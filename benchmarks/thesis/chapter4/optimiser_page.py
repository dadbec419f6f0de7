"""What the page says of the optimisers of section 4.2."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from benchmarks.thesis.pages import Choice, Claim, Picture, Section, Table
from benchmarks.thesis.records import Numbers, Results

SCAN = "scan "
TENTH = ", a tenth of the step"
FIRST_ORDER = ("constant step", "decaying step", "momentum", "RMSProp", "Adam")

Searches = Mapping[str, Numbers]


def section(results: Results) -> Section:
    """Return the section of study 2."""
    scans = {n.removeprefix(SCAN): f.numbers for n, f in results.items() if n.startswith(SCAN)}
    every = {n: f.numbers for n, f in results.items() if not n.startswith(SCAN)}
    searches = {name: every[label] for name, label in better_steps(every).items()}
    return Section(
        2,
        "Optimisers",
        _text(scans, searches),
        _claims(scans, searches),
        [_search_table(searches)],
        (
            Picture("study2_losses", "Least loss so far by evaluations and by seconds."),
            Picture("study2_steps", "The scan of steps, and the loss of every evaluation at the best step."),
            Picture("study2_irradiance", "Irradiance of every method's best lens, by the optimiser's rays."),
        ),
        _choices(),
    )


def better_steps(runs: Searches) -> dict[str, str]:
    """Return for every method the name of its run with the lower loss, of one or two steps."""
    names = [name for name in runs if not name.startswith(SCAN) and not name.endswith(TENTH)]
    labels = {name: [label for label in (name, name + TENTH) if label in runs] for name in names}
    return {name: min(both, key=lambda label: runs[label]["at_1"]) for name, both in labels.items()}


def _text(scans: Searches, searches: Searches) -> list[str]:
    adam, trials = searches["Adam"], scans["Adam"]["trials"]
    return [
        "The thesis defines its optimisers and compares none. Here all of them work on one lens, "
        "[optimisers.toml](../../examples/thesis/optimisers.toml): a collimated beam, a square top hat, "
        f"and one net of {adam['dof']:.0f} control points, flat at the start.",
        "The light is filtered by a Gaussian, the target is not. The coefficients are bounded by the "
        "arctangent (5.3).",
        f"The step of a method is the best of a scan over decades, {trials} evaluations each. Then every "
        f"method has {adam['evaluations']} evaluations. A short scan favours large steps: a tenth of the "
        "step is run too, and the better run counts. Every trial of a line search counts. Sums on two "
        "threads differ in rounding, so that runs which oscillate differ a little each time.",
        "Three controls are not in the thesis: steps that are kept only where the loss falls "
        "([own_optimiser.py](../../examples/thesis/own_optimiser.py)), L-BFGS in the same variables, and "
        "L-BFGS in this project's variables. Those are weights of B-splines of all levels, scaled by the "
        "diagonal of the Gauss-Newton Hessian, with the squared loss.",
    ]


def _claims(scans: Searches, searches: Searches) -> list[Claim]:
    best = min(FIRST_ORDER, key=lambda name: searches[name]["at_1"])
    return [
        _step_claim(scans["constant step"]),
        _momentum_claim(searches["constant step"], searches["momentum"]),
        Claim(
            "Adaptive steps (RMSProp) serve parameters of very different sensitivity.",
            "4.2",
            f"RMSProp ends at {_loss(searches, 'RMSProp')}, the constant step at "
            f"{_loss(searches, 'constant step')} (holds where RMSProp is lower).",
            searches["RMSProp"]["at_1"] < searches["constant step"]["at_1"],
        ),
        Claim(
            "Adam combines momentum and RMSProp; all designs of the thesis use it.",
            "4.2, 5.1",
            f"Adam ends at {_loss(searches, 'Adam')}, momentum at {_loss(searches, 'momentum')}, RMSProp at "
            f"{_loss(searches, 'RMSProp')} (holds where Adam is lowest). The best of all methods with a "
            f"step is {best}.",
            searches["Adam"]["at_1"] < min(searches[name]["at_1"] for name in ("momentum", "RMSProp")),
        ),
        _line_claim(searches["line search"], searches["constant step"]),
        Claim(
            "With many parameters constant, decaying, momentum-based or adaptive steps are used, for their "
            "simplicity and efficiency.",
            "4.2",
            f"With equal evaluations the best of them, {best}, ends at {_loss(searches, best)}, L-BFGS at "
            f"{_loss(searches, 'L-BFGS')}, and L-BFGS in this project's variables at "
            f"{_loss(searches, 'this project')} (holds where {best} is lowest).",
            searches[best]["at_1"] <= min(found["at_1"] for found in searches.values()),
        ),
    ]


def _step_claim(scan: Numbers) -> Claim:
    k = _best(scan)
    around = [*(scan["losses"][j] for j in (k - 1, k + 1) if 0 <= j < len(scan["losses"]))]
    return Claim(
        "Large steps risk divergence or oscillation; small ones converge slowly.",
        "4.2",
        f"The constant step {scan['steps'][k]:g} reaches {scan['losses'][k]:.3f} in {scan['trials']} "
        f"evaluations. The smallest step, {scan['steps'][0]:g}, reaches {scan['losses'][0]:.3f}, the "
        f"greatest, {scan['steps'][-1]:g}, {scan['losses'][-1]:.3f} (holds where both, and both neighbours, "
        "are worse).",
        len(around) == 2 and min(*around, scan["losses"][0], scan["losses"][-1]) > scan["losses"][k],
    )


def _momentum_claim(plain: Numbers, momentum: Numbers) -> Claim:
    return Claim(
        "Momentum reduces oscillation and accelerates along steady directions.",
        "4.2",
        f"The loss rises in {momentum['rising']:.0%} of the steps with momentum and in "
        f"{plain['rising']:.0%} without. It ends at {momentum['at_1']:.4f} with and at {plain['at_1']:.4f} "
        "without (holds where both are lower with it).",
        momentum["rising"] < plain["rising"] and momentum["at_1"] < plain["at_1"],
    )


def _line_claim(line: Numbers, plain: Numbers) -> Claim:
    per_step = line["evaluations"] / max(line["steps"], 1)
    return Claim(
        "Line searches find good steps, but an iteration needs several evaluations.",
        "4.2",
        f"A step takes {per_step:.1f} evaluations. After {line['steps']} steps the loss is "
        f"{line['at_1']:.3f}; the constant step ends at {plain['at_1']:.3f} after {plain['steps']} (holds "
        "where a step takes more than one evaluation).",
        per_step > 1,
    )


def _search_table(searches: Searches) -> Table:
    rows = [
        (
            name,
            f"{found['step']:g}" if "step" in found else "-",
            *(f"{found[key]:.3f}" for key in ("at_3", "at_1")),
            f"{found['steps']}",
            f"{found['rel_l2']:.3f}",
            f"{found['efficiency']:.3f}",
            f"{found['stray']:.4f}",
            f"{found['roughness']:.4f}",
        )
        for name, found in searches.items()
    ]
    head = ("method", "step", "loss at 1/3", "least loss", "steps taken")
    return Table(
        "Every method with the same number of evaluations: the least loss after a third of "
        "them, and at the end; figures of merit of the best lens on fresh rays and box pixels.",
        (*head, "rel_l2", "efficiency", "stray", "roughness"),
        rows,
    )


def _choices() -> list[Choice]:
    return [
        Choice("the problem (no comparison in the thesis)", "top hat of 60 %, 25 x 25 control points"),
        Choice("R of the base lens", "1000 mm"),
        Choice("z_freedom of Table 5.1", "5 mm"),
        Choice("parameters of the optimisers", "means 0.9 and 0.999; the decaying step ends at a hundredth"),
    ]


def _best(scan: Numbers) -> int:
    losses: Sequence[float] = scan["losses"]
    return losses.index(min(losses))


def _loss(searches: Searches, name: str) -> str:
    return f"{searches[name]['at_1']:.3f}"
