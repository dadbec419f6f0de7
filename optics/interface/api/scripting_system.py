"""The system of a problem, for scripts: spaces, models, starts, lenses and their measurement."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
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
from optics.scene.system import Own, System as SceneSystem, shared, solvable_system
from thbcad.hierarchy import THBSpace
from thbcad.lens import Lens, require_sound
from thbcad.surfaces import THBSurface

MOST_RAYS = 1 << 26  # at once
LEAST_RAYS = 2  # in each direction
FINEST = 12  # level, as of max_level


class System(SceneSystem):
    """A problem and the shape of every element, for scripts: an immutable value with every "auto" resolved.

    base : the unoptimised lens.  designed : the lens with its present shape.  path : of the light through it.
    with_lens, with_sags : another System, with another shape.

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
        known = ready.system.computed | ({"_transport": ready.start} if ready.start else {})
        super().__init__(ready.system.problem, own=ready.system.own, known=known)

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
        spaces, sharp = space_rows(space, self._level_0), self.shaping
        if window is None:
            own = self.problem.optimizer.window
            window = "pixel" if own == "cells" and sharp.source.extended else own
        if window == "cells" and sharp.source.extended:
            raise UserError('window = "cells" needs a source without extent; take "pixel" or "bspline"')
        film = Film(sharp.target.screen(margin=MARGIN), _ray_counts(rays), window_named(self.problem, window))
        with device():
            traced, chosen = shaping_by(engine, self.unshaped, self.design_backend)
            traced = traced.with_sags([THBSurface(s, np.zeros(s.dim)) for s in spaces])
            light = chosen.model(traced, film)
            target = traced.target.irradiance(traced.target.screen(), self._flux)
            again = partial(System.model, self, space, rays, window, engine)
            return Model(spaces, light, penalised_objective(traced, light, target), again)

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
            return require_sound(self.base.with_sags(sags))
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
            found = measure(self.with_lens(lens), self.backend)
        return found.in_unit(unit_of(self))

    @shared
    def _level_0(self) -> list[THBSpace]:
        return [sag.space for sag in self.base.sags]

    @shared
    def _flux(self) -> float:
        return transmitted_flux(self.unshaped.shaping, self.design_backend)

    @shared
    def _transport(self) -> TransportStart:
        return TransportStart(self.unshaped, self.design_backend)


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
