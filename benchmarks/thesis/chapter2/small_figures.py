"""Study 9: Fresnel's curves, one pixel by two filters, and the greatest efficiency of lenses (chapter 2)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from benchmarks.thesis.chapter2 import small_pictures
from benchmarks.thesis.pages import Choice, Claim, Picture, Section, Table
from benchmarks.thesis.records import Found, Results, Run
from examples.thesis.small_figures import (
    CUT,
    PIXELS,
    POSITIONS,
    RAYS,
    SEED,
    SIGMA,
    box,
    gaussian,
    plates,
    weights,
)
from optics.base.runtime import load_backend
from optics.light.tracing import (
    TargetArea,
    critical_angle,
    normal_incidence_transmittance,
    trace_nonsequential,
    traced_transmittance,
    transmittances,
)
from optics.scene.receivers import receiver_at
from optics.scene.sources import Rays
from thbcad import FreeformSurface, Lens

NUMBER = 9
TITLE = "Small optical figures"
INDEX = 1.5
DEGREES = np.linspace(0, 90, 1800, endpoint=False)  # 0.05 degrees
LENSES = (1, 2, 3)
ROUNDING = 1e-12  # of sums of a few numbers near 1

Floats = NDArray[np.float64]


def runs(quick: bool) -> list[Run]:
    """Return the runs, which are the same in the quick set."""
    return [
        Run("into glass", lambda _: fresnel(1.0, INDEX)),
        Run("out of glass", lambda _: fresnel(INDEX, 1.0)),
        Run("filters", lambda _: filters()),
        Run("efficiency", lambda _: efficiency()),
    ]


def pictures(results: Results) -> Iterator[tuple[str, bytes]]:
    """Yield Figures 2.3 and 2.6."""
    yield "study9_fresnel", small_pictures.fresnel(results)
    yield "study9_pixel", small_pictures.pixel(results["filters"])


def fresnel(before: float, behind: float) -> Found:
    """Return the transmittances by the angle of incidence, and the energy balance of the printed ones."""
    angle = np.radians(DEGREES)
    t_s, t_p = transmittances(before, behind, angle)
    traced = traced_transmittance(load_backend(), before, behind, angle)
    critical = critical_angle(before, behind)
    below = slice(None) if critical is None else angle < critical
    brewster = float(np.degrees(np.arctan(behind / before)))
    balance = 1 - t_s[below] + printed_s(before, behind, angle[below])
    numbers = {
        "normal": float(t_s[0]),
        "critical": None if critical is None else float(np.degrees(critical)),
        "beyond": 0.0 if critical is None else float(np.max(traced[angle > critical])),
        "growth": float(np.diff(traced).max()),
        "brewster": brewster,
        "at_brewster": float(transmittances(before, behind, np.radians(brewster))[1][0]),
        "balance": [float(balance.min()), float(balance.max())],
        "tracer": float(np.abs(traced - (t_s + t_p) / 2).max()),
    }
    return Found(numbers, {"t_s": t_s, "t_p": t_p, "t_u": traced})


def printed_s(before: float, behind: float, angle: Floats) -> Floats:
    """Return T_s as (2.7) prints it, for angles that pass."""
    cos_i = np.cos(angle)
    cos_t = np.sqrt(1 - (before / behind * np.sin(angle)) ** 2)
    return (2 * before * cos_i / (before * cos_i + behind * cos_t)) ** 2


def filters() -> Found:
    """Return the pixels by both filters, and how often a ray is counted.

    shared : rays in more than one pixel.  total : least and greatest sum of the weights of a ray.
    """
    numbers, arrays = {}, {"positions": POSITIONS}
    inner = np.abs(POSITIONS - PIXELS / 2) < PIXELS / 2 - CUT * SIGMA + 0.5  # all its pixels are there
    for name, window in (("box", box), ("gaussian", gaussian)):
        by_ray = weights(window)
        total = by_ray[:, inner].sum(axis=0)
        numbers[name] = by_ray.sum(axis=1).tolist()
        numbers[f"{name}_shared"] = int(((by_ray > 0).sum(axis=0) > 1).sum())
        numbers[f"{name}_total"] = [float(total.min()), float(total.max())]
        arrays[name] = by_ray
    return Found(numbers, arrays)


def efficiency() -> Found:
    """Return (2.13) and what plates pass, and one plate traced with all reflections."""
    face = FreeformSurface((50.0, 50.0))
    ray = Rays(np.array([[0.0], [0.0], [-10.0]]), np.array([[0.0], [0.0], [1.0]]), np.ones(1))
    plate = Lens(face, face, thickness=20.0, index=INDEX)
    target = TargetArea(receiver_at(100.0), (50.0, 50.0))
    traced = trace_nonsequential(load_backend(), plate, ray, target, threshold=0.0)
    one = normal_incidence_transmittance(INDEX)
    reflectance = 1 - float(np.sqrt(one))
    return Found(
        {
            "printed": [one**count for count in LENSES],
            "plates": [plates(count, reflectance) for count in LENSES],
            "traced": float(traced.fates.onto),
        }
    )


def section(results: Results) -> Section:
    """Return what the page says."""
    return Section(
        NUMBER,
        TITLE,
        [
            f"Fresnel's equations give the transmittances between air and an index of {INDEX:g}. Those of "
            "the tracer are drawn beside them. Transmittance here is that of power: T = 1 - R.",
            f"{RAYS} rays of equal radiance fall on {PIXELS} pixels in one dimension. A box and a Gaussian "
            "filter weigh them, and the pixel in the middle is their weighted sum.",
            "Flux is followed through plates in a row at normal incidence, with all reflections between "
            "their faces. One plate is also traced by the non-sequential tracer.",
        ],
        [*_fresnel_claims(results), *_other_claims(results)],
        [_angles(results)],
        [
            Picture("study9_fresnel", "Transmittance by the angle of incidence (Figure 2.3)."),
            Picture(
                "study9_pixel",
                "One pixel by a box filter (above) and a Gaussian one (below; Figure 2.6): filters and rays, "
                "rays weighed for the pixel in the middle, and the pixels as sums.",
            ),
        ],
        [
            Choice(
                "the rays and pixels of Figure 2.6, in a picture only",
                f"{RAYS} rays, seed {SEED}; {PIXELS} pixels",
            ),
            Choice(
                "sigma and radius of the Gaussian of Figure 2.6", f"{SIGMA:g} pixels, cut at {CUT:g} sigma"
            ),
        ],
    )


def _fresnel_claims(results: Results) -> list[Claim]:
    """Return the claims of Figure 2.3 and its equations."""
    into, out = results["into glass"].numbers, results["out of glass"].numbers
    low, high = into["balance"]
    return [
        Claim(
            "R_s + T_s = 1 with T_s by (2.7).",
            "2.2, (2.6) to (2.8)",
            f"R_s + T_s as printed lies between {low:.3g} and {high:.3g} into glass. It holds if it is 1 "
            "at all angles. The factor n_t cos(theta_t) / (n_i cos(theta_i)) is missing.",
            max(abs(low - 1), abs(high - 1)) < ROUNDING,
        ),
        Claim(
            "Total reflection sets in continuously: the reflected part grows with the angle until it is all.",
            "2.2.1",
            f"Out of glass the unpolarised transmittance of the tracer grows by at most {out['growth']:.1g} "
            f"in a step of {DEGREES[1]:g} degrees. Beyond {out['critical']:.2f} degrees it is at most "
            f"{out['beyond']:g}. It holds if growth is rounding only, and the last number is 0.",
            out["growth"] < ROUNDING and out["beyond"] == 0,
        ),
    ]


def _other_claims(results: Results) -> list[Claim]:
    """Return the claims of efficiency and filters."""
    n, f = results["efficiency"].numbers, results["filters"].numbers
    normal = results["into glass"].numbers["normal"]
    return [
        Claim(
            "About 96% of the light passes a face, and about 92% a lens.",
            "2.2, (2.12)",
            f"A face passes {normal:.2%} at normal incidence, and two faces {n['printed'][0]:.2%}. It holds "
            "if these round to the same numbers.",
            (round(100 * normal), round(100 * n["printed"][0])) == (96, 92),
        ),
        Claim(
            "0.96^(2 N) is the greatest efficiency of N lenses.",
            "(2.13)",
            f"Plates pass {_listed(n['plates'])} for N = {_listed(LENSES)}, where (2.13) says "
            f"{_listed(n['printed'])}. A traced plate passes {n['traced']:.4f}. It holds if no plates pass "
            "more. Light that is reflected twice arrives too.",
            all(plate <= printed for plate, printed in zip(n["plates"], n["printed"])),
        ),
        Claim(
            "A box counts a ray in its pixel only; Gaussian filters of neighbours overlap.",
            "2.4.2, Figure 2.6",
            f"{f['box_shared']} of {RAYS} rays are in more than one box, {f['gaussian_shared']} in more than "
            f"one Gaussian. The weights of a ray sum to {f['box_total'][0]:.3f} by boxes, and to "
            f"{f['gaussian_total'][0]:.3f} to {f['gaussian_total'][1]:.3f} by Gaussians. It holds if no ray "
            "is in two boxes and some are in two Gaussians.",
            f["box_shared"] == 0 < f["gaussian_shared"],
        ),
    ]


def _angles(results: Results) -> Table:
    rows = []
    for name, run in (("air to glass", "into glass"), ("glass to air", "out of glass")):
        n = results[run].numbers
        critical = "none" if n["critical"] is None else f"{n['critical']:.2f}"
        angles = (f"{n['brewster']:.2f}", f"{n['at_brewster']:.12f}", critical)
        rows.append((name, f"{n['normal']:.4f}", *angles, f"{n['tracer']:.1e}"))
    head = ("face", "T at 0 degrees", "Brewster angle", "T_p there", "critical angle", "tracer minus formula")
    return Table("Figure 2.3 in numbers; angles in degrees.", head, rows)


def _listed(values: object) -> str:
    return ", ".join(f"{value:.4g}" for value in values)
