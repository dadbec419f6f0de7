"""Spline geometry for freeform lenses: exact THB surfaces, closed lenses, CAD exchange.

Names are loaded when first used: ``import thbcad`` itself loads nothing heavy.
"""

__import__("thbcad.early_stop")  # first of all: Ctrl-C among the next imports would print a traceback

from thbcad.doors import TYPE_CHECKING, lazy_door  # noqa: E402

__version__ = "0.3.0"

if TYPE_CHECKING:
    from .cad import (
        ForeignLens as ForeignLens,
        read_curves as read_curves,
        read_faces as read_faces,
        read_lens_solid as read_lens_solid,
        read_step as read_step,
        to_build123d as to_build123d,
        to_cadquery as to_cadquery,
        write_curves as write_curves,
        write_faces as write_faces,
        write_step as write_step,
    )
    from .certified import (
        Enclosure as Enclosure,
        greatest_slope as greatest_slope,
        least_radii as least_radii,
        value_range as value_range,
    )
    from .drawings import (
        lens_sheet as lens_sheet,
        plan_view as plan_view,
        section_view as section_view,
        side_view as side_view,
        write_drawing as write_drawing,
    )
    from .fitting import (
        Fit as Fit,
        Samples as Samples,
        Underdetermined as Underdetermined,
        fit as fit,
        height_field_samples as height_field_samples,
        least_squares as least_squares,
        quasi_interpolate as quasi_interpolate,
    )
    from .hierarchy import THBSpace as THBSpace, common_refinement as common_refinement
    from .io import (
        read_curve as read_curve,
        read_lens as read_lens,
        read_surface as read_surface,
        write_curve as write_curve,
        write_lens as write_lens,
        write_surface as write_surface,
    )
    from .lens import (
        FreeformSurface as FreeformSurface,
        Lens as Lens,
        Manufacturability as Manufacturability,
        Product as Product,
        manufacturability as manufacturability,
        require_sound as require_sound,
    )
    from .meshes import body_mesh as body_mesh, to_trimesh as to_trimesh
    from .outlines import Outline as Outline
    from .poses import Pose as Pose
    from .sags import (
        Approximation as Approximation,
        Conic as Conic,
        PolynomialSag as PolynomialSag,
        approximated as approximated,
        error_bounds as error_bounds,
        meridian as meridian,
    )
    from .splines import (
        BSplineCurve as BSplineCurve,
        BSplineSurface as BSplineSurface,
        KnotVector as KnotVector,
        NURBSCurve as NURBSCurve,
        NURBSSurface as NURBSSurface,
        circular_arc as circular_arc,
        conic_arc as conic_arc,
        interpolate as interpolate,
        line as line,
        revolved as revolved,
        ruled as ruled,
    )
    from .surfaces import THBSurface as THBSurface

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__, public=True)
