"""Lenses that are not quite what was designed: heights that err, parts that move, and their light."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .height_errors import (
        HeightSum as HeightSum,
        Power as Power,
        Sine as Sine,
        SplineHeight as SplineHeight,
        random_field as random_field,
        shortest_period as shortest_period,
    )
    from .light_limits import RISE as RISE
    from .linear_light import LinearLight as LinearLight
    from .perturbation import (
        NOMINAL as NOMINAL,
        ElementErrors as ElementErrors,
        Perturbation as Perturbation,
    )
    from .shop_words import HEAD as HEAD, effect_rows as effect_rows, shop_sentences as shop_sentences
    from .tolerance_effects import ToleranceBudget as ToleranceBudget, ToleranceEffect as ToleranceEffect
    from .tolerance_names import Tolerance as Tolerance, tolerances_of as tolerances_of
    from .tolerance_trials import tolerance_budget as tolerance_budget
    from .traced_light import PerturbedLight as PerturbedLight

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
