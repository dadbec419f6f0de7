"""Engines: the light of a lens on a screen and its derivatives, and the protocols that every engine obeys."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.light.engines.blurred_engine import BlurredEngine, sharp_engine
    from optics.light.engines.exact_engine import SOFT_RIM, DrawnRays, ExactEngine, measured_rays
    from optics.light.engines.joint_model import JointModel, light_within
    from optics.light.engines.light_model import Engine, Film, Light, LightModel
    from optics.light.engines.traced_model import TracedModel

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
