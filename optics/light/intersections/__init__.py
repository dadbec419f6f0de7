"""Where rays meet a surface, and how the light there follows its coefficients."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.light.intersections.chords import chord as chord
    from optics.light.intersections.hits import (
        DeviceRays as DeviceRays,
        Hits as Hits,
        KnownHits as KnownHits,
        Vector as Vector,
        device_flux as device_flux,
        gauge as gauge,
        on_device as on_device,
        raised_hits as raised_hits,
        rim_fade as rim_fade,
    )
    from optics.light.intersections.ray_roots import first_crossing as first_crossing, last_root as last_root
    from optics.light.intersections.searched_intersections import SearchedHits as SearchedHits
    from optics.light.intersections.spline_table import PlacedSurface as PlacedSurface

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
