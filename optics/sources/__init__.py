"""Rays of every kind of source."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.sources.cells import (
        SourceCells as SourceCells,
        beam_cells as beam_cells,
        cone_cells as cone_cells,
        corner_flux as corner_flux,
        tilted_cells as tilted_cells,
    )
    from optics.sources.collimated import (
        collimated_beam as collimated_beam,
    )
    from optics.sources.divergence import (
        Divergence as Divergence,
    )
    from optics.sources.profile import (
        Profile as Profile,
    )
    from optics.sources.rays import (
        BEFORE as BEFORE,
        RayGrid as RayGrid,
        Rays as Rays,
        require_rays as require_rays,
        single_rays as single_rays,
    )
    from optics.sources.spreading import (
        MIRRORS as MIRRORS,
        area_parts as area_parts,
        concentric as concentric,
        lambertian_parts as lambertian_parts,
        mirror_half as mirror_half,
        mirror_images as mirror_images,
        point_rays as point_rays,
    )

_FILES = {
    "cells": (
        "SourceCells",
        "beam_cells",
        "cone_cells",
        "corner_flux",
        "tilted_cells",
    ),
    "collimated": ("collimated_beam",),
    "divergence": ("Divergence",),
    "profile": ("Profile",),
    "rays": (
        "BEFORE",
        "RayGrid",
        "Rays",
        "require_rays",
        "single_rays",
    ),
    "spreading": (
        "MIRRORS",
        "area_parts",
        "concentric",
        "lambertian_parts",
        "mirror_half",
        "mirror_images",
        "point_rays",
    ),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
