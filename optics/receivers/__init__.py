"""What receives light: a plane, or the far field, with the chart of its picture."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.receivers.receivers import (
        DEGREES as DEGREES,
        FarField as FarField,
        Plane as Plane,
        Receiver as Receiver,
        receiver_at as receiver_at,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
