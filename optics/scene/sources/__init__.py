"""Sources of every kind: their rays, where these start, and what may be left out for them."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.scene.sources.cells import (
        SourceCells as SourceCells,
        beam_cells as beam_cells,
        cone_cells as cone_cells,
        corner_flux as corner_flux,
    )
    from optics.scene.sources.collimated import collimated_beam as collimated_beam
    from optics.scene.sources.divergence import Divergence as Divergence
    from optics.scene.sources.file_sources import (
        FileSource as FileSource,
        RayFileSource as RayFileSource,
        placed_rays as placed_rays,
    )
    from optics.scene.sources.light_source import LightSource as LightSource
    from optics.scene.sources.luminaire_source import LuminaireSource as LuminaireSource
    from optics.scene.sources.plain_sources import (
        CollimatedBeam as CollimatedBeam,
        LambertianArea as LambertianArea,
        PointSource as PointSource,
    )
    from optics.scene.sources.profile import Profile as Profile
    from optics.scene.sources.rays import (
        BEFORE as BEFORE,
        RayGrid as RayGrid,
        Rays as Rays,
        require_rays as require_rays,
        single_rays as single_rays,
    )
    from optics.scene.sources.spreading import (
        area_parts as area_parts,
        concentric as concentric,
        lambertian_parts as lambertian_parts,
        mirror_half as mirror_half,
        point_rays as point_rays,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
