"""Lenses that are not quite what was designed: heights that err, parts that move, and their light."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.tolerancing.perturbations.height_errors import (
        HeightSum as HeightSum,
        Power as Power,
        Sine as Sine,
        SplineHeight as SplineHeight,
        random_field as random_field,
        shortest_period as shortest_period,
    )
    from optics.tolerancing.perturbations.light_limits import RISE as RISE
    from optics.tolerancing.perturbations.linear_light import LinearLight as LinearLight
    from optics.tolerancing.perturbations.perturbation import NOMINAL as NOMINAL, Perturbation as Perturbation
    from optics.tolerancing.perturbations.shop_words import (
        HEAD as HEAD,
        effect_rows as effect_rows,
        shop_sentences as shop_sentences,
    )
    from optics.tolerancing.perturbations.tolerance_effects import (
        ToleranceBudget as ToleranceBudget,
        ToleranceEffect as ToleranceEffect,
    )
    from optics.tolerancing.perturbations.tolerance_names import (
        Tolerance as Tolerance,
        tolerances_of as tolerances_of,
    )
    from optics.tolerancing.perturbations.tolerance_trials import tolerance_budget as tolerance_budget
    from optics.tolerancing.perturbations.traced_light import (
        PerturbedLight as PerturbedLight,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
