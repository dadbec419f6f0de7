"""A STEP file checked by programs that share no code with its writer."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .independent_checks import (
        fixed_part_checks as fixed_part_checks,
        text_and_occt_checks as text_and_occt_checks,
        tracer_by_occt as tracer_by_occt,
    )
    from .lone_file import bare_checks as bare_checks
    from .occt_tracer import occt_trace as occt_trace
    from .optiland_tracer import (
        optiland_available as optiland_available,
        optiland_checks as optiland_checks,
        optiland_trace as optiland_trace,
        tracer_by_optiland as tracer_by_optiland,
    )
    from .rays_behind import RaysBehind as RaysBehind, last_step as last_step
    from .reference_tracer import trace_step as trace_step
    from .same_design import (
        fresh_export_checks as fresh_export_checks,
        prescription_checks as prescription_checks,
        same_surface as same_surface,
    )
    from .solid_text import whole_checks as whole_checks
    from .step_checks import (
        differing_numbers as differing_numbers,
        export_step as export_step,
        read_back_step as read_back_step,
        surface_deviation as surface_deviation,
        verify as verify,
    )
    from .step_file import (
        EXACT_VOLUME as EXACT_VOLUME,
        FITTED_VOLUME as FITTED_VOLUME,
        ExportedStep as ExportedStep,
        StepFile as StepFile,
        has_closed_form as has_closed_form,
        optical_faces as optical_faces,
        optical_form as optical_form,
        state_checks as state_checks,
        text_volume_check as text_volume_check,
        volume_check as volume_check,
    )
    from .trace_comparison import light_checks as light_checks

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
