"""What a lens delivers, measured on fresh rays."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.light.analysis.closed_lens_light import (
        NEGLIGIBLE as NEGLIGIBLE,
        ROULETTE as ROULETTE,
        nonsequential_light as nonsequential_light,
    )
    from optics.light.analysis.judgement import (
        Verdict as Verdict,
        counted_ways as counted_ways,
        delivery_checks as delivery_checks,
        error_words as error_words,
        judged as judged,
        loss_notes as loss_notes,
        picture_limit as picture_limit,
    )
    from optics.light.analysis.lens_trace import (
        conservation as conservation,
        fans as fans,
        nonsequential as nonsequential,
        plane_behind as plane_behind,
        sections as sections,
        sequential as sequential,
        sequential_metrics as sequential_metrics,
    )
    from optics.light.analysis.light_of_cells import (
        cell_irradiance as cell_irradiance,
        traced_cells as traced_cells,
    )
    from optics.light.analysis.light_of_rays import ray_irradiance as ray_irradiance
    from optics.light.analysis.light_of_wavelengths import coloured as coloured, fringe as fringe
    from optics.light.analysis.metrics import (
        Measurement as Measurement,
        contrast_error as contrast_error,
        dark_fraction as dark_fraction,
        delivered as delivered,
        measure as measure,
        rel_l2 as rel_l2,
        unit_mean as unit_mean,
    )
    from optics.light.analysis.optic_words import (
        passing_share as passing_share,
        passing_words as passing_words,
    )
    from optics.light.analysis.phase_space import (
        PhaseSpace as PhaseSpace,
        jacobian_determinants as jacobian_determinants,
    )
    from optics.light.analysis.photometric_metrics import (
        photometric_lines as photometric_lines,
        uniformity_metrics as uniformity_metrics,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
