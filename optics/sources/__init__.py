"""Rays of every kind of source."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.sources.collimated import (
        Beam as Beam,
        Profile as Profile,
        collimated_beam as collimated_beam,
    )
    from optics.sources.rays import (
        Rays as Rays,
        beam_rays as beam_rays,
        concentric as concentric,
        lambertian_parts as lambertian_parts,
        point_rays as point_rays,
    )

_FILES = {
    "collimated": (
        "Beam",
        "Profile",
        "collimated_beam",
    ),
    "rays": (
        "Rays",
        "beam_rays",
        "concentric",
        "lambertian_parts",
        "point_rays",
    ),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
