"""OpenCASCADE solids with shared topology."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .flange_solid import flanged_part as flanged_part
    from .lens_parts import (
        lens_part,
        lens_solid,
        part_between,
        polygon_part as polygon_part,
        trimmed_part as trimmed_part,
    )
    from .mould_solids import insert_part, moulded_part
    from .occt_splines import (
        TOLERANCE,
        geom_surface,
        rational_geom,
        rational_geom_curve,
        spline_curve,
        spline_surface,
    )
    from .patched_solid import patched_part
    from .plate_solid import plate_part
    from .topology import BUILDER, NAMES, Part, closed_part, new_wire

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
