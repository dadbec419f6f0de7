"""The numbers of OCCT surfaces: compared bit for bit, as sets of points, and moved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from OCP.Geom import (
    Geom_BSplineSurface,
    Geom_CylindricalSurface,
    Geom_ElementarySurface,
    Geom_Ellipse,
    Geom_RectangularTrimmedSurface,
    Geom_SphericalSurface,
    Geom_Surface,
    Geom_SurfaceOfLinearExtrusion,
)
from OCP.gp import gp_Trsf

from thbcad.checks import Floats

SPLINE, PLANE, SPHERE = "Geom_BSplineSurface", "Geom_Plane", "Geom_SphericalSurface"
LEFT_OUT = 1e-9  # of knots, weights and radii: STEP files of other programs have 10 digits or more


@dataclass(frozen=True, eq=False)
class SurfaceNumbers:
    """The numbers of a surface: what stays as it is under rigid motions, and what moves.

    kind : the type of the surface, with the degrees of a spline
    fixed : (n,) float, knots with their multiplicities and weights, or radii
    moved : (m, 3) float, poles in mm, or the origin of another surface and its three unit axes
    """

    kind: str
    fixed: Floats
    moved: Floats

    def matches(self, other: SurfaceNumbers) -> bool:
        """Return whether a motion can make the one of the other: one kind, the fixed numbers but for the
        digits that other programs leave out."""
        same = self.kind == other.kind and self.fixed.shape == other.fixed.shape
        return same and np.allclose(self.fixed, other.fixed, rtol=LEFT_OUT, atol=LEFT_OUT)

    def moved_by(self, matrix: Floats) -> SurfaceNumbers:
        """Return the numbers after a motion: a rotation beside a shift in mm, (3, 4) float."""
        rows = self.moved @ matrix[:, :3].T
        rows[: None if self.is_spline else 1] += matrix[:, 3]
        return SurfaceNumbers(self.kind, self.fixed, rows)

    def same_points(self, other: SurfaceNumbers, tolerance: float) -> bool:
        """Return whether two surfaces are the same set of points within a tolerance, mm.

        Planes may have any origin in them and spheres any axes; splines must have the same poles.
        """
        if not self.matches(other) or not self.moved.size:
            return False
        if self.kind == PLANE:
            (origin, *_, normal), (there, *_, along) = self.moved, other.moved
            turned = np.linalg.norm(np.cross(normal, along)) * (1 + np.linalg.norm(origin - there))
            return bool(abs((origin - there) @ along) <= tolerance and turned <= tolerance)
        count = 1 if self.kind == SPHERE else None
        return bool(np.abs(self.moved[:count] - other.moved[:count]).max() <= tolerance)

    @property
    def is_spline(self) -> bool:
        """Whether the surface is a spline."""
        return self.kind.startswith(SPLINE)

    def differing(self, other: SurfaceNumbers) -> int:
        """Return how many numbers differ; all of them where kinds or sizes do."""
        if (self.kind, self.fixed.shape, self.moved.shape) != (
            other.kind,
            other.fixed.shape,
            other.moved.shape,
        ):
            return self.fixed.size + self.moved.size
        return int((self.fixed != other.fixed).sum() + (self.moved != other.moved).sum())


def surface_numbers(geom: Geom_Surface) -> SurfaceNumbers:
    """Return the SurfaceNumbers of an OCCT surface, of its basis where it is a trimmed one.

    Surfaces that are neither splines, nor planes, spheres and their like, nor cylinders over ellipses have no
    numbers.
    """
    while isinstance(geom, Geom_RectangularTrimmedSurface):
        geom = geom.BasisSurface()
    kind = geom.DynamicType().Name()
    if isinstance(geom, Geom_BSplineSurface):
        return _of_spline(geom)
    if isinstance(geom, Geom_ElementarySurface):
        frame, along = geom.Position(), geom.Position().Direction()
        has_radius = isinstance(geom, (Geom_SphericalSurface, Geom_CylindricalSurface))
        radii = [geom.Radius()] if has_radius else []
    elif isinstance(geom, Geom_SurfaceOfLinearExtrusion) and isinstance(geom.BasisCurve(), Geom_Ellipse):
        conic = geom.BasisCurve()
        frame, along = conic.Position(), geom.Direction()
        radii = [conic.MajorRadius(), conic.MinorRadius()]
    else:
        return SurfaceNumbers(kind, np.empty(0), np.empty((0, 3)))
    rows = frame.Location(), frame.XDirection(), frame.YDirection(), along
    return SurfaceNumbers(kind, np.array(radii), np.array([row.Coord() for row in rows]))


def _of_spline(geom: Geom_BSplineSurface) -> SurfaceNumbers:
    rows, columns = range(1, geom.NbUPoles() + 1), range(1, geom.NbVPoles() + 1)
    poles = np.array([geom.Pole(i, j).Coord() for i in rows for j in columns])
    u, v = zip(geom.UKnots(), geom.UMultiplicities()), zip(geom.VKnots(), geom.VMultiplicities())
    fixed = np.ravel([*u, *v])
    kind = f"{SPLINE} {geom.UDegree()} {geom.VDegree()} {len(rows)} {len(columns)}"
    if geom.IsURational() or geom.IsVRational():
        kind += " rational"
        fixed = np.concatenate([fixed, [geom.Weight(i, j) for i in rows for j in columns]])
    return SurfaceNumbers(kind, fixed, poles)


def rigid_motion(start: SurfaceNumbers, end: SurfaceNumbers) -> gp_Trsf | None:
    """Return the motion that takes the moved numbers of one surface to those of another that `matches` it.

    Frames of planes and spheres give it at once, poles by least squares (Kabsch): R = U diag(1, 1, d) V^T of
    the covariance U S V^T.  None where the points lie on a line.

    Source: W. Kabsch, Acta Cryst. A32 (1976) 922.
    """
    if start.is_spline:
        a, b = (rows.moved.mean(axis=0) for rows in (start, end))
        u, s, v = np.linalg.svd((end.moved - b).T @ (start.moved - a))
        if s[1] <= 1e-9 * s[0]:  # of the size of the net: rounding
            return None
        rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    elif len(start.moved):
        a, b = start.moved[0], end.moved[0]
        rotation = end.moved[1:].T @ start.moved[1:]
    else:
        return None
    motion = gp_Trsf()
    motion.SetValues(*np.column_stack([rotation, b - rotation @ a]).ravel().tolist())
    return motion


def matrix_of(trsf: gp_Trsf) -> Floats:
    """Return a gp_Trsf as a matrix (3, 4), a rotation beside a shift in mm."""
    return np.array([[trsf.Value(i, j) for j in range(1, 5)] for i in range(1, 4)])
