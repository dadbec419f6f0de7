"""The lens as a solid of build123d and of cadquery, surfaces as faces, curves as edges.

Both libraries wrap OCCT shapes and share one OCP with this package: the shape is handed over, not
copied, so that points, weights and knots are the same, bit for bit.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, overload

from thbcad.cad.exchange.loose_splines import CURVES, edge_of, face_of
from thbcad.cad.shapes import Part, lens_part
from thbcad.checks import require_type
from thbcad.doors import pip_command
from thbcad.lens import Lens
from thbcad.splines import BSplineSurface, NURBSSurface
from thbcad.surfaces import THBSurface

if TYPE_CHECKING:  # they take seconds to load
    import build123d
    import cadquery

    from thbcad.cad.exchange.loose_splines import Curve, Surface

GEOMETRY = (Lens, Part, THBSurface, BSplineSurface, NURBSSurface, *CURVES)
GLASS = (0.65, 0.82, 0.98, 0.35)  # red, green, blue, opacity: pale blue, see-through


@overload
def to_build123d(geometry: Lens | Part, name: str = "") -> build123d.Solid: ...
@overload
def to_build123d(geometry: Surface, name: str = "") -> build123d.Face: ...
@overload
def to_build123d(geometry: Curve, name: str = "") -> build123d.Edge: ...
def to_build123d(geometry: Any, name: str = "") -> Any:
    """Return a lens as a build123d solid, a surface as a face or a curve as an edge, in mm, with a label.

    geometry : Lens, or its Part where the faces are wanted by name too (`named_faces`): the front vertex is
        at the origin, z along the optical axis, the colour a pale blue, see-through.  Or a surface or a curve
        with points (x, y, z).  `build123d.Pos` and `Rot` move what is returned.
    name : the label; "" is "lens", "surface" or "curve".

    Raises ImportError : build123d is not installed, or beside another OCP.
    Raises ValueError : something else; points without three components.
    Raises RuntimeError : OCCT refuses the surface or the curve.
    """
    bd = library("build123d")
    require_type("geometry", geometry, *GEOMETRY)
    if isinstance(geometry, Lens | Part):
        return bd.Solid(_part(geometry).solid, label=name or "lens", color=bd.Color(*GLASS))
    if isinstance(geometry, CURVES):
        return bd.Edge(edge_of(geometry), label=name or "curve")
    return bd.Face(face_of(geometry), label=name or "surface")


@overload
def to_cadquery(geometry: Lens | Part) -> cadquery.Solid: ...
@overload
def to_cadquery(geometry: Surface) -> cadquery.Face: ...
@overload
def to_cadquery(geometry: Curve) -> cadquery.Edge: ...
def to_cadquery(geometry: Any) -> Any:
    """Return a lens as a cadquery solid, a surface as a face or a curve as an edge, in mm.

    They are for `cadquery.Workplane(obj=...)` and `cadquery.Assembly().add(...)`.

    geometry : as of `to_build123d`, which also raises.
    """
    cq = library("cadquery")
    require_type("geometry", geometry, *GEOMETRY)
    if isinstance(geometry, Lens | Part):
        return cq.Solid(_part(geometry).solid)
    if isinstance(geometry, CURVES):
        return cq.Edge(edge_of(geometry))
    return cq.Face(face_of(geometry))


def named_faces(lens: Lens | Part) -> dict[str, build123d.Face]:
    """Return {name: build123d face}: front, rear, edge -y, edge +x, edge +y, edge -x, normals outward.

    Faces of a Part are those of `to_build123d` of the same Part, not copies: their edges can be
    chamfered on that solid, and planes and joints can be put on them.

    Raises ImportError : build123d is not installed, or beside another OCP.
    Raises ValueError : something else than a Lens or a Part.
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
        raise ImportError(f"{name} cannot be imported ({error}); {pip_command(name)}") from error
