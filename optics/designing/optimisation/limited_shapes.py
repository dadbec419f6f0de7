"""Free surfaces moved within the limits of manufacture, so that their light changes little.

A move lifts whole surfaces first, which changes the light little.  Then it minimises the change of the
slopes, which is about how far the light moves, together with the penalties of the limits: a few passes of the
augmented Lagrangian (`ShapePenalty.tightened`), until the limits are kept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy.optimize import minimize

from optics.designing.optimisation.bounded_variables import BoundedVariables
from optics.designing.penalties import (
    ROOM,
    ShapePenalty,
    SlopeDistance,
    curvature_range,
    limited_metrics,
    limited_part,
    shape_penalty,
)
from optics.designing.starts import RearLight
from optics.light.measuring import symmetry_axes
from optics.scene.limits import LimitCost, Miss, limit_misses
from optics.scene.problem import Optic
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.lens import radii_within
from thbcad.surfaces import THBSurface

Sags = tuple[THBSurface, ...]

ROOMS = 6  # that are tried, of a limit: 0.001, 0.003, ... 0.24
MORE_ROOM = 3.0
LIFTS = 20  # iterations that find the heights of surfaces
FLAT = 1e-6  # of the penalty: what heights do not change, as they change no curvature except by rounding
PASSES = 4  # of a move: two keep a limit that is 3 % to 60 % away
MOVES = 150  # iterations of a pass, at most
TRIES = 60  # lengths of a step: penalties of curvature begin suddenly, far below the first length
MEMORY = 20  # steps that a pass remembers
STILL = 1e-9  # fall of a step, of the value at the start, that ends a pass
SHARES = 1.0, 0.75, 0.5, 0.25, 0.0  # of the start's sags, the most that can be moved within the limits
INSIDE = 0.99  # of z_freedom
CUT = 0.01  # of z_freedom: less is not worth a sentence
LIT = 0.1  # of the greatest weight, of cells that light meets
BENDING = "radius", "concave_radius"
ACTIVE = 0.02  # of a limit


class LimitedShapes:
    """The limits of a system's problem, and moves of sags within them.

    system : whose sags have the spaces of all others.  light : on the last free surface, if known.
    """

    def __init__(self, system: System, light: RearLight | None = None) -> None:
        self._system, self._light = system, light
        self._bounds = [freeform.freedom for freeform in system.freeforms]

    def penalty(self, fine: bool) -> ShapePenalty | None:
        """Return the penalty of the limits alone.  fine : at twice as many points each way."""
        free = self._system.free_elements
        return shape_penalty([limited_part(o, s, self._system.problem.limits) for o, s in free], fine=fine)

    @cached_property
    def _dense(self) -> ShapePenalty:
        dense = self.penalty(fine=True)
        assert dense is not None, "there are limits"
        return dense

    @cached_property
    def _variables(self) -> BoundedVariables:
        outlines = [surface.outline for surface in self._system.free_surfaces]
        sags = self._system.sags
        return BoundedVariables(sags, self._bounds, symmetry_axes(self._system), outlines)

    def start(self, sags: Sags, penalty: ShapePenalty) -> tuple[Sags, tuple[str, ...], str]:
        """Return sags moved within the limits, those that they keep: all, or as many as are found one
        after the other, and a sentence where z_freedom cuts off much of them.

        A limit that no sag can keep would spoil the light, and the other limits, for nothing.
        """
        if moved := self._share_within(sags, penalty):
            return moved, penalty.keys, self._cut_off(sags, penalty)
        best, keys = sags, tuple[str, ...]()
        for key in penalty.keys:
            if moved := self._share_within(sags, penalty.only((*keys, key))):
                best, keys = moved, (*keys, key)
        return best, keys, ""

    def _cut_off(self, sags: Sags, penalty: ShapePenalty) -> str:
        _, heights, cut = self._lifted(sags, penalty)
        if cut <= CUT * min(self._bounds):
            return ""
        shaped = self._system.shaped
        thickness = self._system.designed.thickness + (heights[-1] if shaped == "rear" else -heights[-1])
        key = self._system.problem.optic.key("thickness")
        return (
            f"to keep the limits the {shaped} moves by {heights[-1]:.2g} mm along z, and z_freedom "
            f"cuts off {cut:.2g} mm of the sag: for better light --set {key}={thickness:.4g}"
        )

    def _share_within(self, sags: Sags, penalty: ShapePenalty) -> Sags | None:
        """Return sags within the limits near others, or near a share of them: less sag bends less."""
        for share in SHARES:
            if moved := self.moved(
                tuple(THBSurface(sag.space, share * sag.coefficients) for sag in sags), penalty
            ):
                return moved
        return None

    def conics(self, sags: Sags, penalty: ShapePenalty) -> Sags | None:
        """Return the conics nearest to surfaces among those that keep the limits, None if there are none.

        A conic's vertex stays where it is, as far as z_freedom allows.
        """
        problem, ranges = self._system.problem, list[tuple[float, float]]()
        for optic, _ in self._system.free_elements:
            ranges += [curvature_range(problem.limits, name, ROOM) for name in optic.free]
        found = list[THBSurface]()
        for sag, bound in zip(self._distance(sags).conics(ranges), self._bounds):
            low = -INSIDE * bound - float(sag.coefficients.min())
            high = INSIDE * bound - float(sag.coefficients.max())
            if low > high:
                return None
            found.append(THBSurface(sag.space, sag.coefficients + np.clip(0.0, low, high)))
        return self.moved(tuple(found), penalty)

    def shifted(self, sags: Sags, penalty: ShapePenalty) -> list[Sags]:
        """Return sags with the last one moved along z as far as z_freedom allows, both ways, where the limits
        are kept: the light that limits on curvature cannot spread enough spreads more over a longer way."""
        *others, last = sags
        c, bound = last.coefficients, INSIDE * self._bounds[-1]
        ends = ((*others, THBSurface(last.space, c + shift)) for shift in (-bound - c.min(), bound - c.max()))
        return [end for end in ends if penalty.cleared([sag.coefficients for sag in end])]

    def costs(
        self, sags: Sags, misfit: Callable[[Sags], float], surface: str = "the start"
    ) -> list[LimitCost]:
        """Return what every limit that surfaces miss costs the light alone, the greatest cost first.

        misfit : called with sags, returns their rel_l2.  surface : the noun of the surfaces.
        """
        penalty, free, found = self.penalty(fine=False), misfit(sags), list[tuple[float, LimitCost]]()
        assert penalty is not None, "there are limits"
        for miss in self._misses_where_lit(sags):
            only = penalty.only((miss.key,))
            conics = self.conics(sags, only) if miss.key in BENDING else None
            near = [other for other in (conics, self.moved(sags, only, conics)) if other]
            if near:
                kept = min(map(misfit, near))
                found.append((kept, LimitCost(miss, kept, free, surface)))
        return [cost for _, cost in sorted(found, key=lambda pair: -pair[0]) if cost.counts]

    def unknown_costs(self, sags: Sags, surface: str) -> list[LimitCost]:
        """Return the limits on curvature that surfaces miss, where their rel_l2 is not known."""
        misses = [miss for miss in self._misses_where_lit(sags) if miss.key in BENDING]
        return [LimitCost(miss, None, None, surface) for miss in misses]

    def active(self, sags: Sags) -> list[Miss]:
        """Return the limits on curvature that surfaces keep with less than a share ACTIVE to spare."""
        shaped = self._system.with_sags(sags)
        limits = self._system.problem.limits
        nearer = replace(limits, **{key: getattr(limits, key) * (1 + ACTIVE) for key in BENDING})
        found = {
            miss.key: replace(miss, wanted=getattr(limits, miss.key))
            for optic, shape in shaped.free_elements
            for miss in limit_misses(
                replace(shaped.problem, limits=nearer).about(optic), limited_metrics(optic, shape, nearer)
            )
            if miss.key in BENDING and miss.most > 0
        }
        return list(found.values())

    def _misses_where_lit(self, sags: Sags) -> list[Miss]:
        """Return the limits that surfaces miss, one of each key; radii count only where light goes."""
        shaped = self._system.with_sags(sags)
        found, met = dict[str, Miss](), (shaped.problem.optic.called, shaped.shaped)
        for optic, miss in _curable_misses(shaped):
            if miss.key in BENDING and self._light is not None and (optic.called, miss.surface) == met:
                concave, convex = radii_within(shaped.designed, miss.surface, _half_widths(self._light))
                ends = [concave, *([convex] if miss.key == "radius" else [])]
                short = max(0.0, miss.wanted - min(end.lower for end in ends))
                miss = replace(miss, most=short, least=short)
            if miss.key not in found or miss.most > found[miss.key].most:
                found[miss.key] = miss
        return [miss for miss in found.values() if miss.most > 0]

    def certified(self, sags: Sags, keys: Sequence[str]) -> Sags:
        """Return sags moved within the certified limits of these keys; unchanged where that cannot be."""
        dense, found, rooms = self._dense.only(keys), sags, dict[str, float]()
        for _ in range(ROOMS):
            missed = self.missed(found).intersection(keys)
            if not missed:
                return found
            rooms |= {key: MORE_ROOM * rooms[key] if key in rooms else ROOM for key in missed}
            moved = self.moved(sags, dense.with_rooms(rooms))
            if not moved:
                break
            found = moved
        return sags

    def missed(self, sags: Sags) -> set[str]:
        """Return the keys of the limits that are not certainly kept, except those that no sag can mend."""
        return {miss.key for _, miss in _curable_misses(self._system.with_sags(sags))}

    def moved(self, sags: Sags, penalty: ShapePenalty, within: Sags | None = None) -> Sags | None:
        """Return sags near others that leave half the room of every limit; None where none are found.

        within : that keep the limits, from which the search begins where the others are farther beyond them.
        """
        coefficients, _, _ = self._lifted(sags, penalty)
        if not penalty.cleared(coefficients):
            begin = tuple(THBSurface(s.space, c) for s, c in zip(sags, coefficients))
            distance = self._distance(begin)
            if within and distance([sag.coefficients for sag in within])[0] < penalty(coefficients)[0]:
                begin = within
            coefficients = _nearest(self._variables.around(begin), distance, penalty)
        if not penalty.cleared(coefficients):
            return None
        return tuple(THBSurface(sag.space, c) for sag, c in zip(sags, coefficients))

    def _distance(self, sags: Sags) -> SlopeDistance:
        shaped = self._system.with_sags(sags)
        light = None if self._light is None else (self._light.x, self._light.y, self._light.weight)
        return SlopeDistance(shaped.free_surfaces, [*[None] * (len(sags) - 1), light])

    def _lifted(self, sags: Sags, penalty: ShapePenalty) -> tuple[list[Floats], Floats, float]:
        """Return coefficients with the heights that keep most of the limits, the heights, and what is cut
        off, mm."""
        before, bounds = [sag.coefficients for sag in sags], [INSIDE * bound for bound in self._bounds]
        heights = _heights(before, bounds, penalty)
        lifted = [np.clip(c + h, -b, b) for c, h, b in zip(before, heights, bounds)]
        cut = max(float(np.abs(c + h - d).max()) for c, h, d in zip(before, heights, lifted))
        return lifted, heights, cut if heights.any() else 0.0


def _curable_misses(system: System) -> list[tuple[Optic, Miss]]:
    """Return the limits that free elements may miss, each with its element, except those that no coefficient
    can mend."""
    problem = system.problem
    return [
        (optic, miss)
        for optic, shape in system.free_elements
        for miss in limit_misses(problem.about(optic), limited_metrics(optic, shape, problem.limits))
        if miss.most > 0 and miss.key != "feature" and miss.surface in ("", *optic.free)
    ]


def _half_widths(light: RearLight) -> tuple[float, float]:
    """Return the half-widths of the rectangle that light meets."""
    lit = light.weight > LIT * light.weight.max()
    x, y = np.abs(light.x[lit.any(axis=1)]).max(), np.abs(light.y[lit.any(axis=0)]).max()
    return float(x), float(y)


def _heights(before: list[Floats], bounds: Sequence[float], penalty: ShapePenalty) -> Floats:
    """Return the heights that make the penalty least when they are added to the surfaces, mm."""

    def loss_of(heights: Floats) -> tuple[float, Floats]:
        coefficients = [np.clip(c + h, -b, b) for c, h, b in zip(before, heights, bounds)]
        loss, gradients = penalty(coefficients)
        free = zip(gradients, coefficients, bounds)
        return loss, np.array([g[np.abs(c) < b].sum() for g, c, b in free])

    start = np.zeros(len(before))
    loss, slope = loss_of(start)
    if np.abs(slope * bounds).max() <= FLAT * loss:
        return start
    options = {"maxiter": LIFTS, "gtol": FLAT * loss / max(bounds)}
    least = minimize(loss_of, start, jac=True, method="BFGS", options=options)
    result: Floats = least.x if least.fun < loss else start
    return result


def _nearest(variables: BoundedVariables, distance: SlopeDistance, penalty: ShapePenalty) -> list[Floats]:
    """Return coefficients near the variables' start that are cleared, or the last that were tried."""
    weights, penalised = variables.zeros(), penalty
    for _ in range(PASSES):
        weights = _least(variables, distance, penalised, weights)
        found = variables.coefficients(weights)[0]
        if penalty.cleared(found):
            break
        penalised = penalised.tightened(found)
    return found


def _least(
    variables: BoundedVariables, distance: SlopeDistance, penalty: ShapePenalty, start: Floats
) -> Floats:
    """Return the weights, from a start, of the least sum of distance and penalty."""

    def loss_of(weights: Floats) -> tuple[float, Floats]:
        coefficients, slopes = variables.coefficients(weights)
        (near, by_near), (over, by_over) = distance(coefficients), penalty(coefficients)
        return near + over, variables.gradient([a + b for a, b in zip(by_near, by_over)], slopes)

    scale = 1 / max(loss_of(start)[0], np.finfo(float).tiny)

    def scaled(weights: Floats) -> tuple[float, Floats]:
        loss, gradient = loss_of(weights)
        return scale * loss, scale * gradient

    options = {"maxiter": MOVES, "maxls": TRIES, "gtol": 0.0, "ftol": STILL, "maxcor": MEMORY}
    found: Floats = minimize(scaled, start, jac=True, method="L-BFGS-B", options=options).x
    return found
