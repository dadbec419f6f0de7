"""Colour: the CIE observer and illuminants, spectra as few lines, and pictures in sRGB."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.colour.chromaticities import (
        chromaticity as chromaticity,
        chromaticity_distance as chromaticity_distance,
    )
    from optics.colour.cie_tables import (
        ILLUMINANTS as ILLUMINANTS,
        colour_matching as colour_matching,
        illuminant as illuminant,
    )
    from optics.colour.reduced_spectra import (
        MOST_LINES as MOST_LINES,
        SpectralLine as SpectralLine,
        spectral_lines as spectral_lines,
        white_of as white_of,
    )
    from optics.colour.srgb_pictures import encoded_srgb as encoded_srgb, srgb as srgb

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
