"""Checks of the solid in a STEP file by its text, which need no lens."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from math import inf, nan

import numpy as np

from optics.base.runtime import Check
from optics.exchange.verification.step_file import middle_of, optical_form
from thbcad.cad.exchange import SolidState, solid_area, solid_volume
from thbcad.io import MILLIMETRE, Brep, NotMeasured, areas, image_distance, turned_faces, volume
from thbcad.lens import OpticalForm, optical_places
from thbcad.sags import PlacedConic

FINE_VOLUME = 1e-9  # relative
FINE_AREA = 1e-8
MEASURE = 1e-6  # relative, what OCCT's integrals are asked for
TOLERANCE = 1e-6  # mm
SCHEMAS = (
    "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING",
    "AUTOMOTIVE_DESIGN",
    "CONFIG_CONTROL_DESIGN",
)  # AP242, AP214, AP203
EXTRUDED = "area by OCCT: its integral over the wall of an ellipse is off by up to 1e-4 at any tolerance"
OWN_NAMES = ("front", "rear", "face", "back", "edge", "flange", "insert")  # first words of own names of faces


def whole_checks(
    solid: Brep, tolerance: float = TOLERANCE, size: float | None = None
) -> tuple[list[Check], list[str]]:
    """Return the Checks of schema, unit, names, edges and flags, and what is left out.

    tolerance : mm, of edges from their vertices and from their images.
    size : mm, of the unit of length that the file names; None where that must be the millimetre.
    """
    with np.errstate(all="ignore"):  # absurd numbers give inf or nan, which fail
        distance, uncompared = image_distance(solid)
        turned = turned_faces(solid)
    names = Counter(face.name for face in solid.faces if face.name.split(" ")[0] in OWN_NAMES)
    again = sum(names.values()) - len(names)
    places = optical_places([face.name for face in solid.faces])
    if places is not None:
        front, rear = (_middle(optical_form(solid, solid.faces[k])) for k in places)
        again += int(not front < rear)
    not_mm = Check.none_of("text of the file: unit of length that is not mm", solid.unit != MILLIMETRE)
    unit_of_length = [not_mm] if size is None or (size == 1 and solid.unit != MILLIMETRE) else []
    other = not any(word.startswith(SCHEMAS) for word in solid.labels["schema"])
    return [
        Check.none_of("text of the file: schema that is none of AP203, AP214, AP242", other),
        *unit_of_length,
        Check.none_of("text of the file: edges that do not border two faces", solid.unpaired),
        Check.none_of("text of the file: edges that do not begin where the one before ends", solid.gaps),
        Check(
            "text of the file: edges from their vertices and from their curves in the faces' parameters",
            distance * (size or 1.0),
            tolerance,
            "mm",
        ),
        Check.none_of("text of the file: faces on the wrong side of their loops", turned),
        Check.none_of(
            "text of the file: splines closed or crossing by their flags alone", solid.contradictions
        ),
        Check.none_of("text of the file: faces with a name that belongs to another", again),
    ], [f"distance from curves in the faces' parameters: {what}" for what in uncompared]


def measure_checks(solid: Brep, state: SolidState) -> tuple[list[Check], list[str]]:
    """Return the Checks of volume and area by OCCT against quadrature over the text, and what is left out.

    Solids with faces or edges of other kinds (`NotMeasured`) are left out: OCCT alone measures them.  Where
    volume and area of another solid are not found, their checks fail.
    """
    with np.errstate(all="ignore"):
        try:
            area, whole = _or_inf(lambda whole: sum(areas(whole)), solid), _or_inf(volume, solid)
        except NotMeasured as error:
            inside_out = Check.none_of("solid without a volume, by OCCT", not state.volume > 0)
            by_occt = f"OCCT alone finds {state.volume:.9g} mm3 and {state.area:.9g} mm2"
            return [inside_out], [
                f"volume and area by quadrature over the text of the file: {error}; {by_occt}"
            ]
        # OCCT's estimates of its own error are too low on rough and on steep surfaces: then ask for more
        volume_by_occt, area_by_occt = state.volume, state.area
        if abs(volume_by_occt / whole - 1) > MEASURE:
            volume_by_occt = solid_volume(state.shape, FINE_VOLUME)
        pairs = [("volume", volume_by_occt, whole)]
        swept = any(face.extrusion is not None for face in solid.faces)
        if not swept:
            if abs(area_by_occt / area - 1) > MEASURE:
                area_by_occt = solid_area(state.shape, FINE_AREA)
            pairs.append(("area", area_by_occt, area))
        by_text = "by OCCT against quadrature over the text of the file, relative"
        return [
            Check(f"{name} {by_text}", abs(found / wanted - 1), MEASURE, "") for name, found, wanted in pairs
        ], [EXTRUDED] * swept


def _or_inf(measure: Callable[[Brep], float], solid: Brep) -> float:
    """Return a measure of a solid, inf where it is not found: a solid that does not close or is inside out,
    numbers too large."""
    try:
        return measure(solid)
    except NotMeasured:
        raise
    except ValueError:
        return inf


def _middle(form: OpticalForm | None) -> float:
    """Return z at the vertex of a conic or at the middle of a spline's parameters, nan for others."""
    if form is None:
        return nan
    if isinstance(form, PlacedConic):
        return form.vertex
    return float(middle_of(form)[2])
