"""The light asked for, and light measured on its pixels."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.target.formula import formula_light as formula_light, formula_pixels as formula_pixels
    from optics.target.mapped_cells import MappedCells as MappedCells
    from optics.target.picture import fit_picture as fit_picture, read_picture as read_picture
    from optics.target.regions import uniform_region as uniform_region
    from optics.target.screen import Screen as Screen, lit_part as lit_part
    from optics.target.splat import Splat as Splat
    from optics.target.windows import (
        BoxWindow as BoxWindow,
        BSplineWindow as BSplineWindow,
        GaussianWindow as GaussianWindow,
        PixelWindow as PixelWindow,
        Window as Window,
        filter_image as filter_image,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
