"""A finished lens in other light."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

from optics.analysis import measure
from optics.system import solvable_system

if TYPE_CHECKING:
    from optics.analysis import Measurement
    from optics.problem import Problem, Source
    from optics.runtime import Backend
    from thbcad.lens import Lens


def relit(problem: Problem, lens: Lens, source: Source, backend: Backend) -> Measurement:
    """Return what the lens of a problem delivers in the light of another source.

    backend : of double precision.

    Raises
    ------
    UserError : a source that does not go with the lens, such as one that lies in it.
    """
    return measure(solvable_system(problem.with_(source=asdict(source))), lens, backend)
