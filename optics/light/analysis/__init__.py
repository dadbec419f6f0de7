"""What a lens delivers, measured on fresh rays."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.light.analysis.closed_lens_light import NEGLIGIBLE, ROULETTE, nonsequential_light
    from optics.light.analysis.judgement import (
        PICTURE_REL_L2,
        WHAT_HELPS,
        Verdict,
        counted_ways,
        dark_note,
        delivery_checks,
        error_words,
        judged,
        loss_notes,
        past_notes,
        picture_limit,
        unjudged_note,
    )
    from optics.light.analysis.lens_trace import (
        conservation,
        crosstalk,
        crosstalk_line,
        fans,
        nonsequential,
        plane_behind,
        sections,
        sequential,
        sequential_metrics,
    )
    from optics.light.analysis.light_by_all_ways import light_past_elements
    from optics.light.analysis.light_estimate import REPLICATES, Light, LightEstimate
    from optics.light.analysis.light_of_cells import cell_irradiance, cut_cells, traced_cells
    from optics.light.analysis.light_of_rays import ray_irradiance
    from optics.light.analysis.light_of_wavelengths import coloured, fringe
    from optics.light.analysis.metrics import (
        Measurement,
        contrast_error,
        dark_fraction,
        delivered,
        fresh_light,
        measure,
        rel_l2,
        unit_mean,
    )
    from optics.light.analysis.phase_space import PhaseSpace
    from optics.light.analysis.photometric_metrics import (
        box_screen,
        passing_share,
        passing_words,
        per_area,
        photometric_lines,
        polarisation_change,
        polarisation_note,
        uniformity_metrics,
        uniformity_of_pixels,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
