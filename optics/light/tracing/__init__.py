"""Rays along a light path: sequential, and with all reflections."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.light.tracing.branches import Branches
    from optics.light.tracing.fates import FATES, SENTENCES, Fate, Fates, SequentialFates, fate_sentences
    from optics.light.tracing.landings import Landing, LandingPoints, RayTracer
    from optics.light.tracing.nonsequential import (
        RayPath,
        TargetArea,
        seen_branches,
        trace_nonsequential,
        trace_paths,
    )
    from optics.light.tracing.obstructions import ShadingBody
    from optics.light.tracing.refraction import (
        critical_angle,
        normal_incidence_transmittance as normal_incidence_transmittance,
        polarising,
        refract,
        traced_transmittance,
        transmittances as transmittances,
    )
    from optics.light.tracing.sequential import Tracer as Tracer
    from optics.light.tracing.unreachable_light import path_faults

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
