"""Names of OCCT that its Python package calls differently before and since version 8.0.

Since 8.0 all collections lie in `OCP.collections`, the functions that cast a shape to its kind have lost
their `_s`, and the limits of a box come one by one.  Everything else is imported from `OCP` where it is used.
"""

from OCP.Bnd import Bnd_Box, Bnd_Box2d
from OCP.TopoDS import TopoDS

try:
    from OCP.collections import (
        Array1_double as RealArray,
        Array1_gp_Pnt as PointArray,
        Array1_int as IntegerArray,
        IndexedDataMap_TopoDS_Shape_List_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeOwners,
        IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeNumbers,
        List_TopoDS_Shape as ShapeList,
        Sequence_TDF_Label as Labels,
    )
except ImportError:
    from OCP.TColgp import TColgp_Array1OfPnt as PointArray
    from OCP.TColStd import TColStd_Array1OfInteger as IntegerArray, TColStd_Array1OfReal as RealArray
    from OCP.TDF import TDF_LabelSequence as Labels
    from OCP.TopTools import (
        TopTools_IndexedDataMapOfShapeListOfShape as ShapeOwners,
        TopTools_IndexedMapOfShape as ShapeNumbers,
        TopTools_ListOfShape as ShapeList,
    )

__all__ = [
    "IntegerArray",
    "Labels",
    "PointArray",
    "RealArray",
    "ShapeList",
    "ShapeNumbers",
    "ShapeOwners",
    "as_edge",
    "as_face",
    "as_shell",
    "as_solid",
    "as_vertex",
    "box_limits",
]

as_edge, as_face, as_shell, as_solid, as_vertex = (
    getattr(TopoDS, kind, None) or getattr(TopoDS, f"{kind}_s")
    for kind in ("Edge", "Face", "Shell", "Solid", "Vertex")
)


def box_limits(box: Bnd_Box | Bnd_Box2d) -> tuple[float, ...]:
    """Return the least and the greatest coordinates of a box, its gap included."""
    if not hasattr(box, "GetXMin"):
        return tuple(box.Get())
    axes = "XYZ" if isinstance(box, Bnd_Box) else "XY"
    return tuple(getattr(box, f"Get{axis}{end}")() for end in ("Min", "Max") for axis in axes)
