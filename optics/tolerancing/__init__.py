"""What becomes of the light where lens, source or target are not quite what was designed."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.tolerancing.light_limits import RISE as RISE, LightNumbers as LightNumbers
    from optics.tolerancing.linear_light import LinearLight as LinearLight
    from optics.tolerancing.perturbation import NOMINAL as NOMINAL, Perturbation as Perturbation
    from optics.tolerancing.perturbed_parts import perturbed_lens as perturbed_lens
    from optics.tolerancing.shop_words import (
        HEAD as HEAD,
        effect_rows as effect_rows,
        shop_sentences as shop_sentences,
    )
    from optics.tolerancing.tolerance_effects import (
        ToleranceBudget as ToleranceBudget,
        ToleranceEffect as ToleranceEffect,
    )
    from optics.tolerancing.tolerance_names import Tolerance as Tolerance, tolerances_of as tolerances_of
    from optics.tolerancing.tolerance_trials import tolerance_budget as tolerance_budget
    from optics.tolerancing.traced_light import (
        PerturbedLight as PerturbedLight,
        perturbed_light as perturbed_light,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
