"""Units of light in watts or lumens, and the numbers by which lighting engineers judge it."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.photometry.intensity_planes import (
        BEAM as BEAM,
        FIELD as FIELD,
        PlaneCurve as PlaneCurve,
        plane_curves as plane_curves,
    )
    from optics.photometry.light_units import (
        PER_STERADIAN as PER_STERADIAN,
        Density as Density,
        Units as Units,
        units_of as units_of,
    )
    from optics.photometry.lit_region import (
        RASTER as RASTER,
        LitRegion as LitRegion,
        edge_width as edge_width,
    )
    from optics.photometry.uniformity_grid import (
        GRID as GRID,
        NOISE as NOISE,
        Uniformity as Uniformity,
        uniformity as uniformity,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
