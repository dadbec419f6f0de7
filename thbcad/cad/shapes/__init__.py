"""OpenCASCADE solids with shared topology."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .flange_solid import flanged_part as flanged_part
    from .lens_parts import (
        lens_part as lens_part,
        lens_solid as lens_solid,
        part_between as part_between,
        polygon_part as polygon_part,
        trimmed_part as trimmed_part,
    )
    from .mould_solids import insert_part as insert_part, moulded_part as moulded_part
    from .occt_splines import (
        TOLERANCE as TOLERANCE,
        geom_surface as geom_surface,
        rational_geom as rational_geom,
        rational_geom_curve as rational_geom_curve,
        spline_curve as spline_curve,
        spline_surface as spline_surface,
    )
    from .patched_solid import patched_part as patched_part
    from .topology import NAMES as NAMES, Part as Part

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
