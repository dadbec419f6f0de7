"""Rays through the lens: in sequence, and with all reflections."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.tracing.fates import (
        FATES as FATES,
        SENTENCES as SENTENCES,
        SequentialFates as SequentialFates,
    )
    from optics.tracing.fresnel import (
        critical_angle as critical_angle,
        efficiency_bound as efficiency_bound,
        traced_transmittance as traced_transmittance,
        transmittances as transmittances,
    )
    from optics.tracing.intersections import (
        Hits as Hits,
        KnownHits as KnownHits,
        SearchedHits as SearchedHits,
    )
    from optics.tracing.landings import (
        Landing as Landing,
        LandingPoints as LandingPoints,
    )
    from optics.tracing.nonsequential import (
        RayPath as RayPath,
        TargetPlane as TargetPlane,
        trace_nonsequential as trace_nonsequential,
        trace_paths as trace_paths,
    )
    from optics.tracing.phase_space import (
        PhaseSpace as PhaseSpace,
        at_target as at_target,
        jacobian_determinants as jacobian_determinants,
        source_points as source_points,
    )
    from optics.tracing.refraction import (
        refract as refract,
    )
    from optics.tracing.sequential import (
        Tracer as Tracer,
        device_flux as device_flux,
    )

_FILES = {
    "fates": (
        "FATES",
        "SENTENCES",
        "SequentialFates",
    ),
    "fresnel": (
        "critical_angle",
        "efficiency_bound",
        "traced_transmittance",
        "transmittances",
    ),
    "intersections": (
        "Hits",
        "KnownHits",
        "SearchedHits",
    ),
    "landings": (
        "Landing",
        "LandingPoints",
    ),
    "nonsequential": (
        "RayPath",
        "TargetPlane",
        "trace_nonsequential",
        "trace_paths",
    ),
    "phase_space": (
        "PhaseSpace",
        "at_target",
        "jacobian_determinants",
        "source_points",
    ),
    "refraction": ("refract",),
    "sequential": (
        "Tracer",
        "device_flux",
    ),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
