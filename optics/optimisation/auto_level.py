"""Levels that a problem leaves to the program."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from optics.optimisation.transport_start import TransportStart
from optics.problem import AUTO, FINEST_AUTO, Freeform
from optics.system import OpticalSystem

if TYPE_CHECKING:
    from optics.runtime import Backend

Surface = TypeVar("Surface", Freeform, Freeform | None)

LEAST = 3  # level: the optimiser mends what the transport map's own cells leave


def resolved(system: OpticalSystem, backend: Backend) -> tuple[OpticalSystem, TransportStart | None]:
    """Return the system with numbers for its levels, and its transport start where that told them.

    A level is taken from the detail of the transport map (`TransportStart.level`).
    """
    if all(freeform.max_level != AUTO for freeform in system.freeforms):
        return system, None
    start = TransportStart(system, backend)
    level = start.level(LEAST, FINEST_AUTO)
    spec = system.problem.lens
    front = replace(spec.front, freeform=_with_level(spec.front.freeform, level))
    rear = replace(spec.rear, freeform=_with_level(spec.rear.freeform, level))
    lens = replace(spec, front=front, rear=rear)
    return OpticalSystem(replace(system.problem, lens=lens)), start


def _with_level(freeform: Surface, level: int) -> Surface:
    if freeform is None or freeform.max_level != AUTO:
        return freeform
    return replace(freeform, max_level=level)
