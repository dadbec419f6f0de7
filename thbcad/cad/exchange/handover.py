"""The lens as a solid of build123d and of cadquery.

Both libraries wrap OCCT shapes and share one OCP with this package: the shape is handed over, not
copied, so that points and knots are those of the lens, bit for bit.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from thbcad.cad.shapes import Part, lens_part
from thbcad.checks import require_type
from thbcad.doors import pip_command
from thbcad.lens import Lens

if TYPE_CHECKING:  # they take seconds to load
    import build123d
    import cadquery

GLASS = (0.65, 0.82, 0.98, 0.35)  # red, green, blue, opacity: pale blue, see-through


def to_build123d(lens: Lens | Part, name: str = "lens") -> build123d.Solid:
    """Return the lens as a build123d solid in mm, with its name as label and a pale blue see-through colour.

    lens : Lens, or its Part where the faces are wanted by name too (`named_faces`).
    Front vertex at the origin, z along the optical axis: `build123d.Pos` and `Rot` move the solid.

    Raises
    ------
    ImportError : build123d is not installed, or beside another OCP.
    ValueError : something else than a Lens or a Part.
    """
    bd = library("build123d")
    return bd.Solid(_part(lens).solid, label=name, color=bd.Color(*GLASS))


def to_cadquery(lens: Lens | Part) -> cadquery.Solid:
    """Return the lens as a cadquery solid in mm, for `cadquery.Workplane(obj=...)` and
    `cadquery.Assembly().add(...)`.

    Raises
    ------
    ImportError : cadquery is not installed, or beside another OCP.
    ValueError : something else than a Lens or a Part.
    """
    return library("cadquery").Solid(_part(lens).solid)


def named_faces(lens: Lens | Part) -> dict[str, build123d.Face]:
    """Return {name: build123d face}: front, rear, edge -y, edge +x, edge +y, edge -x, normals outward.

    Faces of a Part are those of `to_build123d` of the same Part, not copies: their edges can be
    chamfered on that solid, and planes and joints can be put on them.

    Raises
    ------
    ImportError : build123d is not installed, or beside another OCP.
    ValueError : something else than a Lens or a Part.
    """
    bd = library("build123d")
    part = _part(lens)
    return {name: bd.Face(face, label=name) for name, face in zip(part.names, part.faces)}


def _part(lens: Lens | Part) -> Part:
    require_type("lens", lens, Lens, Part)
    return lens if isinstance(lens, Part) else lens_part(lens)


def library(name: str) -> Any:
    """Return build123d or cadquery; raise ImportError with the command that installs it."""
    try:
        return import_module(name)
    except ImportError as error:
        raise ImportError(f"{name} cannot be imported ({error}); {pip_command('cad')}") from error
