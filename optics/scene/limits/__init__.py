"""The limits of manufacture that a problem sets: by how much a lens misses them, and what would help."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.scene.limits.limit_cost import LimitCost, active_sentence, costs_light, names_cost
    from optics.scene.limits.manufacture_text import LitPart, as_data, bound_data, manufacture_rows, position
    from optics.scene.limits.misses import (
        Miss,
        feature_levels,
        limit_advice,
        limit_checks,
        limit_misses,
        require_limits,
    )
    from optics.scene.limits.remedies import KEPT_THICKNESS, limit_sentences

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
