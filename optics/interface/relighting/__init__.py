"""Finished lenses in other light than they were designed for, and lenses that were there before a problem."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .explored_light import ExploredLight, Explorer
    from .lens_files import given_system, lens_in_light, screen_words
    from .lens_in_problem import given_lens
    from .other_light import other_source, relit
    from .slider_box import sliders

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
