"""What receives light: receivers, their pixels and windows, and the light that is asked for on them."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.scene.receivers.curved_receivers import Cylinder as Cylinder, Sphere as Sphere
    from optics.scene.receivers.fitted_picture import fit_picture as fit_picture
    from optics.scene.receivers.formula import (
        MAX_LENGTH as MAX_LENGTH,
        SUBPOINTS as SUBPOINTS,
        formula_light as formula_light,
        formula_pixels as formula_pixels,
    )
    from optics.scene.receivers.picture import read_picture as read_picture
    from optics.scene.receivers.receivers import (
        DEGREES as DEGREES,
        FarField as FarField,
        Plane as Plane,
        Receiver as Receiver,
        Triple as Triple,
        receiver_at as receiver_at,
        seen_from as seen_from,
    )
    from optics.scene.receivers.regions import uniform_region as uniform_region
    from optics.scene.receivers.screen import Screen as Screen, lit_part as lit_part
    from optics.scene.receivers.windows import (
        BoxWindow as BoxWindow,
        BSplineWindow as BSplineWindow,
        GaussianWindow as GaussianWindow,
        PixelWindow as PixelWindow,
        Window as Window,
        filter_image as filter_image,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
