"""A problem made ready: its system with every "auto" resolved, and the backend that traces it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from optics.system import solvable_system

if TYPE_CHECKING:
    from optics.optimisation import TransportStart
    from optics.problem import Problem
    from optics.runtime import Backend
    from optics.system import OpticalSystem


@dataclass(frozen=True, eq=False)
class Prepared:
    """A system, the backend of the problem's precision, and the transport start where it is known already."""

    system: OpticalSystem
    backend: Backend
    start: TransportStart | None


def prepared(problem: Problem) -> Prepared:
    """Return a problem made ready.

    Raises
    ------
    UserError : it cannot be solved, or no usable LLVM library.
    """
    return prepared_system(solvable_system(problem))


def prepared_system(system: OpticalSystem) -> Prepared:
    """Return the same of a system that can be solved."""
    from optics.prediction import resolved
    from optics.runtime import load_backend

    run = system.problem.run
    backend = load_backend(run.precision, run.threads)
    system, start = resolved(system, backend)
    return Prepared(system, backend, start)
