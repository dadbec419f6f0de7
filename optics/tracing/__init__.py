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
        AIR as AIR,
        LightPath as LightPath,
        Medium as Medium,
        SlopeErrors as SlopeErrors,
        Surface as Surface,
    )
    from optics.tracing.nonsequential import (
        RayPath as RayPath,
        TargetPlane as TargetPlane,
        seen_branches as seen_branches,
        trace_nonsequential as trace_nonsequential,
        trace_paths as trace_paths,
    )
    from optics.tracing.path_faults import (
        path_faults as path_faults,
    )
    from optics.tracing.refraction import (
        critical_angle as critical_angle,
        normal_incidence_transmittance as normal_incidence_transmittance,
        reflect as reflect,
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
    from optics.tracing.traced_surface import (
        Passage as Passage,
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
    "light_path": (
        "AIR",
        "LightPath",
        "Medium",
        "SlopeErrors",
        "Surface",
    ),
    "nonsequential": (
        "RayPath",
        "TargetPlane",
        "seen_branches",
        "trace_nonsequential",
        "trace_paths",
    ),
    "path_faults": ("path_faults",),
    "refraction": (
        "critical_angle",
        "normal_incidence_transmittance",
        "reflect",
        "refract",
        "traced_transmittance",
        "transmittances",
    ),
    "searched_intersections": ("SearchedHits",),
    "sequential": ("Tracer",),
    "traced_surface": ("Passage",),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
