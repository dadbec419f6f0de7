"""The glass and the light of a part: proven free of its other faces, or traced where that is not proven."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from optics.exchange.assemblies.blocked_paths import Obstacles
from optics.exchange.assemblies.light_hulls import LightHulls, light_hulls
from optics.exchange.assemblies.light_samples import (
    Obstruction,
    Stopped,
    edge_triangles,
    sampled_light,
    stopped_light,
    straight_paths,
)
from optics.scene.system import System
from thbcad.cad.exchange import SolidState, face_triangles, faces_of
from thbcad.cad.parts import (
    edges_within,
    faces_within,
    inner_wires,
    on_face,
    outline_segments,
    own_edges,
    rim_faces,
)
from thbcad.certified import ConvexRegion
from thbcad.checks import Bools, Floats
from thbcad.lens import Lens

Face: TypeAlias = Any  # of OpenCASCADE, which `thbcad.cad` alone imports
Shape: TypeAlias = Any

DEPTH = 1e-11  # of the half-width: what reaches less deep into the light counts as beside it
THIN = 25  # half-widths that a thickness stands for: volumes of thin lenses feel the depth more
TRIM = 1e-7  # mm, by which edges of front and rear may miss the rims of the lens
CHORD = 2e-5  # of the half-width, of the triangles that stop rays
GLASS = "front to rear"
NAMES = ("front", "rear")


@dataclass(frozen=True, eq=False)
class PartLight:
    """A part in the frame of its lens, and the light of its design.

    solid : TopoDS_Solid.  optical : numbers of front and rear among its faces.  system : None is unknown.
    """

    solid: Shape
    optical: tuple[int, int]
    lens: Lens
    system: System | None

    @cached_property
    def faces(self) -> list[Face]:
        return faces_of(self.solid)

    @cached_property
    def heights(self) -> tuple[float, float]:
        """z of planes before and behind all of the part, mm."""
        box = SolidState(self.solid).box
        return box[2] - 1.0, box[5] + 1.0

    @cached_property
    def hulls(self) -> LightHulls:
        return light_hulls(self.lens, self.system, self.heights)

    @property
    def size(self) -> float:
        """The greatest half-width, mm."""
        return max(*self.lens.front.half_width, *self.lens.rear.half_width)

    @property
    def depth(self) -> float:
        """How deep a face may reach into the light unseen, mm."""
        return DEPTH * min(self.size, THIN * self.lens.thickness)

    @cached_property
    def within(self) -> dict[str, dict[int, Floats]]:
        """The faces that may come into each hull of the light, as `faces_within`."""
        return {name: self._within(region) for name, region in self.hulls.regions.items()}

    @cached_property
    def whole(self) -> bool:
        """Whether no face comes between front and rear at all, and none covers or cuts them."""
        glass = light_hulls(self.lens, None, self.heights).regions[GLASS]
        return not self.uncovered and not self._within(glass)

    @property
    def most_missing(self) -> float:
        """The most volume that a whole part can lack between front and rear, relative to that of the lens."""
        x, y = np.maximum(self.lens.front.half_width, self.lens.rear.half_width)
        low, high = (np.array([g.coefficients.min(), g.coefficients.max()]) for g in self.lens.own_graphs())
        tall = self.lens.thickness + high.max() - low.min()
        return float(4 * (2 * x * y + (x + y) * tall) * self.depth / self.lens.volume())

    @cached_property
    def uncovered(self) -> list[str]:
        """Which of front and rear the part may cover or cut where they are lit."""
        return [name for name in NAMES if not self._covers(name)]

    @cached_property
    def pierced(self) -> list[str]:
        """Which of front and rear have a hole where they are lit."""
        return [
            name
            for name in NAMES
            if any(edges_within(wire, self._prism(name)) for wire in inner_wires(self._optical(name)))
        ]

    @property
    def proven(self) -> bool:
        """Whether no face comes into the light."""
        return not self.uncovered and not any(self.within.values())

    @cached_property
    def voids(self) -> list[int]:
        """The faces that may come into the glass that light passes, besides trims of its rim."""
        trims = rim_faces(self.faces, self.optical)
        return [number for number in self.within[GLASS] if number not in trims]

    @cached_property
    def certain_voids(self) -> list[int]:
        """Those of the voids that are known to lie in the light's glass: where light passes everywhere, those
        of which a point between front and rear was found."""
        if not self.hulls.exact:
            return []
        return [number for number in self.voids if self._between(self.within[GLASS][number]).any()]

    def stopped(self) -> Stopped:
        """Return what the part stops of the light, traced."""
        chord = CHORD * self.size
        beside = {
            name: self._obstacles([k for k in found if name != GLASS or k not in self.voids], chord)
            for name, found in self.within.items()
        }
        outlines = {name: outline_segments(self._optical(name)) for name in self.uncovered}
        edges = Obstacles(edge_triangles(self.lens))
        obstruction = Obstruction(beside, self._obstacles(self.voids, chord), outlines, edges)
        if self.system is None:
            return stopped_light(straight_paths(self.lens), obstruction)
        assert self.hulls.target is not None
        return stopped_light(sampled_light(self.system, self.hulls.target, self.heights), obstruction)

    def _optical(self, name: str) -> Face:
        return self.faces[self.optical[NAMES.index(name)]]

    def _prism(self, name: str) -> ConvexRegion:
        return self.hulls.prisms[name].shrunk(TRIM)

    def _within(self, region: ConvexRegion) -> dict[int, Floats]:
        return faces_within(self.solid, region.shrunk(self.depth), {*self.optical, *self._own})

    @cached_property
    def _own(self) -> frozenset[int]:
        return own_edges(self.faces, self.lens)

    def _covers(self, name: str) -> bool:
        """Return whether an optical face holds all that is lit: no edge comes into that, and its middle lies
        in the face."""
        face, prism = self._optical(name), self._prism(name)
        if edges_within(face, prism):
            return False
        corners = prism.section(np.zeros(3), np.eye(3)[0], np.eye(3)[1], 4 * self.size)
        x, y, _ = corners.mean(axis=0)
        return bool(on_face(face, np.array([[x, y, self._height(name, x, y)]]))[0])

    def _height(self, name: str, x: Floats, y: Floats) -> Floats:
        _, surface, vertex = self.lens.faces[NAMES.index(name)]
        return surface(x, y) + vertex

    def _between(self, points: Floats) -> Bools:
        """Return which points (n, 3) lie between front and rear."""
        x, y, z = points.T
        front, rear = (self._height(name, x, y) for name in NAMES) if len(points) else (z, z)
        return (front + self.depth < z) & (z < rear - self.depth)

    def _obstacles(self, numbers: Iterable[int], chord: float) -> Obstacles:
        return Obstacles(face_triangles([self.faces[k] for k in numbers], chord))
