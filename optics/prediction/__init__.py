"""What the transport map tells before a design: numbers left to the program, and what to expect."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.prediction.automatic import (
        resolved as resolved,
    )

_FILES = {
    "automatic": ("resolved",),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
