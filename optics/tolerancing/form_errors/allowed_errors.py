"""How large form errors may be: their cost by bands of period, measured by random probes, and limits
from it, in numbers and in words for the shop.

An error of random phase adds to the metric in squares: of

    rel^2 = rel0^2 + 2 <r, J dh> + |J dh|^2

the middle term vanishes in the mean.  A rise from rel0 to rel then allows rms = sqrt(rel^2 - rel0^2) / c,
with c = |J dh| / |T| of an error whose rms is 1.

c is that of cells of which PER_PERIOD make the shortest period, where MOST_CELLS are enough for that.  What
they leave of a wave is known (`seen_by_cells`) and divided out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cache, cached_property
from math import ceil, pi, sqrt
from typing import Any

import numpy as np

from optics.base.runtime import Backend, UserError
from optics.light.analysis import rel_l2
from optics.scene.system import System, require_lens_on_axis, require_light_of_one_lens
from optics.tolerancing.form_errors.local_formula import SIDES, Floats, LocalFormula, local_formula_of
from optics.tolerancing.form_errors.period_bands import Band, BandFormula, period_bands_of, seen_by_cells
from optics.tolerancing.perturbations import HeightSum, random_field
from thbcad.outlines import Outline

Progress = Callable[[str, int, int], None]

CELLS_PER_PIXEL, LEAST_CELLS, MOST_CELLS = 4, 192, 1536  # in each direction
PER_PERIOD = 6  # cells on the shortest period of a band: they leave 96 % of its waves
PROBES = 2  # of a band: single ones differ by 2 %, those of the longest band by 15 %
PROBE_RMS = 1e-6  # mm: the change is linear in it
PV_OF_SINE = 2 * sqrt(2)  # peak to valley of a sine, in its rms
Counts = tuple[int, int]
FORM_HEAD = (
    "side",
    "period",
    "allowed rms",
    "peak to valley of a regular ripple",
    "of a random field",
    "formula / probes",
    "MTF",
    "rel_l2 traced",
)
NM, UM = 1e6, 1e3  # per mm


@dataclass(frozen=True)
class BandCost:
    """What a band of period costs on one side of a lens.

    band : shortest and longest period, mm.
    change_per_mm : c, what is added to rel_l2 in squares per mm rms, by random probes.
    by_formula : the same by the local formula.  curvature_part : of the curvature term in its square.
    mtf : what pixels leave of the change.
    slope_cost : c per rms slope of the error, at the band's middle period: c period / (2 pi).
    allowed_rms : mm, for the stated rise.  allowed_pv_sine : mm, the peak to valley of a sine, at the worst
        period and direction of the band.  allowed_pv_field : mm, of a random field with this rms.
    traced_rel_l2 : with a random field of the allowed rms, by an exact trace.
    """

    band: tuple[float, float]
    change_per_mm: float
    by_formula: float
    curvature_part: float
    mtf: float
    slope_cost: float
    allowed_rms: float
    allowed_pv_sine: float
    allowed_pv_field: float
    traced_rel_l2: float


@dataclass(frozen=True, eq=False)
class SideCost:
    """The costs of all bands on one side, and maps of them.

    points : x and y of the surface, (2, nx, ny) mm, of the maps.
    maps : by band, the rms of dE / E per mm rms of the error, (nx, ny).
    """

    side: str
    bands: tuple[BandCost, ...]
    points: Floats
    maps: tuple[Floats, ...]

    @property
    def danger(self) -> BandCost:
        """The band in which a given rms slope costs most."""
        return max(self.bands, key=lambda cost: cost.slope_cost)


@dataclass(frozen=True, eq=False)
class FormErrors:
    """What form errors of front and rear cost.

    rel_l2 : without them, by front and rear.  rise : of it that each band alone may bring.
    wavelength : nm, of the light that is traced.  spectral : the source has others too.
    """

    rel_l2: float
    rise: float
    sides: tuple[SideCost, ...]
    wavelength: float
    spectral: bool

    def data(self) -> dict[str, Any]:
        """Return the numbers as plain data for JSON files; lengths in mm."""
        return {
            "rel_l2": self.rel_l2,
            "rise": self.rise,
            "wavelength_nm": self.wavelength,
            "sides": {
                cost.side: {
                    "bands": [asdict(band) | {"band": list(band.band)} for band in cost.bands],
                    "danger_band": list(cost.danger.band),
                }
                for cost in self.sides
            },
        }


def form_errors_of(
    system: System, backend: Backend, rise: float, progress: Progress | None = None
) -> FormErrors:
    """Return what form errors of front and rear cost.

    backend : of double precision.  rise : of rel_l2 that each band alone may bring, above 0.
    progress : called with the name of a side and a band, its number from 0, and how many there are.

    Raises UserError : a rise that is not positive; an extended or blurred source; a plate before a plane; a
        lens that brings no light.
    """
    lens = system.designed
    require_lens_on_axis(system, "errors of form", "thbcad tolerance knows its other errors")
    require_light_of_one_lens(system, "errors of form")
    if not 0 < rise < np.inf:
        raise UserError(f"the rise of rel_l2 that form errors may bring must be positive, got {rise}")
    nx, ny = (min(max(CELLS_PER_PIXEL * n, LEAST_CELLS), MOST_CELLS) for n in system.target.settings.pixels)
    bands = {side: period_bands_of(getattr(lens, side).half_width) for side in SIDES}
    steps = [(side, band) for side in SIDES for band in bands[side]]
    own, sides = 0.0, []
    for side in SIDES:

        @cache
        def formula_of(counts: Counts, side: str = side) -> LocalFormula:
            return local_formula_of(system, side, backend, counts)

        formula = formula_of((nx, ny))
        probed = _Probed(formula, _target(system, formula), getattr(lens, side).outline, formula_of)
        own, costs, maps = probed.rel_l2, [], []
        for band in bands[side]:
            if progress:
                name = f"form of the {side}, {band[0]:g} to {band[1]:g} mm"
                progress(name, steps.index((side, band)), len(steps))
            cost, relative = probed.cost(band, rise)
            costs.append(cost)
            maps.append(relative)
        sides.append(SideCost(side, tuple(costs), probed.waves.points, tuple(maps)))
    return FormErrors(own, rise, tuple(sides), system.problem.source.wavelength, system.spectral)


@dataclass(frozen=True, eq=False)
class _Probed:
    """One side of a lens, whose errors are probed.

    target : the picture on the pixels.  finer : the formula with (nx, ny) cells.
    """

    formula: LocalFormula
    target: Floats
    outline: Outline
    finer: Callable[[Counts], LocalFormula]

    @cached_property
    def waves(self) -> BandFormula:
        return BandFormula(self.formula)

    @cached_property
    def picture(self) -> Floats:
        return self.formula.irradiance / self.formula.shown

    @cached_property
    def rel_l2(self) -> float:
        return rel_l2(self.picture, self.target)

    def cost(self, band: Band, rise: float) -> tuple[BandCost, Floats]:
        """Return the BandCost of a band, and the map of its dE / E."""
        picture, expected = self.picture, self.waves.change(band)
        # how many cells see a band: the usual ones, or more
        usual = [n - 1 for n in self.formula.nominal.passing.shape]
        wanted = [ceil(n * side * PER_PERIOD / band[0]) for n, side in zip(usual, _cell(self.formula))]
        nx, ny = (max(n, min(w, MOST_CELLS)) for n, w in zip(usual, wanted))
        formula = self.finer((nx, ny))
        seen = seen_by_cells(band, _cell(formula))
        # both images are scaled to unit mean in rel_l2
        scale = float(self.target.mean() / picture.mean() / np.linalg.norm(self.target))
        half, corners = self.outline.half_width, self.outline.corners
        probes = [random_field(band, PROBE_RMS, half, seed, corners) for seed in range(PROBES)]
        changes = [np.linalg.norm(formula.linear_change(probe) / formula.shown) for probe in probes]
        change = scale * float(np.sqrt(np.mean(np.square(changes)))) / PROBE_RMS / seen
        allowed = sqrt((self.rel_l2 + rise) ** 2 - self.rel_l2**2) / change
        field = HeightSum(((allowed / PROBE_RMS, probes[0]),))
        whole = HeightSum(((allowed / PROBE_RMS / seen, probes[0]),))  # as large as cells see it
        inside = self.outline.contains(*formula.points) | self.outline.is_rectangle
        traced = formula.traced_irradiance(whole) / formula.shown
        cost = BandCost(
            band=band,
            change_per_mm=change,
            by_formula=scale * float(np.linalg.norm(picture)) * expected.norm,
            curvature_part=expected.curvature,
            mtf=expected.mtf,
            slope_cost=change * sqrt(band[0] * band[1]) / (2 * pi),
            allowed_rms=allowed,
            allowed_pv_sine=PV_OF_SINE * allowed / expected.worst,
            allowed_pv_field=float(np.ptp(field.jet(*(a[inside] for a in formula.points))[0])),
            traced_rel_l2=rel_l2(traced, self.target),
        )
        return cost, expected.relative


def _cell(formula: LocalFormula) -> tuple[float, float]:
    """Return the mean sides of the cells on the surface, mm."""
    nx, ny = (n - 1 for n in formula.nominal.passing.shape)
    wide, high = (float(np.ptp(a[formula.nominal.passing > 0])) for a in formula.points)
    return wide / nx, high / ny


def _target(system: System, formula: LocalFormula) -> Floats:
    """Return the picture that is asked for: the irradiance on the pixels, in the far field the intensity."""
    if formula.irradiance.sum() <= 0:
        raise UserError(
            "the lens brings no light to the target, so that form errors change nothing; design it"
        )
    return system.target.irradiance(formula.screen, float(formula.nominal.passing.mean())) / formula.shown


def height_text(height: float) -> str:
    """Return a height, mm, in nm, or in um from one on."""
    return f"{NM * height:.3g} nm" if UM * height < 1 else f"{UM * height:.3g} um"


def form_sentences(errors: FormErrors) -> list[str]:
    """Return what the shop must hold of both sides, and of what light that is said where there is other."""
    said = []
    for cost in errors.sides:
        first, band, last = cost.bands[0], cost.danger, cost.bands[-1]
        said.append(
            f"Ripples of the {cost.side} with periods from {band.band[0]:g} to {band.band[1]:g} mm are the "
            "most dangerous: there an error of given slope costs most. Hold "
            f"{height_text(band.allowed_rms)} rms in this band, and a regular ripple, at its worst period "
            f"and direction, {height_text(band.allowed_pv_sine)} peak to valley."
        )
        said.append(
            f"Peak to valley alone misleads on the {cost.side}: for the same loss a ripple with a period "
            f"above {last.band[0]:g} mm may be {last.allowed_pv_sine / first.allowed_pv_sine:.3g} times as "
            f"high as one with a period below {first.band[1]:g} mm. State the rms by bands of period."
        )
    if errors.spectral:
        said.append(
            f"Form errors are traced at the design wavelength alone, {errors.wavelength:g} nm; "
            f"there the design has rel_l2 = {errors.rel_l2:.2%}."
        )
    return said


def form_rows(errors: FormErrors) -> list[tuple[str, ...]]:
    """Return a row of texts for every band of both sides, under FORM_HEAD."""
    return [
        (
            cost.side,
            f"{band.band[0]:g} to {band.band[1]:g} mm",
            height_text(band.allowed_rms),
            height_text(band.allowed_pv_sine),
            height_text(band.allowed_pv_field),
            f"{band.by_formula / band.change_per_mm:.2f}",
            f"{band.mtf:.2f}",
            f"{band.traced_rel_l2:.2%}",
        )
        for cost in errors.sides
        for band in cost.bands
    ]
