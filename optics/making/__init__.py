"""What scripts ask of a design that is to be made: what its errors do, one at a time and all at once."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.making.design_errors import (
        SAMPLES as SAMPLES,
        form_tolerances as form_tolerances,
        monte_carlo as monte_carlo,
        require_monte_carlo as require_monte_carlo,
        tolerances as tolerances,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
