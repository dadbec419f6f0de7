"""Front and rear of a lens as OCCT surfaces with exact rims: planes, spheres, rational patches, splines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from OCP.Geom import (
    Geom_Circle,
    Geom_Curve,
    Geom_Ellipse,
    Geom_Hyperbola,
    Geom_Line,
    Geom_Plane,
    Geom_SphericalSurface,
    Geom_Surface,
)
from OCP.Geom2d import Geom2d_Curve
from OCP.gp import gp_Ax2, gp_Ax3, gp_Dir, gp_Pln, gp_Pnt
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from thbcad.cad.shapes.occt_splines import geom_curve, geom_surface, rational_geom, trace
from thbcad.cad.shapes.topology import face_on, side_line, turned_face
from thbcad.checks import Floats
from thbcad.lens import SIDES, Corner, OpticalForm, Side, rim
from thbcad.outlines import fitted_curve
from thbcad.sags import ConicSection, PlacedConic
from thbcad.splines import BSplineSurface

Points = Callable[[Floats], Floats]  # of parameters (n,), returns (n, 3), mm


@dataclass(frozen=True, eq=False)
class RimCurve:
    """A curve along a side, x or y rising from its first parameter to its last.

    points : of parameters.  spline : whether it is a spline over the parameters of `placed_surfaces`
    """

    curve: Geom_Curve
    ends: tuple[float, float]
    points: Points
    spline: bool = False


class Form(Protocol):
    """The surface of front or rear."""

    @property
    def upward(self) -> bool:
        """Whether the normal of its parametrisation points to +z."""

    def surface(self) -> Geom_Surface:
        """Return it as an OCCT surface."""

    def corner(self, corner: Corner) -> Floats:
        """Return a corner, (3,), mm."""

    def rim(self, side: Side) -> RimCurve:
        """Return the curve along a side."""

    def side_trace(self, side: Side) -> Geom2d_Curve | None:
        """Return the image of that curve in its parameters; None where OCCT needs none."""


def form_of(surface: OpticalForm) -> Form:
    """Return the Form of a surface."""
    return SplineForm(surface) if isinstance(surface, BSplineSurface) else ConicForm(surface)


@dataclass(frozen=True, eq=False)
class SplineForm:
    """The `Form` of a spline, x and y linear in the parameters."""

    spline: BSplineSurface

    upward = True

    def surface(self) -> Geom_Surface:
        return geom_surface(self.spline)

    def corner(self, corner: Corner) -> Floats:
        return self.spline.coefficients[corner]

    def rim(self, side: Side) -> RimCurve:
        kv, poles = rim(self.spline, side)
        return RimCurve(geom_curve(kv, poles), (kv.start, kv.stop), lambda t: kv.collocation(t) @ poles, True)

    def side_trace(self, side: Side) -> Geom2d_Curve | None:
        return side_line(self.spline, side)


@dataclass(frozen=True, eq=False)
class ConicForm:
    """The `Form` of a plane, of a sphere, or of an ellipsoid or hyperboloid as a rational patch.

    Images of curves lie within 1e-9 mm at eight points of every span; on planes OCCT needs none.
    """

    conic: PlacedConic

    @property
    def upward(self) -> bool:
        # OCCT's normal of a sphere points away from its centre
        return self.conic.kind != "SPHERE" or self.conic.side > 0

    def surface(self) -> Geom_Surface:
        if self.conic.kind == "PLANE":
            point, normal, first = self.conic.numbers.reshape(3, 3).tolist()
            return Geom_Plane(gp_Pln(gp_Ax3(gp_Pnt(*point), gp_Dir(*normal), gp_Dir(*first))))
        if self.conic.kind != "SPHERE":
            return rational_geom(self.conic.patch)
        centre, axis, first = self.conic.sphere.tolist()
        placement = gp_Ax3(gp_Pnt(*centre), gp_Dir(*axis), gp_Dir(*first))
        return Geom_SphericalSurface(placement, abs(self.conic.conic.radius))

    def corner(self, corner: Corner) -> Floats:
        x, y = (h if end else -h for h, end in zip(self.conic.half_width, corner))
        return np.array([x, y, self.conic(x, y)])

    def rim(self, side: Side) -> RimCurve:
        if self.conic.kind == "PLANE":
            start, stop = self.corner(side.start), self.corner(side.stop)
            direction = np.eye(3)[side.axis]
            line = Geom_Line(gp_Pnt(*start.tolist()), gp_Dir(*direction.tolist()))
            length = float((stop - start)[side.axis])
            return RimCurve(line, (0.0, length), lambda t: start + np.outer(t, direction))
        half = self.conic.half_width[1 - side.axis]
        section = self.conic.section(side.axis, half if side.end else -half)
        return RimCurve(_geom_section(section), section.ends, section.points)

    def side_trace(self, side: Side) -> Geom2d_Curve | None:
        along = self.rim(side)
        return self.trace(along.points, along.ends)

    def trace(self, points: Points, ends: tuple[float, float]) -> Geom2d_Curve | None:
        """Return the image of a curve on it in its parameters; None on planes."""
        if self.conic.kind == "PLANE":
            return None
        # angles times the radius are lengths
        unit = abs(self.conic.conic.radius) if self.conic.kind == "SPHERE" else 1.0
        return _fitted(lambda t: self.conic.parameters(points(t)), ends, unit)


def optical_face(form: Form, loop: Sequence[TopoDS_Shape], outward: bool) -> TopoDS_Face:
    """Return the face of front or rear within the edges along its sides, counter-clockwise seen from +z.

    outward : whether its normal points to +z, as that of the rear
    """
    face = face_on(form.surface(), loop, form.upward, map(form.side_trace, SIDES))
    return turned_face(face, form.upward != outward)


def ruled_trace(rim_curve: RimCurve, side: Side, panel: BSplineSurface, v: float) -> Geom2d_Curve | None:
    """Return the image of a rim on the side v = const of a ruled edge; None where it is a spline of the same
    parameter.

    panel : as `ruled_edge`; its first parameter is linear in x or y along the side
    """
    if rim_curve.spline:
        return None
    first, last = rim_curve.points(np.array(rim_curve.ends))[:, side.axis]
    scale = (panel.kv_u.stop - panel.kv_u.start) / (last - first)

    def image(t: Floats) -> Floats:
        along = panel.kv_u.start + scale * (rim_curve.points(t)[:, side.axis] - first)
        return np.column_stack([along, np.full(len(t), v)])

    return _fitted(image, rim_curve.ends)


def _fitted(image: Points, ends: tuple[float, float], unit: float = 1.0) -> Geom2d_Curve:
    """Return a curve in parameters as a spline; unit : mm, about, for a step of one parameter."""
    kv, poles = fitted_curve(lambda t: unit * image(t), np.array(ends), np.ones(2, dtype=np.int64))
    return trace(kv, poles / unit)


def _geom_section(section: ConicSection) -> Geom_Curve:
    centre, axis, first = section.placement.tolist()
    axes = gp_Ax2(gp_Pnt(*centre), gp_Dir(*axis), gp_Dir(*first))
    a, b = section.sizes.tolist()
    if section.kind == "CIRCLE":
        return Geom_Circle(axes, a)
    return Geom_Hyperbola(axes, a, b) if section.kind == "HYPERBOLA" else Geom_Ellipse(axes, a, b)
