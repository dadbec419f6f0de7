"""The claims of the thesis on the pearl, judged by the numbers of the runs."""

from __future__ import annotations

from benchmarks.thesis.chapter6.batch_tables import SAME, departure, last, percent
from benchmarks.thesis.chapter6.pearl_runs import INNER
from benchmarks.thesis.pages import Claim
from benchmarks.thesis.records import Found, Numbers, Results

WATTS = 0.92  # in the final distribution, section 6.3.1
CLOSE = 0.01  # W: two decimals are given
PASSED = (1 - (0.5 / 2.5) ** 2) ** 2  # W, through two faces of index 1.5 at normal incidence
COMPARABLE = 1.1  # ratio of losses
HARDLY = 0.2  # of the fall of the loss behind the first batch
ALIKE = 0.1  # relative L2 difference of two pictures
SHARE = 0.23  # of the uniform degrees of freedom
UNCHANGED = 0.2  # 1 - cosine of two maps of vertex gradients
MISPRINT, SPAN = 156.0, 2 * 50e3 / (7 * 2**5)  # micrometres: the finest span as printed, and as it is


def claims(results: Results) -> list[Claim]:
    """Return the claims in the order of the thesis."""
    return [
        _well_behaved(results),
        _first_refinements(results["thb"].numbers),
        _gradients(results["thb"].numbers),
        _gap(results["thb"].numbers),
        _comparable(results),
        _alike(results),
        _second_tracer(results),
        _flux(results),
        _span(),
    ]


def _well_behaved(results: Results) -> Claim:
    names = ("uniform", "thb", "fixed", "fixed, small steps")
    rough = [last(results[n], "roughness") for n in names]
    stray = [_missing(results[n]) for n in names]
    return Claim(
        "Gradual refinement gives well-behaved lenses: smooth, and without stray light.",
        "6.3, conclusions of chapters 5 and 6",
        f"Roughness {rough[0]:.1f} by uniform and {rough[1]:.1f} by THB refinement, against {rough[2]:.1f} "
        f"of the finest net from the start with the same steps, and {rough[3]:.1f} with the smallest step "
        f"throughout. Of the light that leaves the lens, {percent(stray[0])} and {percent(stray[1])} "
        f"miss the target, against {percent(stray[2])} and {percent(stray[3])}. It holds if both refinements "
        "have less of both than both nets.",
        max(rough[:2]) < min(rough[2:]) and max(stray[:2]) < min(stray[2:]),
    )


def _missing(found: Found) -> float:
    """Return the share of stray light in the light that leaves the lens; wild lenses keep light inside."""
    stray = last(found, "stray")
    return stray / (stray + last(found, "efficiency"))


def _first_refinements(thb: Numbers) -> Claim:
    loss = thb["loss"]
    share = (loss[0] - loss[2]) / (loss[0] - loss[-1])
    return Claim(
        "The first two refinements hardly lower the loss.",
        "6.3.1, Fig. 6.2",
        f"Loss {', '.join(f'{x:.3f}' for x in loss)}. The first two refinements bring {percent(share)} of "
        f"what all of them bring. It holds if that is less than {percent(HARDLY)}.",
        share < HARDLY,
    )


def _gradients(thb: Numbers) -> Claim:
    change = thb["change_of_gradients"]
    words = ", ".join(f"{x:.2f}" for x in change[1:])
    return Claim(
        "Vertex gradients stay mostly unchanged until the third refinement.",
        "6.3.1, Fig. 6.2 (a5-c5)",
        f"1 - cosine between the maps of |dL/dz| of two successive batches: {words}. It holds if the first "
        f"two are below {UNCHANGED:g} and the third is larger than both.",
        max(change[1:3]) < min(UNCHANGED, change[3]),
    )


def _gap(thb: Numbers) -> Claim:
    missed = thb["missed_inside"]
    return Claim(
        "The dark gap between chin and dress is emptied by light thrown off the target, and the part of the "
        "lens that does so shrinks from batch to batch.",
        "6.3.1, Fig. 6.2 (a4-e4)",
        f"The middle {percent(INNER)} of the beam's width send at most {max(missed):.3f} W past the target "
        f"at the end of any batch. The gap has {thb['gap'][0]:.2f} times the light it should have after the "
        f"first batch, and {thb['gap'][-1]:.2f} times at the end. It holds if light from the middle is "
        "thrown off, and less at the end than after the first batch.",
        0 < missed[-1] < missed[0],
    )


def _comparable(results: Results) -> Claim:
    thb, uniform = results["thb"].numbers, results["uniform"].numbers
    ratio, share = thb["loss"][-1] / uniform["loss"][-1], thb["dof"][-1] / uniform["dof"][-1]
    return Claim(
        "THB and uniform refinement end at comparable losses; THB has 23 % of the degrees of freedom.",
        "6.3.1, Table 6.2, Fig. 6.4",
        f"THB ends at {thb['loss'][-1]:.4f} with {thb['dof'][-1]:.0f} DOF ({percent(share)}), uniform at "
        f"{uniform['loss'][-1]:.4f} with {uniform['dof'][-1]:.0f}: {ratio:.2f} times the loss. It "
        f"holds if the losses differ by less than {percent(COMPARABLE - 1)}.",
        ratio < COMPARABLE,
    )


def _alike(results: Results) -> Claim:
    uniform = results["uniform"].numbers
    apart = uniform["apart_from_thb"]
    return Claim(
        "Surface and irradiance by THB and by uniform refinement show no significant differences.",
        "6.3.1, Fig. 6.2, 6.3",
        f"The two irradiances are {percent(apart)} apart (relative L2, in the window). It holds if they are "
        f"less than {percent(ALIKE)} apart.",
        apart < ALIKE,
    )


def _second_tracer(results: Results) -> Claim:
    most = max(departure(results[name].numbers) for name in ("thb", "uniform"))
    return Claim(
        "A second tracer's loss follows for three batches and then departs, blamed on the transfer.",
        "6.3.1, Fig. 6.2 (b1), 6.3 (b1)",
        f"At equal rays the STEP files of all batches have the same loss in the second tracer, to {most:.0e} "
        f"relative. An exact transfer leaves nothing to depart. It holds above {SAME:.0e}.",
        most > SAME,
    )


def _flux(results: Results) -> Claim:
    names = ("thb", "uniform", "own, wider bound")
    thb, uniform, own = (last(results[name], "efficiency") for name in names)
    return Claim(
        "0.92 W of 1 W end up in the final distribution.",
        "6.3.1",
        f"{thb:.3f} W by THB, {uniform:.3f} W by uniform refinement; the project's own method brings "
        f"{own:.3f} W. Two faces at normal incidence pass {PASSED:.3f} W. It holds "
        f"if THB is within {CLOSE:g} W.",
        abs(thb - WATTS) <= CLOSE,
    )


def _span() -> Claim:
    return Claim(
        f"The finest knot span is {MISPRINT:.0f} um wide, and a change of the lens {3 * MISPRINT:.0f} um.",
        "6.3.1",
        f"Seven spans of level 0 over 100 mm, halved five times, are {SPAN:.0f} um wide. A cubic function "
        f"spans four of them, {4 * SPAN / 1000:.2f} mm.",
        abs(SPAN / MISPRINT - 1) < COMPARABLE - 1,
    )
