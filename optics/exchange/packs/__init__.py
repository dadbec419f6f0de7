"""One zip of a result for people of another program: the part, points, rays, and what light to expect."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .contents import packed
    from .readme import texts

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
