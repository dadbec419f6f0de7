"""Lenses that are not quite what was designed: heights that err, parts that move, and their light."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .height_errors import (
        HeightSum as HeightSum,
        Power,
        Sine as Sine,
        SplineHeight,
        random_field as random_field,
        shortest_period,
    )
    from .light_limits import RISE, LightJudge, LightNumbers
    from .linear_light import LinearLight
    from .perturbation import NOMINAL, Perturbation as Perturbation
    from .shop_words import HEAD, effect_rows, limit_words, shop_sentences
    from .tolerance_effects import ToleranceBudget, ToleranceEffect
    from .tolerance_names import Tolerance, tolerances_of as tolerances_of
    from .tolerance_trials import tolerance_budget
    from .traced_light import PerturbedLight as PerturbedLight

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
