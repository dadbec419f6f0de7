"""What receives light: receivers, their pixels and windows, and the light that is asked for on them."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.scene.receivers.curved_receivers import Cylinder, Sphere
    from optics.scene.receivers.fitted_picture import divided, fit_picture, merged
    from optics.scene.receivers.formula import formula_light, formula_pixels, require_quick
    from optics.scene.receivers.picture import read_picture
    from optics.scene.receivers.receivers import (
        DEGREES,
        FarField,
        Plane as Plane,
        Receiver,
        Triple,
        receiver_at,
        seen_from,
    )
    from optics.scene.receivers.regions import uniform_region
    from optics.scene.receivers.screen import Screen as Screen, lit_part, with_mirror_images
    from optics.scene.receivers.smooth_light import smoothest_light
    from optics.scene.receivers.windows import (
        BoxWindow,
        BSplineWindow,
        GaussianWindow,
        PixelWindow,
        Window,
        filter_image,
    )
    from optics.scene.receivers.zones import (
        ZoneRow,
        chart_of_goniometer as chart_of_goniometer,
        zone_places,
        zone_rows,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
