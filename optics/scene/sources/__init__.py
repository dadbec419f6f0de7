"""Sources of every kind: their rays, where these start, and what may be left out for them."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.scene.sources.cells import SourceCells, beam_cells, cone_cells, corner_flux
    from optics.scene.sources.collimated import collimated_beam
    from optics.scene.sources.divergence import Divergence
    from optics.scene.sources.file_sources import FileSource, RayFileSource, placed_rays
    from optics.scene.sources.light_source import LightSource
    from optics.scene.sources.luminaire_source import LuminaireSource
    from optics.scene.sources.placed_sources import PlacedSource, SourceGroup
    from optics.scene.sources.plain_sources import CollimatedBeam, LambertianArea, PointSource
    from optics.scene.sources.profile import Profile
    from optics.scene.sources.rays import BEFORE, RayGrid, Rays, require_rays, single_rays
    from optics.scene.sources.spreading import (
        area_parts,
        concentric,
        mirror_half,
        point_rays,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
