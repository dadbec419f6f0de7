"""What a result tells the shop: tolerances, form errors, the body and test points, as numbers and texts.

Allowed errors are heights along z, and the zone of a profile is as wide as along the normal.  With the
steepest angle theta of a surface, and the middle period p = sqrt(p0 p1) of a band,

    width = peak to valley cos(theta),    rms slope = 2 pi rms / p.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, floor, inf, log10, pi, radians, sqrt
from pathlib import Path
from typing import Any, Literal

import numpy as np

from optics.base.runtime import UserError, checks_of
from optics.exchange.results import ResultFolder, sha256_of
from optics.scene.problem import Placed
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.io import read_json
from thbcad.lens import FreeformSurface, Lens
from thbcad.moulds import BodyOptions, MouldedBody
from thbcad.outlines import Outline

Origin = Literal["computed", "customary", "open", "given"]  # of an indication
FACES = ("front", "rear")
TOLERANCES = "tolerance.json"
FRACTIONS = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])  # of the largest such rectangle, where test points lie
ROUNDED = 1e3  # per mm: test points lie at whole micrometres, so that 0.1 um of their sag is true


@dataclass(frozen=True, eq=False)
class SheetFacts:
    """A result, and what is known of its tolerances.

    sha256 : of lens.step.  angles : the steepest of front and rear, degrees
    tolerance : of tolerance.json, None where `thbcad tolerance` has not run
    """

    system: System
    sha256: str
    angles: Mapping[str, float]
    tolerance: Mapping[str, Any] | None

    @classmethod
    def of(cls, result: str) -> SheetFacts:
        """Return those of a result folder.

        Raises UserError : no result folder, a mirror or a plate, a STEP file that is not verified,
            tolerances of another run.
        """
        folder = ResultFolder(result)
        if folder.path.is_file():
            raise UserError(f"a sheet needs the problem of a result folder, and {result} is a file")
        system, record = folder.read()
        if system.reflects or system.problem.optic.array is not None:
            raise UserError(
                f"a sheet is of one lens, and {result} holds a mirror or a plate of lenses; "
                "export --out X.svg draws the part"
            )
        files = [folder.path / name for name in ("verify.json", "manufacture.json")]
        folder.require_recorded(["lens.step", *(file.name for file in files)])
        verified, made = (read_json(file, "record") for file in files)
        failed = [c.name for c in checks_of(verified) if c.subject == "file" and not c.ok]
        if failed:
            raise UserError(
                f"{folder.step} is not verified ({failed[0]}): no sheet is made of it; design again"
            )
        angles = {face: made[face]["slope_degrees"]["upper"] for face in FACES}
        known = _tolerances(folder.path / TOLERANCES, record["run_id"])
        return cls(system, sha256_of(folder.step), angles, known)

    @property
    def lens(self) -> Lens:
        return self.system.designed

    def clear(self, face: str) -> Outline:
        """Return the clear aperture of a surface, where there is none its outline."""
        clear = self.system.clear_aperture
        return self._surface(face).outline if clear is None else clear[FACES.index(face)]

    def amount(self, *names: str, factor: float = 1.0) -> tuple[str, Origin] | None:
        """Return the least amount of these tolerances, "customary", or what is allowed where that is less,
        "computed".

        None is not known: there are none, or the design by itself misses what its light must keep.

        names : of tolerances of the lens, without its own name.
        """
        known, optic = self.tolerance or {}, self.system.problem.optic
        called = [f"{optic.called}.{name}" if isinstance(optic, Placed) else name for name in names]
        rows = [known["tolerances"][name] for name in called if name in known.get("tolerances", ())]
        if not rows or known["missed_by_the_design"]:
            return None
        allowed = min((row["allowed"] for row in rows if row["allowed"] is not None), default=inf)
        amount = min(row["amount"] for row in rows)
        return rounded_down(factor * min(amount, allowed)), "computed" if allowed < amount else "customary"

    def finest(self, face: str) -> tuple[float, tuple[float, float]] | None:
        """Return the least rms height that a band of periods allows, nm, rounded down, and the band, mm."""
        if not (bands := self.bands(face)):
            return None
        least = min(bands, key=lambda band: float(band["allowed_rms"]))
        low, high = least["band"]
        return float(rounded_down(1e6 * least["allowed_rms"])), (low, high)

    def bands(self, face: str) -> list[Mapping[str, Any]]:
        """Return what is allowed by bands of period, the shortest first; empty where it is not known."""
        form = (self.tolerance or {}).get("form_error", {})
        return list(form["sides"][face]["bands"]) if "sides" in form else []

    def profile(self, face: str) -> str | None:
        """Return the width of the zone that the errors of the longest periods may fill, and these."""
        if not (bands := self.bands(face)):
            return None
        width = 1e3 * bands[-1]["allowed_pv_field"] * cos(radians(self.angles[face]))
        return f"{rounded_down(width)} um, periods from {bands[-1]['band'][0]:g} mm"

    def slopes(self, face: str) -> str | None:
        """Return the rms slope that each band allows, mrad."""
        said = []
        for band in self.bands(face):
            low, high = band["band"]
            slope = rounded_down(1e3 * 2 * pi * band["allowed_rms"] / sqrt(low * high))
            said.append(f"{low:g} to {high:g} mm: {slope} mrad")
        return "; ".join(said) or None

    @property
    def body(self) -> BodyOptions | None:
        """What makes the lens a body that leaves a mould, None without lens.body."""
        return self.system.body

    @property
    def parting(self) -> str | None:
        """Where the parting line of that body lies."""
        solid = self.system.solid
        return f"z = {solid.parting:.4f} mm" if isinstance(solid, MouldedBody) else None

    @property
    def axis_thickness(self) -> float:
        """Along the axis, mm: sags have heights there, so that it is not that of the base vertices."""
        front, rear = (float(self._surface(face).grid([0.0], [0.0]).item()) for face in FACES)
        return self.lens.thickness + rear - front

    def test_points(self, face: str) -> tuple[Floats, Floats, Floats]:
        """Return x (5,), y (5,) and the sag z (5, 5), from the vertex of the base surface, mm.

        The corners lie on the clear aperture, or as near inside as whole micrometres allow.
        """
        clear = self.clear(face)
        reach = np.array(clear.half_width) / float(clear.gauge(*clear.half_width))
        x, y = (np.trunc(ROUNDED * r * FRACTIONS) / ROUNDED for r in reach)
        return x, y, self._surface(face).grid(x, y)

    def _surface(self, face: str) -> FreeformSurface:
        surface: FreeformSurface = getattr(self.lens, face)
        return surface


def rounded_down(value: float) -> str:
    """Return a number with two digits, not more than it; 0 where it is not positive."""
    if value <= 0:
        return "0"
    unit = 10.0 ** (floor(log10(value)) - 1)
    return f"{float(f'{floor(value / unit * (1 + 1e-12)) * unit:.2g}'):g}"


def _tolerances(path: Path, run: str) -> Mapping[str, Any] | None:
    """Return what tolerance.json holds of a run, None where there is none."""
    if not path.exists():
        return None
    try:
        known: Mapping[str, Any] = read_json(path, "record")
        own = known["run_id"] == run
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        raise UserError(f"{path} is damaged; run thbcad tolerance again") from None
    if not own:
        raise UserError(f"{path} belongs to another run; run thbcad tolerance again")
    return known
