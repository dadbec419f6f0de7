"""The wall that tapers from a level outline by a draft angle: tilted planes and cones."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from OCP.Geom import Geom_ConicalSurface, Geom_Curve, Geom_Line, Geom_Plane, Geom_Surface
from OCP.Geom2d import Geom2d_Line
from OCP.gp import gp_Ax3, gp_Dir, gp_Dir2d, gp_Pln, gp_Pnt, gp_Pnt2d
from OCP.TopoDS import TopoDS_Face

from thbcad.cad.occt_names import as_face
from thbcad.cad.shapes.occt_splines import geom_curve, trace
from thbcad.cad.shapes.walls import Ring, UprightWall, level_curve, ring_along, start_of, traced, wall_faces
from thbcad.moulds import DraftedWall, Foot
from thbcad.outlines import Arc


@dataclass(frozen=True, eq=False)
class TaperedWall:
    """The `Wall` of a DraftedWall that is not upright; v is the length along its steepest lines, from the
    level on towards its wider side.

    The axes of its cones point to that side, since files hold no negative angles: on a wall above its level s
    runs clockwise.
    """

    drafted: DraftedWall

    @property
    def ends(self) -> Sequence[tuple[float, float]]:
        below = self.drafted.side < 0
        return [p.ends if below else (-p.ends[0], -p.ends[1]) for p in self.drafted.outline.pieces]

    def _v(self, z: float) -> float:
        drafted = self.drafted
        return -drafted.side * (z - drafted.level) / float(np.cos(np.radians(drafted.draft)))

    def surface(self, panel: int) -> Geom_Surface:
        drafted = self.drafted
        piece = drafted.outline.pieces[panel]
        if isinstance(piece, Arc):
            axes = gp_Ax3(gp_Pnt(*piece.centre, drafted.level), gp_Dir(0, 0, -drafted.side), gp_Dir(1, 0, 0))
            return Geom_ConicalSurface(axes, np.radians(drafted.draft), piece.semi_axes[0])
        step = np.subtract(piece.stop, piece.start)
        outward = np.array([step[1], -step[0]]) / np.hypot(*step)
        normal = gp_Dir(*outward.tolist(), drafted.side * drafted.slope)
        return Geom_Plane(gp_Pln(gp_Pnt(*piece.start, drafted.level), normal))

    def strut(self, corner: int) -> Geom_Curve:
        drafted = self.drafted
        below, above = (
            start_of(drafted.at(z).pieces[corner], z) for z in (drafted.level, drafted.level + drafted.side)
        )
        # v = 1 for the same height on every line, so that all rings have one v at a height
        return Geom_Line(gp_Pnt(*below.tolist()), gp_Dir(*(below - above).tolist()))

    def _along_strut(self, corner: int, z: float) -> float:
        drafted = self.drafted
        low, high = (start_of(drafted.at(a).pieces[corner], a) for a in (drafted.level, z))
        return -drafted.side * float(np.sign(z - drafted.level)) * float(np.linalg.norm(high - low))

    def level(self, z: float) -> Ring:
        pieces = self.drafted.at(z).pieces
        ring = ring_along([level_curve(p, z) for p in pieces], [start_of(p, z) for p in pieces])
        turn = -self.drafted.side
        image = Geom2d_Line(gp_Pnt2d(0.0, self._v(z)), gp_Dir2d(turn, 0))
        return self._traced(ring, [image] * len(pieces))

    def rim(self, foot: Foot) -> Ring:
        """Return the ring along the rim of a surface."""
        if foot.level is not None:
            return self.level(foot.level)
        starts = [poles[0] for _, poles in foot.rims]
        ring = ring_along([(geom_curve(*own), *own[0].domain) for own in foot.rims], starts)
        turn, scale = -self.drafted.side, self._v(self.drafted.level + 1)
        images = [
            trace(kv, np.column_stack([turn * kv.greville(), scale * (poles[:, 2] - self.drafted.level)]))
            for kv, poles in foot.rims
        ]
        return self._traced(ring, images)

    def _traced(self, ring: Ring, images: Sequence[Geom2d_Line]) -> Ring:
        heights = [self._along_strut(k, z) for k, z in enumerate(ring.heights)]
        return replace(traced(ring, self.drafted.outline.pieces, images), heights=heights)


def drafted_faces(wall: TaperedWall | UprightWall, low: Ring, high: Ring) -> list[TopoDS_Face]:
    """Return the faces of a wall between two of its rings, the first at the lower height, normals outward."""
    if isinstance(wall, UprightWall) or wall.drafted.side < 0:
        return wall_faces(wall, low, high)
    return [as_face(face.Reversed()) for face in wall_faces(wall, high, low)]
