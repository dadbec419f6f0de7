"""Errors of the height of a surface, as functions dh(x, y) with their slopes."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.heights.height_errors import (
        HeightSum as HeightSum,
        Power as Power,
        Sine as Sine,
        SplineHeight as SplineHeight,
    )
    from optics.heights.random_fields import random_field as random_field, shortest_period as shortest_period

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
