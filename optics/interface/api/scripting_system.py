"""What a problem describes, for scripts: spaces, models, starts, lenses and their measurement."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial
from math import isqrt
from numbers import Integral

import numpy as np

from optics.base.runtime import UserError, device
from optics.designing.optimisation import MARGIN, penalised_objective, transmitted_flux, window_named
from optics.designing.starts import TransportStart
from optics.interface.api.coefficient_vectors import Coefficients, Spaces, packed, space_rows, vectors
from optics.interface.api.irradiance_model import Model, unit_of
from optics.interface.api.prepared_problem import prepared, shaping_by
from optics.light.analysis import Measurement, measure
from optics.light.engines import Engine, Film
from optics.scene.problem import Problem
from optics.scene.receivers import Receiver
from optics.scene.sources import LightSource
from optics.scene.system import Own, solvable_system
from thbcad.hierarchy import THBSpace
from thbcad.lens import Lens, require_sound
from thbcad.surfaces import THBSurface

MOST_RAYS = 1 << 26  # at once
LEAST_RAYS = 2  # in each direction
FINEST = 12  # level, as of max_level


class System:
    """Base lens, source and target of a problem, built once; every "auto" is resolved.

    It is built again from its problem where it is copied or pickled.

    source, receiver : objects of classes of your own, in place of what the problem describes, see `Own`.

    Raises UserError : a problem that cannot be solved; one sentence says why.

    >>> System(problem).space(level=1).dim  # of the problem in the example of Problem
    289
    """

    def __init__(
        self, problem: Problem, source: LightSource | None = None, receiver: Receiver | None = None
    ) -> None:
        if not isinstance(problem, Problem):
            raise UserError(f"System takes a Problem, got {problem!r}; optics.load_problem reads a file")
        if len(problem.free_optics) > 1:
            names = " and ".join(optic.table for optic in problem.free_optics)
            raise UserError(f"System is a map of one free element, got {names}; optics.design shapes several")
        with device():
            ready = prepared(solvable_system(problem, Own(source, receiver)))
        self.optical, self._backend, self._start = ready.system, ready.backend, ready.start

    def __reduce__(self) -> tuple[type[System], tuple[object, ...]]:
        own = self.optical.own
        return System, (self.problem, own.source, own.receiver)

    @property
    def problem(self) -> Problem:
        """The problem with a number for every "auto"."""
        return self.optical.problem

    def space(self, level: int = 0) -> Spaces:
        """Return the space of the free surface with all cells refined to a level; of two, front first."""
        if not isinstance(level, Integral) or isinstance(level, bool) or not 0 <= int(level) <= FINEST:
            raise UserError(f"level must be a whole number from 0 to {FINEST}, got {level!r}")
        spaces = [space.uniform(int(level)) for space in self._level_0]
        return spaces[0] if len(spaces) == 1 else tuple(spaces)

    def model(
        self,
        space: Spaces,
        rays: int | tuple[int, int] = (449, 449),
        window: str | None = None,
        engine: str | Engine | None = None,
    ) -> Model:
        """Return the differentiable map from coefficients to irradiance.

        space : of the sag, a refinement of `space(0)`; two free surfaces have a tuple.
        rays : in x and y, or their total.
        window : "cells", "pixel", "bspline" or "gaussian", as of `optimizer.window`; left out, the problem's
            own.  In cells the light of sources without extent is measured exactly; extended ones have pixels.
        engine : a name as of `optimizer.engine`, an `engines.Engine`, or None for the problem's own.

        Raises UserError : what does not suit, or an engine that is not installed; one sentence says so.
        """
        spaces, optical = space_rows(space, self._level_0), self.optical.shaping
        if window is None:
            own = self.problem.optimizer.window
            window = "pixel" if own == "cells" and optical.source.extended else own
        if window == "cells" and optical.source.extended:
            raise UserError('window = "cells" needs a source without extent; take "pixel" or "bspline"')
        film = Film(
            optical.target.screen(margin=MARGIN), _ray_counts(rays), window_named(self.problem, window)
        )
        lens = optical.base.with_sags([THBSurface(s, np.zeros(s.dim)) for s in spaces])
        with device():
            optical, chosen = shaping_by(engine, self.optical, self._backend)
            light = chosen.model(optical, lens, film)
            target = optical.target.irradiance(optical.target.screen(), self._flux)
            again = partial(System.model, self, space, rays, window, engine)
            return Model(spaces, light, penalised_objective(optical, lens, light, target), again)

    def transport_start(self, space: Spaces) -> THBSurface | tuple[THBSurface, ...]:
        """Return the sag that optimal transport asks for; a free front before it stays a conic.

        Raises UserError : no transport map exists.
        """
        spaces = space_rows(space, self._level_0)
        with device():
            last = self._transport.fit(spaces[-1]).sag
        return packed([*(THBSurface(s, np.zeros(s.dim)) for s in spaces[:-1]), last])

    def lens(self, space: Spaces, coefficients: Coefficients) -> Lens:
        """Return the lens with these sags.

        Raises UserError : it cannot exist, since its surfaces cross.
        """
        spaces = space_rows(space, self._level_0)
        sags = [THBSurface(s, c) for s, c in zip(spaces, vectors(coefficients, spaces))]
        try:
            return require_sound(self.optical.base.with_sags(sags))
        except ValueError as error:
            raise UserError(f"the lens cannot exist: {error}; take smaller coefficients") from None

    def measure(self, lens: Lens) -> Measurement:
        """Return irradiance, target and metrics of a lens, by light that no optimiser has seen.

        In W/mm^2; in the far field in W/sr, as the model's.

        Raises UserError : no Lens.
        """
        if not isinstance(lens, Lens):
            made = "system.lens(space, c) makes one"
            raise UserError(f"measure takes a Lens, got {type(lens).__name__}; {made}")
        with device():
            found = measure(self.optical, lens, self.optical.backend)
        return found.in_unit(unit_of(self.optical))

    @cached_property
    def _level_0(self) -> list[THBSpace]:
        return [sag.space for sag in self.optical.base.sags]

    @cached_property
    def _flux(self) -> float:
        return transmitted_flux(self.optical.shaping, self._backend)

    @cached_property
    def _transport(self) -> TransportStart:
        return self._start or TransportStart(self.optical, self._backend)


def _ray_counts(rays: object) -> tuple[int, int]:
    """Return the rays in x and y."""
    counts = rays
    if isinstance(rays, Integral) and not isinstance(rays, bool) and int(rays) > 0:
        counts = isqrt(int(rays)), isqrt(int(rays))
    if (
        not isinstance(counts, Sequence | np.ndarray)
        or len(counts) != 2
        or not all(isinstance(n, Integral) and int(n) >= LEAST_RAYS for n in counts)
    ):
        raise UserError(
            f"rays must be two whole numbers from {LEAST_RAYS} on, or their product, got {rays!r}"
        )
    if counts[0] * counts[1] > MOST_RAYS:
        raise UserError(f"rays must be {MOST_RAYS} at most, got {rays!r}; take fewer")
    return int(counts[0]), int(counts[1])
