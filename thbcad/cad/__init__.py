"""CAD exchange; only this package imports OpenCASCADE."""

from thbcad.doors import TYPE_CHECKING, lazy_door, require_one_occt

require_one_occt()

if TYPE_CHECKING:
    from .exchange import (
        named_faces as named_faces,
        read_curves as read_curves,
        read_faces as read_faces,
        read_step as read_step,
        to_build123d as to_build123d,
        to_cadquery as to_cadquery,
        write_curves as write_curves,
        write_faces as write_faces,
    )
    from .foreign import ForeignLens as ForeignLens, read_lens_solid as read_lens_solid
    from .parts import (
        LensPart as LensPart,
        cut as cut,
        join as join,
        workplane as workplane,
        write_step as write_step,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__, public=True)
