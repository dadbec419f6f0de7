"""A finished lens in other light."""

from __future__ import annotations

from dataclasses import asdict, replace

from optics.base.runtime import Backend, UserError
from optics.light.analysis import Measurement, measure
from optics.scene.problem import Problem, Source
from optics.scene.system import OpticalSystem, solvable_system
from thbcad.lens import Lens


def relit(problem: Problem, lens: Lens, source: Source, backend: Backend) -> Measurement:
    """Return what the lens of a problem delivers in the light of another source.

    Where that is designed for another wavelength, the lens has its index there, if material or indices tell.

    backend : of double precision.

    Raises
    ------
    UserError : a source that does not go with the lens, such as one that lies in it.
    """
    index = _index_at(OpticalSystem(problem), source.wavelength)
    system = solvable_system(problem.with_(source=asdict(source), **{"lens.index": index}))
    return measure(system, replace(lens, index=index), backend)


def _index_at(system: OpticalSystem, nm: float) -> float:
    try:
        return system.index_at(nm)
    except UserError:
        return system.lens.index
