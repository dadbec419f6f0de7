"""Where rays end, and what every tracer offers that follows them there.

`Landing` lies on the device, with all that gradients and flux budgets need; `LandingPoints` are bare points
in numpy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import and_
from typing import Any, Protocol

from optics.base.runtime import DrArray
from optics.light.tracing.traced_surface import Passage
from thbcad.checks import Floats
from thbcad.splines import KnotVector


@dataclass(eq=False)
class Landing:
    """Where rays meet the receiver: x, y in mm or degrees, flux in W, zero unless they arrive.

    p, q : direction cosines there, along x and y of the receiver.
    definite : rays whose x and y are meant, on the surfaces or on what continues them beyond the rims.
    passages : what became of the rays at every surface.
    blocked : rays that a stop or a body takes behind the last surface.  again : of these, those that meet
        that surface once more.
    """

    x: DrArray
    y: DrArray
    p: DrArray
    q: DrArray
    flux: DrArray
    definite: DrArray | bool
    passages: Sequence[Passage] = ()
    blocked: DrArray | bool = False
    again: DrArray | bool = False

    @property
    def arrives(self) -> DrArray | bool:
        """Rays that are definite, met every surface within its rim, and that nothing blocks."""
        arriving = reduce(and_, (p.hit for p in self.passages), self.definite)
        return arriving if self.blocked is False else arriving & ~self.blocked


@dataclass(frozen=True, eq=False)
class LandingPoints:
    """Where light meets the target plane.

    points : (n, 2), x and y in mm (degrees in the far field), NaN for rays that do not arrive.
    flux : (n,) in W, 0 for these.
    """

    points: Floats
    flux: Floats

    @property
    def x(self) -> Floats:
        return self.points[:, 0]

    @property
    def y(self) -> Floats:
        return self.points[:, 1]


class RayTracer(Protocol):
    """Rays of one source through a lens whose sags may change, differentiably: what an objective needs."""

    def trace(self, coefficients: Sequence[Floats]) -> tuple[list[Any], Landing]:
        """Return (what `pull_back` needs of every sag, Landing).

        coefficients : of the sags, (dim,) each, front first.
        """
        ...

    def pull_back(
        self, traced: Sequence[Any], /, knots: Sequence[Sequence[KnotVector]] | None = None
    ) -> list[Floats]:
        """Return the derivative by each sag's coefficients, or by a net over other knots, after
        `dr.backward`."""
        ...

    def set_directions(self, traced: Sequence[Any], directions: Sequence[Floats], /) -> list[DrArray]:
        """Set the derivatives of what was traced to those along a direction in the coefficients.

        Returned are the arrays from which they go forward.
        """
        ...
