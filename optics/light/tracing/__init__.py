"""Rays along a light path: sequential, and with all reflections."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.light.tracing.fates import (
        FATES as FATES,
        SENTENCES as SENTENCES,
        Fate as Fate,
        Fates as Fates,
        SequentialFates as SequentialFates,
        fate_sentences as fate_sentences,
    )
    from optics.light.tracing.landings import (
        Landing as Landing,
        LandingPoints as LandingPoints,
        RayTracer as RayTracer,
    )
    from optics.light.tracing.nonsequential import (
        RayPath as RayPath,
        TargetArea as TargetArea,
        seen_branches as seen_branches,
        trace_nonsequential as trace_nonsequential,
        trace_paths as trace_paths,
    )
    from optics.light.tracing.obstructions import ShadingBody as ShadingBody
    from optics.light.tracing.refraction import (
        critical_angle as critical_angle,
        normal_incidence_transmittance as normal_incidence_transmittance,
        reflect as reflect,
        refract as refract,
        traced_transmittance as traced_transmittance,
        transmittances as transmittances,
    )
    from optics.light.tracing.sequential import Tracer as Tracer
    from optics.light.tracing.unreachable_light import path_faults as path_faults

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
