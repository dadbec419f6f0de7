"""Rays through the lens: in sequence, and with all reflections."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.tracing.fates import (
        FATES as FATES,
        SENTENCES as SENTENCES,
        Fates as Fates,
        SequentialFates as SequentialFates,
        flux_by_fate as flux_by_fate,
    )
    from optics.tracing.intersections import (
        HeightError as HeightError,
        Hits as Hits,
        KnownHits as KnownHits,
        device_flux as device_flux,
        rim_fade as rim_fade,
    )
    from optics.tracing.landings import (
        Landing as Landing,
        LandingPoints as LandingPoints,
        RayTracer as RayTracer,
    )
    from optics.tracing.light_path import (
        LightPath as LightPath,
    )
    from optics.tracing.nonsequential import (
        RayPath as RayPath,
        TargetPlane as TargetPlane,
        seen_branches as seen_branches,
        trace_nonsequential as trace_nonsequential,
        trace_paths as trace_paths,
    )
    from optics.tracing.refraction import (
        SMOOTH as SMOOTH,
        SlopeErrors as SlopeErrors,
        critical_angle as critical_angle,
        normal_incidence_transmittance as normal_incidence_transmittance,
        refract as refract,
        traced_transmittance as traced_transmittance,
        transmittances as transmittances,
    )
    from optics.tracing.searched_intersections import (
        SearchedHits as SearchedHits,
    )
    from optics.tracing.sequential import (
        Tracer as Tracer,
    )

_FILES = {
    "fates": (
        "FATES",
        "Fates",
        "SENTENCES",
        "SequentialFates",
        "flux_by_fate",
    ),
    "intersections": (
        "HeightError",
        "Hits",
        "KnownHits",
        "device_flux",
        "rim_fade",
    ),
    "landings": (
        "Landing",
        "LandingPoints",
        "RayTracer",
    ),
    "light_path": ("LightPath",),
    "nonsequential": (
        "RayPath",
        "TargetPlane",
        "seen_branches",
        "trace_nonsequential",
        "trace_paths",
    ),
    "refraction": (
        "SMOOTH",
        "SlopeErrors",
        "critical_angle",
        "normal_incidence_transmittance",
        "refract",
        "traced_transmittance",
        "transmittances",
    ),
    "searched_intersections": ("SearchedHits",),
    "sequential": ("Tracer",),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
