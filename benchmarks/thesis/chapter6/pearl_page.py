"""What the page says of study 7."""

from __future__ import annotations

from benchmarks.thesis.chapter6.batch_tables import (
    FIGURES,
    alpha,
    batches,
    dof,
    ends,
    evaluations,
    four,
    last,
    percent,
)
from benchmarks.thesis.chapter6.pearl_claims import claims
from benchmarks.thesis.chapter6.pearl_runs import DOF, FALL, FIRST, GAP_COLUMNS, GAP_ROWS, INNER
from benchmarks.thesis.pages import Choice, Picture, Section, Table
from benchmarks.thesis.records import Results

NUMBER, TITLE = 7, "Girl with a Pearl Earring, a collimated beam, by refinement"
METHOD = {
    "thb": "THB refinement",
    "uniform": "uniform refinement",
    "fixed": "finest net from the start, the same steps",
    "fixed, small steps": "finest net from the start, the smallest step throughout",
    "thb, filtered": "THB refinement, target filtered too",
    "fixed, filtered": "finest net from the start, target filtered too",
    "thb, wider bound": "THB refinement, z_freedom 6.5 mm",
    "thb, as printed": "THB refinement, R = 100 mm as printed",
    "ptracer": "Mitsuba's particle tracer, first level only",
}
OWN = {
    "own": "own design, R 150, z_freedom 5",
    "own, wider bound": "own design, R 150, z_freedom 6.5",
    "own, as printed": "own design, R 100, z_freedom 5, as printed",
    "own, level 2 less": "own design, two levels less",
    "own, level 1 less": "own design, a level less",
    "own, alpha 0.3": "own design, alpha 0.3",
    "own, alpha 1": "own design, alpha 1",
    "own, alpha 2": "own design, alpha 2",
}
OWN_MESHES = ("own, alpha 0.3", "own, alpha 1", "own, alpha 2")
EQUAL = 1.05  # ratio of errors that count as equal, as in `thbcad bench refinement`


def section(results: Results) -> Section:
    """Return what the page says."""
    return Section(
        number=NUMBER,
        title=TITLE,
        text=_text(results),
        claims=claims(results),
        tables=_tables(results),
        pictures=_pictures(),
        choices=_choices(results),
    )


def _text(results: Results) -> list[str]:
    run = results["thb"].numbers
    count, pixels, rays = len(run["step"]), run["pixels"], run["rays"]
    text = [
        "A collimated beam lights a lens with a plane front. Its rear is a conic and a spline of degree 3. "
        "The target is the picture, 300 mm behind the lens (Table 6.1 of the thesis).",
        f"The thesis's method is run with the exact tracer: {count} batches of {run['iterations']} Adam "
        f"steps, {rays} x {rays} rays, {pixels} x {pixels} pixels, and a Gaussian window of 1 pixel. "
        "The light E is measured in the window; the target T is not, as in the thesis. After each batch the "
        "cells with large vertex gradients are refined.",
        "The same steps are also run with uniform refinement. The controls start with the finest net at "
        "once, and have the same number of steps. Two more controls filter the target too.",
        "*Roughness* is the rms of the second derivatives of the sag over the whole surface, times the "
        "half-width. *Stray* is the light that leaves the lens and misses the target. rel_l2 compares box "
        "pixels, on fresh rays.",
    ]
    text.append(_own_text(results))
    if "ptracer" in results:
        paths = results["ptracer"].numbers
        text.append(
            f"The thesis's own tools ran for {paths['iterations']} steps only: Mitsuba's mesh, `ptracer`, "
            f"screen and camera. They took {paths['cpu_seconds'] / paths['iterations']:.1f} CPU seconds a "
            f"step. Their loss went from {paths['first_loss'][0]:.3f} to {paths['loss'][0]:.3f}, with the "
            "target filtered too."
        )
    return text


def _own_text(results: Results) -> str:
    """Return what the project's own method says of the share of the degrees of freedom that THB needs."""
    best = results["own, wider bound"]
    error, net = last(best, "rel_l2"), last(best, "net")
    meshes = [results[name] for name in OWN_MESHES] + [best]
    enough = min(last(mesh, "dof") for mesh in meshes if last(mesh, "rel_l2") <= EQUAL * error)
    return (
        "The project's own method starts from a transport map and minimises another loss by L-BFGS. It "
        f"reaches rel_l2 {error:.3f} in {evaluations(best)} evaluations with {last(best, 'dof'):.0f} DOF. "
        f"Within {percent(EQUAL - 1)} of that error its THB meshes need {percent(enough / net)} of the "
        f"{net:.0f} DOF of the uniform net, since the detail of this picture is everywhere on the lens."
    )


def _tables(results: Results) -> list[Table]:
    per_batch = (
        ("loss", "loss", four),
        *(figure for figure in FIGURES if figure[1] in ("rel_l2", "stray", "roughness")),
    )
    tables = [batches("THB refinement, at the end of every batch.", results["thb"].numbers, DOF, per_batch)]
    at_end = (
        ("DOF", "dof", dof),
        ("loss", "loss", four),
        *FIGURES,
    )
    tables.append(ends("All runs by the thesis's method, at their ends.", results, METHOD, at_end))
    own = tuple(column for column in at_end if column[1] in ("dof", "rel_l2", "stray", "roughness"))
    tables.append(ends("Designs by the project's own method, `thbcad design`.", results, OWN, own))
    return tables


def _pictures() -> list[Picture]:
    rows = (
        "Columns: batches. Rows: change of the surface in the batch, surface less its conic, mesh, vertex "
        "gradients, irradiance in the window, and where on the lens light is sent past the target (dark)."
    )
    return [
        Picture("study7_thb", f"THB refinement. {rows}"),
        Picture("study7_uniform", "Uniform refinement, in the same rows and columns."),
        Picture(
            "study7_loss",
            "Loss against iterations, with the STEP file's loss by the second tracer as rings (left); loss "
            "at the ends of batches against degrees of freedom (middle); error in box pixels against "
            "degrees of freedom, with the project's own designs (right).",
        ),
        Picture(
            "study7_controls",
            "Ends of runs on fresh rays and box pixels. Top: irradiance. Middle: irradiance to the power "
            "0.2, which shows faint light. Bottom: surface less its conic.",
        ),
        Picture("study7_lens", "The lens from left, centre and right, before (top) and after (bottom)."),
        Picture("study7_scene", "Source, lens and lit target after THB refinement."),
    ]


def _choices(results: Results) -> list[Choice]:
    alphas = ", ".join(alpha(a) for a in results["thb"].numbers["alpha"])
    return [
        Choice(
            "radius of the rear",
            "150 mm, as the text's slightly smaller beam asks for; the printed 100 mm is run too",
        ),
        Choice("encoding of the picture", "sRGB, decoded to linear light"),
        Choice(
            "steps of Adam (shown in a figure only)",
            f"{FIRST:g} in the first batch, times {FALL:g} in every further one; the best of a short scan. "
            "They are steps of w in z = (2 b / pi) arctan w",
        ),
        Choice(
            "thresholds alpha (shown in a figure only)",
            f"those that come nearest to the DOF of Table 6.2: {alphas}",
        ),
        Choice("which iterate a batch ends with", "the last one; Adam starts anew in every batch"),
        Choice(
            "what counts as the dark gap",
            f"rows {GAP_ROWS[0]:g} to {GAP_ROWS[1]:g} and columns {GAP_COLUMNS[0]:g} to {GAP_COLUMNS[1]:g} "
            f"of the picture; the inner beam is the middle {percent(INNER)} of its width",
        ),
    ]
