"""What the README claims, each with its limit and what measures it.

The limits are written here alone.  Tests compare them with the stored benchmarks and with docs/audit.md.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from shutil import copytree
from typing import Any, NamedTuple

from optics.base.runtime import NumericalError, UserError, note
from optics.interface.audit.custom_loss import loss_results
from optics.interface.audit.damage import move_control_point
from optics.interface.audit.dense_samples import SAMPLES, bound_gaps
from optics.interface.audit.experiments import Ended, Experiments, NotTried, Unexpected
from optics.interface.audit.local_refinement import compare_meshes
from optics.interface.audit.numbers import loops, percent, power
from optics.interface.audit.step_surface import rear_deviation
from thbcad.doors import pip_command
from thbcad.io import read_lens

SLACK = 2.0  # a time may be so many times as long as claimed
FIRST, SECOND, THIRD, DAMAGED = "first", "second", "third", "damaged"  # folders
RAYS = 20_000  # that OCCT traces
MOVED = 1e-3  # mm, of a control point
NAMED = 2  # checks that fail, of those that are many
GRADIENT = 1e-8  # greatest error of a slope, relative to the gradient's norm
# problems that are refused: the change, where the message has advice, and the change that it advises
REFUSED = (
    ("target.distnace=300", r"did you mean ([\w.]+)\?", "{}=300"),
    ("target.distance=30", r"--set (target\.distance=[\d.]+)", "{}"),
)


class Measured(NamedTuple):
    """A claim as it was found: the value, in words, and whether it holds; None where it was not tried.

    remark : a sentence with details, or "".
    """

    value: float | None
    here: str
    holds: bool | None
    remark: str = ""


@dataclass(frozen=True)
class Claim:
    """A sentence with its limit, and SLACK times that, in place of {}, how these are written, and what
    measures the claim.
    """

    key: str
    text: str
    limit: float
    written: Callable[[float], str]
    measure: Callable[[Experiments, float], Measured]

    @property
    def claimed(self) -> str:
        return self.text.format(self.written(self.limit), self.written(SLACK * self.limit))


class Judged(NamedTuple):
    """A claim and what was found."""

    claim: Claim
    found: Measured


def judged(experiments: Experiments, claims: tuple[Claim, ...]) -> Iterator[Judged]:
    """Measure claims one after the other, and say on stderr which one is next."""
    for number, claim in enumerate(claims, 1):
        note(f"{number} of {len(claims)}: {claim.claimed}")
        try:
            found = claim.measure(experiments, claim.limit)
        except NotTried as missing:
            found = Measured(None, "not tried", None, str(missing))
        except (Unexpected, UserError, NumericalError, ValueError) as wrong:
            found = Measured(None, "not measured", False, str(wrong))
        yield Judged(claim, found)


# ---- designs and their times ----


def first_time(experiments: Experiments, limit: float) -> Measured:
    """Measure a design with an empty kernel cache."""
    _designed(experiments)
    if not any(experiments.kernels.glob("*")):
        raise NotTried("Dr.Jit keeps its kernels elsewhere, so no run is a first one")
    return _time(experiments.design(FIRST), limit)


def later_time(experiments: Experiments, limit: float) -> Measured:
    """Measure the faster of two designs with the kernels of the first one."""
    for name in (FIRST, SECOND, THIRD):
        _designed(experiments, name)
    return _time(min(map(experiments.design, (SECOND, THIRD)), key=lambda ended: ended.ratio), limit)


def _designed(experiments: Experiments, name: str = FIRST) -> dict[str, Any]:
    """Return what a design printed; its light and its file may miss limits."""
    return experiments.design(name).data(0, 1, 4)


def _time(ended: Ended, limit: float) -> Measured:
    here = f"{loops(ended.ratio)} loops ({ended.wall:.1f} s)"
    remark = f"{ended.cpu:.1f} s of CPU; calibration loop {ended.loop:.2f} s. By the clock {ended.wall:.1f} s"
    return Measured(ended.ratio, here, ended.ratio <= SLACK * limit, remark)


def light(experiments: Experiments, limit: float) -> Measured:
    """Measure the error of the light of the square."""
    error = _designed(experiments)["metrics"]["rel_l2"]
    return Measured(error, percent(error), error <= limit)


def same_bytes(experiments: Experiments, limit: float) -> Measured:
    """Count the designs whose STEP file differs from the first one."""
    files = []
    for name in (FIRST, SECOND, THIRD):
        _designed(experiments, name)
        files.append((experiments.folder / name / "lens.step").read_bytes())
    differing = sum(file != files[0] for file in files[1:])
    return Measured(differing, f"{differing} of {len(files) - 1} differ", differing <= limit)


# ---- the STEP file ----


def surface(experiments: Experiments, limit: float) -> Measured:
    """Measure how far the rear of the file is from the designed surface."""
    _designed(experiments)
    folder = experiments.folder / FIRST
    deviation = rear_deviation(folder / "lens.step", read_lens(folder / "lens.json"))
    return Measured(deviation, power(deviation, "mm"), deviation <= limit)


def landing(experiments: Experiments, limit: float) -> Measured:
    """Measure how far the landing points of optiland are from ours."""
    _designed(experiments)
    found = experiments.command("verify", FIRST, "--json").data(0, 1, 4)
    values = [c["value"] for c in found["checks"] if re.match("landing points by optiland", c["name"])]
    if not values:
        raise NotTried(f"optiland is not installed; {pip_command('verify')}")
    return Measured(values[0], power(values[0], "mm"), values[0] <= limit)


def light_by_occt(experiments: Experiments, limit: float) -> Measured:
    """Measure how far the light of the file by OCCT is from ours, in standard deviations of its noise."""
    _designed(experiments)
    words = ("verify", FIRST, "--no-optiland", "--light", "occt", "--rays", str(RAYS), "--json")
    found = experiments.command(*words).data(0, 1, 4)
    same, z = found["light"]["same_rays"], found["light"]["own_rays"]["z"]
    remark = f"{RAYS} random rays, which land within {power(same['landing_greatest'], 'mm')} of ours"
    return Measured(z, f"z = {z:.1f}", z <= limit and not _failed(found), remark)


def damage(experiments: Experiments, limit: float) -> Measured:
    """Count the control points that are moved without `verify` finding it; the unharmed file must pass."""
    _designed(experiments)
    whole = experiments.command("verify", FIRST, "--json").data(0, 1, 4)
    if _failed(whole):
        return Measured(1, "the unharmed file fails", False, "; ".join(_failed(whole)))
    folder = copytree(experiments.folder / FIRST, experiments.folder / DAMAGED, dirs_exist_ok=True)
    moved = move_control_point(Path(folder) / "lens.step", MOVED)
    ended = experiments.command("verify", DAMAGED, "--no-optiland", "--json")
    failed = _failed(ended.data(0, 1, 4))
    unnoticed = int(ended.code != 4 or not failed)
    where = f"z of #{moved.entity} (row {moved.row}, column {moved.column} of the net)"
    more = f"; and {len(failed) - NAMED} more" if len(failed) > NAMED else ""
    remark = (
        f"{where} from {moved.before:.6f} to {moved.after:.6f} mm. Failing: {'; '.join(failed[:NAMED])}{more}"
    )
    return Measured(unnoticed, f"exit {ended.code}, {len(failed)} checks fail", unnoticed <= limit, remark)


def _failed(verified: dict[str, Any]) -> list[str]:
    """Return the names of the checks of the file that fail."""
    return [c["name"] for c in verified["checks"] if c["result"] == "failed" and c["subject"] == "file"]


# ---- advice, bounds, scripts, meshes ----


def advice(experiments: Experiments, limit: float) -> Measured:
    """Count the refused problems whose message has no advice, or advice that does not work."""

    def checked(change: str) -> Ended:
        return experiments.command("check", "square.toml", "--set", change, "--json")

    remarks, useless = [], 0
    for change, pattern, advised in REFUSED:
        refused = checked(change)
        found = re.search(pattern, refused.err)
        remedy = advised.format(found[1]) if found else "no advice"
        code = checked(remedy).code if found else None
        useless += (refused.code, code) != (2, 0)
        remarks.append(f"{change} ends with exit code {refused.code}, then {remedy} with {code}")
    here = f"{len(REFUSED) - useless} of {len(REFUSED)} work"
    return Measured(useless, here, useless <= limit, "; ".join(remarks))


def bounds(experiments: Experiments, limit: float) -> Measured:
    """Measure the greatest relative gap between proven bounds and dense samples."""
    _designed(experiments)
    gaps = bound_gaps(read_lens(experiments.folder / FIRST / "lens.json"))
    outside = [each.name for each in gaps if not each.holds]
    gap = max(each.gap for each in gaps)
    proven = "; ".join(f"{g.name} {g.bound:.6g}{g.unit}" for g in gaps if isfinite(g.bound))
    remark = f"{SAMPLES} × {SAMPLES} points. Proven: {proven}"
    here = f"{len(outside)} broken" if outside else f"hold, {percent(gap)} apart"
    return Measured(gap, here, not outside and gap <= limit, remark)


def own_loss(experiments: Experiments, limit: float) -> Measured:
    """Measure what scipy makes of a custom loss; its gradient must agree with differences to 10⁻⁸."""
    error, slopes = loss_results(experiments.folder / "square.toml")
    remark = f"gradient against central differences: {power(slopes)}, at most {power(GRADIENT)}"
    return Measured(error, percent(error), error <= limit and slopes <= GRADIENT, remark)


def meshes(experiments: Experiments, limit: float) -> Measured:
    """Measure the share of the uniform functions that a crescent needs at equal error."""
    found = compare_meshes(experiments.folder / "crescent.toml")
    remark = (
        f"{found.refined} of {found.uniform} functions; error {percent(found.error)}, uniform "
        f"{percent(found.uniform_error)}"
    )
    return Measured(found.share, percent(found.share), found.as_good and found.share <= limit, remark)


CLAIMS = (
    Claim("first", "First design: {} calibration loops, at most {}", 9.0, loops, first_time),
    Claim("later", "Later designs: {} calibration loops, at most {}", 7.0, loops, later_time),
    Claim("light", "Uniform square: error at most {}", 1e-3, percent, light),
    Claim("bytes", "Same input, same bytes of lens.step", 0, power, same_bytes),
    Claim("surface", "lens.step is the design within {}", 1e-10, lambda x: power(x, "mm"), surface),
    Claim("landing", "optiland's rays land within {}", 1e-8, lambda x: power(x, "mm"), landing),
    Claim("occt", "OpenCASCADE finds the same light: z at most {}", 5.0, lambda x: f"{x:g}", light_by_occt),
    Claim("damage", "Control point moved by 10⁻³ mm: verify finds it", 0, power, damage),
    Claim("advice", "Typo, impossible target: the advice works", 0, power, advice),
    Claim("bounds", "Proven bounds hold, within {} of samples", 1e-3, percent, bounds),
    Claim("loss", "Your own loss, by scipy: error at most {}", 3e-3, percent, own_loss),
    Claim("meshes", "A crescent needs at most {} of the functions", 0.11, percent, meshes),
)
