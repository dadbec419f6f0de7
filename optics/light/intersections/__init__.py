"""Where rays meet a surface, and how the light there follows its coefficients."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.light.intersections.chords import chord
    from optics.light.intersections.hits import (
        DeviceRays,
        Hits,
        KnownHits,
        Stokes,
        Vector,
        device_flux,
        gauge,
        on_device,
        raised_hits,
        rim_fade,
    )
    from optics.light.intersections.placed_surface import PlacedSurface
    from optics.light.intersections.ray_roots import first_crossing, last_root
    from optics.light.intersections.searched_intersections import SearchedHits

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
