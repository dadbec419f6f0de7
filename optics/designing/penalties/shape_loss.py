"""What the shapes of elements add to the loss: roughness, and limits that they exceed.

With the Hessian D^2 of a sag s, h the larger half-width, and means over points of the surface,

    roughness    h^2 mean |D^2 s|^2                  the bending energy of a thin plate
    a limit      w mean max(0, g + shift)^2          g the relative excess over the limit, w = WEIGHT

A shift is the margin to be left below the limit, ROOM by default, plus a Lagrange multiplier divided by 2 w,
as in the augmented Lagrangian.  The multiplier begins as 0 and follows the excess at a minimum.
Source: M. Powell, A method for nonlinear constraints in minimization problems, in: R. Fletcher (ed.),
Optimization, 1969.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np

from optics.designing.penalties.bending_limits import bending_limits
from optics.designing.penalties.height_limits import height_limits
from optics.designing.penalties.sample_points import Excess, Pull, SurfaceSamples
from optics.scene.problem import Limits, Optic
from optics.scene.system import volume_of_made
from thbcad.checks import Floats
from thbcad.lens import FreeformSurface, Lens, Manufacturability, manufacturability

WEIGHT = 100.0  # of the mean square of relative excesses
ROOM = 1e-3  # of a limit: what lies between the points stays within it
HEAVIER = 10.0  # times heavier in every pass: few are made
HESSIAN = ((2, 0), (1, 1), (1, 1), (0, 2))


class ShapePenalty:
    """The shapes' part of the loss, and its gradient by the coefficients of every sag.

    free : the free surfaces.  excesses : over limits, each with its penalty.  roughness : weight.
    """

    def __init__(
        self, free: Sequence[FreeformSurface], excesses: Sequence[Excess], roughness: float = 0.0
    ) -> None:
        self._embeddings = [s.sag.space.embedding for s in free if s.sag is not None]
        self._excesses, self._weight = excesses, WEIGHT
        self._rooms = [ROOM] * len(excesses)
        self._shifts = [np.full(excess.mean.shape, ROOM) for excess in excesses]
        self._rough = [SurfaceSamples(s, k) for k, s in enumerate(free)] if roughness else []
        self._roughness = [roughness * max(s.half_width) ** 2 for s in free]

    def __call__(self, coefficients: Sequence[Floats]) -> tuple[float, list[Floats]]:
        """Return (loss, gradients)."""
        nets = self._nets(coefficients)
        loss, slopes = 0.0, [np.zeros_like(net) for net in nets]
        for samples, net, slope, weight in zip(self._rough, nets, slopes, self._roughness):
            for derivative in set(HESSIAN):
                values = samples.sag(net, derivative)
                weights = HESSIAN.count(derivative) * weight * samples.mean
                loss += float((weights * values**2).sum())
                slope += samples.pulled(2 * weights * values, derivative)
        for excess, shift in zip(self._excesses, self._shifts):
            values, pull = excess(nets, shift)
            over = np.maximum(values, 0)
            loss += self._weight * float((excess.mean * over**2).sum())
            if over.any():
                pull(2 * self._weight * excess.mean * over, slopes)
        return loss, [e.adjoint(slope) for e, slope in zip(self._embeddings, slopes)]

    @property
    def keys(self) -> tuple[str, ...]:
        """The limits that have a penalty."""
        return tuple(dict.fromkeys(excess.key for excess in self._excesses))

    def only(self, keys: Sequence[str]) -> ShapePenalty:
        """Return the penalty without those of other limits."""
        other, kept = copy(self), [k for k, e in enumerate(self._excesses) if e.key in keys]
        other._excesses = [self._excesses[k] for k in kept]
        other._rooms = [self._rooms[k] for k in kept]
        other._shifts = [self._shifts[k] for k in kept]
        return other

    def exceeded(self, coefficients: Sequence[Floats]) -> bool:
        """Return whether a limit is exceeded at a point."""
        nets = self._nets(coefficients)
        return any((_counted(e, nets, np.zeros_like(e.mean)) > 0).any() for e in self._excesses)

    def cleared(self, coefficients: Sequence[Floats]) -> bool:
        """Return whether half of every room, or more, is left between excess and limit."""
        nets, pairs = self._nets(coefficients), zip(self._excesses, self._rooms)
        return all((_counted(e, nets, np.full(e.mean.shape, room)) <= room / 2).all() for e, room in pairs)

    def tightened(self, coefficients: Sequence[Floats]) -> ShapePenalty:
        """Return the penalty with the multipliers of a minimum, and HEAVIER times the weight."""
        nets, tightened = self._nets(coefficients), copy(self)
        pairs = zip(self._excesses, self._shifts)
        grown = [np.maximum(_counted(excess, nets, shift).max(axis=0), 0) for excess, shift in pairs]
        tightened._weight *= HEAVIER
        tightened._shifts = [room + shift / HEAVIER for room, shift in zip(self._rooms, grown)]
        return tightened

    def with_rooms(self, rooms: Mapping[str, float]) -> ShapePenalty:
        """Return the penalty with room between points and limits, relative to these, by key."""
        other = copy(self)
        other._rooms = [rooms.get(excess.key, ROOM) for excess in self._excesses]
        other._shifts = [np.full(e.mean.shape, room) for e, room in zip(self._excesses, other._rooms)]
        return other

    def _nets(self, coefficients: Sequence[Floats]) -> list[Floats]:
        return [e.coefficients(c) for e, c in zip(self._embeddings, coefficients)]


def _counted(excess: Excess, nets: Sequence[Floats], shift: Floats) -> Floats:
    """Return an excess at points, -inf at those that do not count."""
    return np.where(excess.mean > 0, excess(nets, shift)[0], -np.inf)


@dataclass(frozen=True, eq=False)
class Part:
    """An element whose shape is to keep limits.

    density : g/cm^3, for limits.mass.  made : (n, more), the volume of what is made is n times that of the
    lens, and mm^3 more.
    """

    lens: Lens
    limits: Limits
    density: float = 0.0
    made: tuple[int, float] = (1, 0.0)


def limited_part(optic: Optic, shape: Lens, limits: Limits) -> Part:
    """Return an element whose shape is to keep limits."""
    return Part(shape, limits, optic.density, _made(optic, shape, limits))


def limited_metrics(optic: Optic, shape: Lens, limits: Limits) -> Manufacturability:
    """Return the metrics of an element with a shape, by which limits are told."""
    metrics, (count, more) = manufacturability(shape, optic.density or None), _made(optic, shape, limits)
    return replace(metrics, volume=count * metrics.volume + more)


def _made(optic: Optic, shape: Lens, limits: Limits) -> tuple[int, float]:
    """Return what is made of a shape, as far as `limits.mass` asks: lens, body or plate; as `Part` has it."""
    return volume_of_made(optic, shape) if isfinite(limits.mass) else (1, 0.0)


@dataclass(frozen=True, eq=False)
class _OfPart:
    """The excess of one of several elements.  own : its nets among those of all."""

    excess: Excess
    own: slice

    @property
    def key(self) -> str:
        return self.excess.key

    @property
    def mean(self) -> Floats:
        return self.excess.mean

    def __call__(self, nets: Sequence[Floats], shift: Floats) -> tuple[Floats, Pull]:
        """See `Excess`."""
        values, pull = self.excess(nets[self.own], shift)
        return values, lambda bar, slopes: pull(bar, slopes[self.own])


def shape_penalty(parts: Sequence[Part], roughness: float = 0.0, fine: bool = False) -> ShapePenalty | None:
    """Return the penalty on the shapes of elements, or None.  fine : at twice as many points each way."""
    free, excesses = list[FreeformSurface](), list[Excess]()
    for part in parts:
        own = slice(len(free), len(free) + len(part.lens.sags))
        limits = height_limits(part.lens, part.limits, part.density, part.made, fine)
        limits += bending_limits(part.lens, part.limits, fine)
        excesses += limits if len(parts) == 1 else [_OfPart(excess, own) for excess in limits]
        free += part.lens.free_surfaces
    return ShapePenalty(free, excesses, roughness) if excesses or roughness else None
