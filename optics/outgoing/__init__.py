"""The light that leaves a lens, for other programs: as rays, and as an intensity over the sphere."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.outgoing.intensity_of_lens import (
        OutgoingIntensity as OutgoingIntensity,
        outgoing_intensity as outgoing_intensity,
    )
    from optics.outgoing.rays_of_lens import (
        outgoing_rays as outgoing_rays,
    )
    from optics.outgoing.steps_on_target import (
        OnTarget as OnTarget,
        StepsOnTarget as StepsOnTarget,
    )

_FILES = {
    "intensity_of_lens": (
        "OutgoingIntensity",
        "outgoing_intensity",
    ),
    "rays_of_lens": ("outgoing_rays",),
    "steps_on_target": (
        "OnTarget",
        "StepsOnTarget",
    ),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
