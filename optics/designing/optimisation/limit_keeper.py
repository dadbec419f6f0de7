"""Optimisation that ends within the limits of manufacturing.

Limits add penalties at points, and certified everywhere.  Where a start or a minimum exceeds a limit:

1. the start is moved within the limits (`LimitedShapes`), as far as the penalties see them; limits that no
   start is found for add none any more;
2. the minimum is improved in a few passes of the augmented Lagrangian (`ShapePenalty.tightened`);
3. the result is moved within the limits at denser points, with more room until the limits are certified.

Where the surface of the transport map bends more than a limit allows, the conic nearest to it that keeps
the limit is another start.  The design ends with the better light of that conic, of its start and of its
minimum.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from math import ceil

from optics.designing.optimisation.limited_shapes import BENDING, LimitedShapes, Sags
from optics.designing.optimisation.stage_search import Found, Interrupted, Log, Search, minimised
from optics.designing.penalties import ShapePenalty
from optics.designing.starts import TransportStart
from optics.scene.limits import active_sentence, costs_light
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.surfaces import THBSurface

PASSES = 3  # of the augmented Lagrangian at most
SHORTER = 0.5  # of the stage's iterations, in every pass
FAR = 0.1  # rel_l2 from which an active limit is worth a note
WORTH = 0.25  # of the loss of a start that misses limits: the most of one that is moved within them


class LimitKeeper:
    """Minimises the objective of a stage within the limits of a system's problem.

    guide : the transport map whose surface the design would follow without limits, if there is one.
    note : called with a sentence where limits stand in the way.
    known : the transport map, if there is one, also where the design does not follow it.
    """

    def __init__(
        self,
        system: System,
        guide: TransportStart | None,
        note: Callable[[str], object],
        known: TransportStart | None = None,
    ) -> None:
        self._note, self._guide, self._known = note, guide, guide or known
        self._present = system.sags
        self._wanted = self._present if guide is None else self._of_map(guide)
        self._shapes = LimitedShapes(system, guide.rear_slopes()[0] if guide else None)
        self._penalty = self._shapes.penalty(fine=False)

    def _of_map(self, start: TransportStart) -> Sags:
        return *self._present[:-1], start.fit(self._present[-1].space).sag

    def minimised(self, search: Search, iterations: int, log: Log) -> tuple[Sags, Found | None]:
        """Return the best sags that are found, within the limits where that can be, and the last search, None
        where they are not its result.

        Raises Interrupted : on Ctrl-C.  NumericalError : the loss is not finite.
        """
        asked = search.objective.shape
        if self._penalty is None or asked is None:
            found = minimised(search, iterations, log)
            return found.sags, found
        sags = search.sags
        try:
            search = self.begun(search, log)
            shape, sags = search.objective.shape, search.sags
            assert shape is not None
            if left_out := [f"limits.{key}" for key in asked.keys if key not in shape.keys]:
                names = " and ".join(left_out)
                self._note(f"no surface is found that keeps {names}, so that the design leaves it out")
            found = minimised(search, iterations, log)
            keys, sags = shape.keys, found.sags
            for _ in range(PASSES):
                if not shape.exceeded(_coefficients(sags)):
                    break
                shape = shape.tightened(_coefficients(sags))
                found = minimised(found.search.begun_again(sags, shape), ceil(SHORTER * iterations), log)
                sags = found.sags
            searched = self._shapes.certified(sags, keys)
            sags = self._best(search, searched, keys, log)
            self._name_costs(search, sags, log)
            return sags, found if sags is searched else None
        except KeyboardInterrupt:
            raise Interrupted(log.state(sags)) from None

    def begun(self, search: Search, log: Log) -> Search:
        """Return the search from within the limits, as far as a start there is found, without the others.

        A search that began beyond them would dent the surface where it could have moved as a whole.  Where
        the move spoils the light more than the limits were missed, the start stays: a dent beside the light
        keeps them better.
        """
        shape, coefficients = search.objective.shape, _coefficients(search.sags)
        if shape is None or not shape.exceeded(coefficients):
            return search
        search = search.preconditioned()
        starts, keys, cut_off = self._starts(search.sags, shape.with_rooms({}))
        losses = [search.objective(_coefficients(start)).loss for start in starts]
        missing, moved = search.objective(coefficients).loss, min(losses)
        log.evaluations += 1 + len(starts)
        if moved > WORTH * missing:
            return search.begun_again(search.sags, shape.only(keys))
        if cut_off:
            self._note(cut_off)
        return search.begun_again(starts[losses.index(moved)], shape.only(keys))

    def _starts(self, sags: Sags, penalty: ShapePenalty) -> tuple[list[Sags], tuple[str, ...], str]:
        """Return starts within the limits, the limits that they keep, and a sentence as
        `LimitedShapes.start`."""
        if self._conics is None:
            moved, keys, cut_off = self._shapes.start(sags, penalty)
            return [moved], keys, cut_off
        near = self._shapes.moved(sags, penalty, self._conics)
        starts = [self._conics, *([near] if near else [])]
        ends = [end for start in starts for end in self._shapes.shifted(start, penalty)]
        return [*starts, *ends], penalty.keys, ""

    @cached_property
    def _conics(self) -> Sags | None:
        """The conics within the limits that are nearest to the wanted surfaces, where these bend more than
        the limits allow."""
        if self._penalty is None:
            return None
        bending = self._penalty.only(BENDING)
        if not bending.exceeded(_coefficients(self._wanted)):
            return None
        return self._shapes.conics(self._wanted, self._penalty)

    def _best(self, search: Search, sags: Sags, keys: Sequence[str], log: Log) -> Sags:
        """Return the sags with the best light among those found, the start and the conic, of all that
        certainly keep the limits, if any does."""
        if self._conics is None:
            return sags
        plain = search.objective.with_shape(None)
        every = [sags, *(self._shapes.certified(other, keys) for other in (search.sags, self._conics))]
        ranks = [
            (not self._shapes.missed(each).isdisjoint(keys), plain(_coefficients(each)).loss)
            for each in every
        ]
        log.evaluations += len(every)
        best = ranks.index(min(ranks))
        if best == 2:
            self._note(
                "within the limits on curvature no better light is found than that of the nearest conic, "
                "which the design takes"
            )
        return every[best]

    def _name_costs(self, search: Search, sags: Sags, log: Log) -> None:
        """Note which limits cost the light of the sags that are found.

        They are compared with the surface of the map, or with the present one where there is no map.  Where
        neither shows a cost, and the light is far from the target, the limits are noted that are active.
        """

        def misfit(sags: Sags) -> float:
            log.evaluations += 1
            return search.objective(_coefficients(sags)).fit

        wanted = self._present if self._known is None else self._of_map(self._known)
        surface = "the start" if self._guide or not self._known else "the map's surface"
        fit = misfit(sags)
        costs = self._shapes.costs(wanted, misfit, surface) if costs_light(fit, misfit(wanted)) else []
        sentences = [cost.sentence for cost in costs]
        if not costs and fit > FAR and self._guide is None:
            sentences = [active_sentence(m.key, m.wanted, m.unit) for m in self._shapes.active(sags)]
        for sentence in sentences:
            self._note(sentence)


def _coefficients(sags: Sequence[THBSurface]) -> list[Floats]:
    return [sag.coefficients for sag in sags]
