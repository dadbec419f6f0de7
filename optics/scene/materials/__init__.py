"""What lenses are made of: refractive index by wavelength, absorption, density, and their uncertainty."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.scene.materials.base_table import MATERIALS as MATERIALS
    from optics.scene.materials.material_names import find_material, refractive_index as refractive_index
    from optics.scene.materials.material_record import Material, tabulated

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
