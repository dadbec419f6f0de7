"""The closed lens as Mitsuba meshes whose vertices follow the THB coefficients.

Front and rear are sampled at the same relative positions, see `SurfaceVertices`.  The vertex normals are
those of the spline itself, (-zx, -zy, 1) / N on the rear and the opposite on the front.  The four ruled edges
are strips between the rims, with flat normals.

Mitsuba 3.9.1 has no Python class from which a shape could derive.  When it has, a shape that meets the
spline itself can replace these meshes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import repeat
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import DrArray
from optics.exchange.mitsuba.loading import mitsuba_backend
from optics.exchange.mitsuba.surface_vertices import Jet, SurfaceVertices, jet_operation
from thbcad.checks import Floats, Integers, read_only
from thbcad.lens import Lens, rim_indices, tessellated
from thbcad.poses import IDENTITY, Pose
from thbcad.splines import KnotVector

FACES = ("front", "rear", "edges")


@dataclass(frozen=True, eq=False)
class LensMesh:
    """The faces of a closed lens as triangles over a product grid of vertices.

    s, t : relative positions of the grid lines in x and y, rising from -1 to 1.
    pose : from the lens's own frame to the scene's.  called : its name there, "" of a lens alone.

    Raises ValueError : s or t that do not rise from -1 to 1.
    """

    lens: Lens
    s: Floats
    t: Floats
    pose: Pose = IDENTITY
    called: str = ""

    def __post_init__(self) -> None:
        for name in ("s", "t"):
            row = read_only(getattr(self, name))
            if row.ndim != 1 or len(row) < 2 or row[0] != -1 or row[-1] != 1 or (np.diff(row) <= 0).any():
                raise ValueError(f"{name} must be one row of numbers that rise from -1 to 1, got {row}")
            object.__setattr__(self, name, row)

    @classmethod
    def uniform(cls, lens: Lens, counts: Sequence[int]) -> LensMesh:
        """Return the mesh with counts = (nx, ny) uniformly spaced vertices."""
        nx, ny = counts
        return cls(lens, np.linspace(-1, 1, nx), np.linspace(-1, 1, ny))

    @classmethod
    def within(cls, lens: Lens, chord: float) -> LensMesh:
        """Return the mesh whose front and rear are within `chord`, mm, of the surfaces (see
        `thbcad.lens`).

        Raises ValueError : as `tessellated`.
        """
        mesh = tessellated(lens, chord)
        front = mesh.vertices[: mesh.triangles[mesh.faces == 0].max() + 1]
        nt = int(np.argmax(np.diff(front[:, 1]) < 0)) + 1
        rows = front[::nt, 0], front[:nt, 1]
        return cls(lens, *(2 * (r - r[0]) / (r[-1] - r[0]) - 1 for r in rows))

    @cached_property
    def surfaces(self) -> dict[str, SurfaceVertices]:
        """The vertices of "front" and "rear"."""
        faces = self.lens.faces
        return {name: SurfaceVertices(surface, vertex, self.s, self.t) for name, surface, vertex in faces}

    @property
    def free(self) -> dict[str, Floats]:
        """The coefficients of the lens's sags by surface, front first."""
        return {name: s.sag.coefficients for name, s, _ in self.lens.faces if s.sag is not None}

    @property
    def points(self) -> Floats:
        """The vertices of front and rear in the scene's frame, (3, n) mm."""
        own = [(*surface.positions, surface.jet()[0]) for surface in self.surfaces.values()]
        return np.asarray(self.pose.points(np.concatenate([np.stack(rows) for rows in own], axis=1)))

    def named(self, face: str) -> str:
        """Return the name of "front", "rear" or "edges" in a scene."""
        return f"{self.called}_{face}" if self.called else face

    @property
    def rim(self) -> Integers:
        """Numbers of the rim's vertices, counter-clockwise seen from +z."""
        return rim_indices(len(self.s), len(self.t))

    def triangles(self, name: str) -> NDArray[np.uint32]:
        """Return the vertex numbers of the triangles of "front", "rear" or "edges", outward, (m, 3).

        The edges have their own vertices: the rim of the front, then that of the rear.
        """
        if name == "edges":
            a = np.arange(len(self.rim))
            b = np.roll(a, -1)
            c, d = b + len(a), a + len(a)
        else:
            grid = np.arange(len(self.s) * len(self.t)).reshape(len(self.s), len(self.t))
            a, b = grid[:-1, :-1].ravel(), grid[1:, :-1].ravel()
            c, d = grid[1:, 1:].ravel(), grid[:-1, 1:].ravel()
        both = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
        return (both[:, ::-1] if name == "front" else both).astype(np.uint32)

    def vertices(self, mitsuba: ModuleType, name: str, jet: Jet | None = None) -> tuple[Any, Any]:
        """Return (positions, outward unit normals) of "front" or "rear", Point3f and Normal3f.

        jet : heights and slopes, in which they are differentiable, or None for the surface as it is.
        """
        surface, backend = self.surfaces[name], mitsuba_backend(mitsuba)
        z, zx, zy = jet or (backend.array(row) for row in surface.jet())
        outward = (1.0 if name == "rear" else -1.0) * backend.dr.rsqrt(1 + zx * zx + zy * zy)
        x, y = (backend.array(row) for row in surface.positions)
        normal = self.pose.directions((-zx * outward, -zy * outward, outward))
        return mitsuba.Point3f(*self.pose.points((x, y, z))), mitsuba.Normal3f(*normal)

    def jet(self, mitsuba: ModuleType, name: str, coefficients: DrArray) -> Jet:
        """Return heights and slopes of a surface, differentiable in the coefficients, Float64 (dim,)."""
        backend = mitsuba_backend(mitsuba)
        return backend.custom(jet_operation(backend, self.surfaces[name]), coefficients)

    def shapes(self, mitsuba: ModuleType, names: Sequence[str] = FACES, bsdf: Any = None) -> dict[str, Any]:
        """Return the faces as Mitsuba meshes, as `named`.  bsdf : of all of them."""
        shapes: dict[str, Any] = {}
        for name in names:
            properties = mitsuba.Properties()
            if bsdf is not None:
                properties["bsdf"] = bsdf
            triangles = self.triangles(name)
            count = 2 * len(self.rim) if name == "edges" else len(self.s) * len(self.t)
            shape = mitsuba.Mesh(
                self.named(name), count, len(triangles), has_vertex_normals=name != "edges", props=properties
            )
            shapes[self.named(name)] = shape
            parameters = mitsuba.traverse(shape)
            parameters["faces"] = triangles.ravel()
            parameters.update(self._buffers(mitsuba, name, {}))
        return shapes

    def update(self, mitsuba: ModuleType, parameters: Any, coefficients: Sequence[DrArray]) -> None:
        """Move the vertices of a scene's lens to other coefficients; derivatives pass through.

        parameters : `mitsuba.traverse` of a scene that holds some of the `shapes` by their names.
        coefficients : Float64 (dim,) of every sag, front first.
        """
        jets = [self.jet(mitsuba, name, c) for name, c in zip(self.free, coefficients)]
        self.follow(mitsuba, parameters, jets)

    def follow(self, mitsuba: ModuleType, parameters: Any, jets: Sequence[Jet]) -> None:
        """Move the vertices of a scene's lens to other heights and slopes, as `update` does.

        jets : of every surface that carries a sag, front first.
        """
        moved = dict(zip(self.free, jets))
        for name in FACES:
            if f"{name}.vertex_positions" in parameters and (name in moved or name == "edges"):
                buffers = self._buffers(mitsuba, name, moved)
                for key, values in buffers.items():
                    parameters[f"{name}.{key}"] = values
        parameters.update()

    def _buffers(self, mitsuba: ModuleType, name: str, jets: dict[str, Jet]) -> dict[str, DrArray]:
        """Return what a face's mesh stores, by Mitsuba's names."""
        dr = mitsuba_backend(mitsuba).dr
        if name == "edges":
            rim = mitsuba.UInt32(self.rim)
            sides = (self.vertices(mitsuba, side, jets.get(side))[0] for side in self.surfaces)
            return {
                "vertex_positions": dr.concat(
                    [dr.ravel(dr.gather(mitsuba.Point3f, side, rim)) for side in sides]
                )
            }
        positions, normals = self.vertices(mitsuba, name, jets.get(name))
        return {"vertex_positions": dr.ravel(positions), "vertex_normals": dr.ravel(normals)}

    def leaves(self, mitsuba: ModuleType, coefficients: Sequence[Floats]) -> list[Jet]:
        """Return heights and slopes of every surface that carries a sag, front first, to be derived by."""
        backend = mitsuba_backend(mitsuba)
        jets = []
        for name, c in zip(self.free, coefficients):
            z, zx, zy = (backend.array(row) for row in self.surfaces[name].jet(c))
            backend.dr.enable_grad(z, zx, zy)
            jets.append((z, zx, zy))
        return jets

    def pull_back(
        self, leaves: Sequence[Jet], knots: Sequence[Sequence[KnotVector]] | None = None
    ) -> list[Floats]:
        """Return the derivative by each sag's coefficients from those that the leaves carry.

        knots : of each sag, two knot vectors; the derivative is then that by a net over these knots.
        """
        out, count = [], len(self.s) * len(self.t)
        for name, jet, pair in zip(self.free, leaves, knots or repeat(None)):
            gradients = np.stack([np.broadcast_to(leaf.grad.numpy(), count) for leaf in jet])
            out.append(self.surfaces[name].pull_back(gradients, pair))
        return out

    def set_directions(
        self, mitsuba: ModuleType, leaves: Sequence[Jet], directions: Sequence[Floats]
    ) -> list[DrArray]:
        """Set the derivatives of the leaves to those along a direction in the coefficients; return them."""
        backend = mitsuba_backend(mitsuba)
        for name, jet, direction in zip(self.free, leaves, directions):
            for leaf, row in zip(jet, self.surfaces[name].push_forward(direction)):
                backend.dr.set_grad(leaf, backend.array(row))
        return [leaf for jet in leaves for leaf in jet]
