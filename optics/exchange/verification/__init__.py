"""A STEP file checked by programs that share no code with its writer."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .independent_checks import other_part_checks, text_and_occt_checks, tracer_by_occt
    from .lone_file import bare_checks, unit_note
    from .occt_tracer import occt_through
    from .optiland_tracer import optiland_available, optiland_checks, optiland_through, tracer_by_optiland
    from .rays_behind import RaysBehind, last_step
    from .reference_tracer import FileFace, through_faces, trace_step
    from .same_design import fresh_export_checks, prescription_checks, same_surface
    from .solid_text import whole_checks
    from .step_checks import (
        differing_numbers,
        export_step,
        read_back_step,
        surface_deviation,
        trace_back_step,
        verify,
    )
    from .step_file import (
        EXACT_VOLUME,
        FITTED_VOLUME,
        ExportedStep,
        StepFile,
        optical_faces,
        optical_form,
        state_checks,
        text_solid_checks,
        volume_check,
    )
    from .trace_comparison import exact_landing, light_checks

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
