"""Engines: the light of a lens on a screen and its derivatives, and the protocols that every engine obeys."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.light.engines.blurred_engine import (
        BlurredEngine as BlurredEngine,
        sharp_engine as sharp_engine,
    )
    from optics.light.engines.exact_engine import (
        SOFT_RIM as SOFT_RIM,
        ExactEngine as ExactEngine,
        measured_rays as measured_rays,
    )
    from optics.light.engines.light_model import (
        Engine as Engine,
        Film as Film,
        Light as Light,
        LightModel as LightModel,
    )
    from optics.light.engines.traced_model import TracedModel as TracedModel

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
