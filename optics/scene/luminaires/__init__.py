"""Luminaires: intensities by direction in IES LM-63 and EULUMDAT files, read, sampled and written."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.scene.luminaires.direction_sampling import DirectionSampler
    from optics.scene.luminaires.intensity_record import (
        Luminaire as Luminaire,
        Opening as Opening,
        directions_at as directions_at,
    )
    from optics.scene.luminaires.intensity_sums import IntensityGrid
    from optics.scene.luminaires.luminaire_files import (
        luminaire_writer,
        read_luminaire as read_luminaire,
        write_ies as write_ies,
        write_ldt,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
