"""Units in watts or lumens, uniformity, beam and field angle; colour: the CIE observer, spectra, sRGB."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.scene.photometry.cie_tables import chromaticity_distance
    from optics.scene.photometry.illuminant_names import ILLUMINANTS
    from optics.scene.photometry.intensity_planes import (
        BEAM as BEAM,
        FIELD as FIELD,
        plane_curves as plane_curves,
    )
    from optics.scene.photometry.light_units import PER_STERADIAN, Density, Units, units_of
    from optics.scene.photometry.lit_region import RASTER, LitRegion as LitRegion, edge_width
    from optics.scene.photometry.reduced_spectra import spectral_lines as spectral_lines, white_of as white_of
    from optics.scene.photometry.regulation_tables import REGULATIONS, regulation
    from optics.scene.photometry.srgb_pictures import encoded_srgb, srgb as srgb
    from optics.scene.photometry.uniformity_grid import BoxGrid as BoxGrid, Uniformity

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
