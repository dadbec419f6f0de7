"""The closed lens as Mitsuba meshes whose vertices follow the THB coefficients.

Front and rear are sampled at the same relative positions.  On a surface with n vertices height and slopes are

    (z, zx, zy) = base + A c,    A : csr_array (3 n, dim),

with the THB coefficients c, and the vertex normals are those of the spline itself, (-zx, -zy, 1) / N on the
rear and the opposite on the front.  The four ruled edges are strips between the rims, with flat normals.

Mitsuba 3.9.1 has no Python class from which a shape could derive.  When it has, a shape that meets the
spline itself can replace these meshes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from optics.mitsuba.loading import mitsuba_backend
from thbcad.checks import read_only
from thbcad.lens import rim_indices, tessellated

if TYPE_CHECKING:
    from optics.runtime import Backend, DrArray
    from thbcad.lens import FreeformSurface, Lens

Floats = NDArray[np.float64]
JET = ((0, 0), (1, 0), (0, 1))
FACES = ("front", "rear", "edges")


@dataclass(frozen=True, eq=False)
class SurfaceVertices:
    """Vertices of one surface at the relative positions s x t in [-1, 1], t first.

    Heights and slopes are base + matrix @ c.

    vertex : z of the surface's vertex in the lens's frame, mm.
    """

    surface: FreeformSurface
    vertex: float
    s: Floats
    t: Floats

    @cached_property
    def positions(self) -> tuple[Floats, Floats]:
        """x and y of all vertices, (n,) each, mm."""
        hx, hy = self.surface.half_width
        x, y = (a.ravel() for a in np.meshgrid(hx * self.s, hy * self.t, indexing="ij"))
        return read_only(x), read_only(y)

    @cached_property
    def base(self) -> Floats:
        """z, zx, zy without the sag, (3, n)."""
        x, y = self.positions
        rows = [self.surface.conic(x, y, d) + np.zeros_like(x) for d in JET]
        rows[0] += self.vertex
        return read_only(np.stack(rows))

    @cached_property
    def matrix(self) -> csr_array:
        """The derivatives of z, zx, zy by the THB coefficients, csr_array (3 n, dim).

        Raises
        ------
        ValueError : a surface without a sag.
        """
        if self.surface.sag is None:
            raise ValueError("a surface without a sag has no coefficients")
        space = self.surface.sag.space
        u, v = self.surface.to_parameters(*self.positions)
        du, dv = (  # parameters per mm
            (kv.stop - kv.start) / (2 * h) for kv, h in zip((space.kv_u, space.kv_v), self.surface.half_width)
        )
        rows = [space.collocation(u, v, (a, b)) * (du**a * dv**b) for a, b in JET]
        return csr_array(vstack(rows, format="csr"))

    def jet(self, coefficients: Floats | None = None) -> Floats:
        """Return z, zx, zy, (3, n).  coefficients : (dim,), or None for the surface as it is."""
        if coefficients is not None:
            return self.base + self.push_forward(coefficients)
        hx, hy = self.surface.half_width
        rows = np.stack([self.surface.grid(hx * self.s, hy * self.t, d).ravel() for d in JET])
        rows[0] += self.vertex
        return rows

    def push_forward(self, direction: Floats) -> Floats:
        """Return the change of `jet` with a change of the coefficients, (3, n)."""
        return (self.matrix @ direction).reshape(3, -1)

    def pull_back(self, gradients: Floats) -> Floats:
        """Return the derivative by the coefficients, (dim,), from that by the jet, (3, n)."""
        return self.matrix.T @ gradients.ravel()


@dataclass(frozen=True, eq=False)
class LensMesh:
    """The faces of a closed lens as triangles over a product grid of vertices.

    s, t : relative positions of the grid lines in x and y, rising from -1 to 1.

    Raises
    ------
    ValueError : s or t that do not rise from -1 to 1.
    """

    lens: Lens
    s: Floats
    t: Floats

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

        Raises
        ------
        ValueError : as `tessellated`.
        """
        mesh = tessellated(lens, chord)
        front = mesh.vertices[: mesh.triangles[mesh.faces == 0].max() + 1]
        nt = int(np.argmax(np.diff(front[:, 1]) < 0)) + 1
        rows = front[::nt, 0], front[:nt, 1]
        return cls(lens, *(2 * (r - r[0]) / (r[-1] - r[0]) - 1 for r in rows))

    @cached_property
    def surfaces(self) -> dict[str, SurfaceVertices]:
        """The vertices of "front" and "rear"."""
        lens = self.lens
        return {
            "front": SurfaceVertices(lens.front, 0.0, self.s, self.t),
            "rear": SurfaceVertices(lens.rear, lens.thickness, self.s, self.t),
        }

    @property
    def free(self) -> dict[str, Floats]:
        """The coefficients of the lens's sags by surface, front first."""
        sags = {"front": self.lens.front.sag, "rear": self.lens.rear.sag}
        return {name: sag.coefficients for name, sag in sags.items() if sag is not None}

    @property
    def rim(self) -> NDArray[np.int64]:
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

    def vertices(
        self, mitsuba: ModuleType, name: str, coefficients: DrArray | None = None
    ) -> tuple[Any, Any]:
        """Return (positions, outward unit normals) of "front" or "rear", Point3f and Normal3f.

        They are differentiable in the coefficients.

        coefficients : Float64 (dim,), or None for the surface as it is.
        """
        surface, backend = self.surfaces[name], mitsuba_backend(mitsuba)
        if coefficients is None:
            z, zx, zy = (backend.array(row) for row in surface.jet())
        else:
            z, zx, zy = backend.dr.custom(_jet_operation(backend, surface), coefficients)
        outward = (1.0 if name == "rear" else -1.0) * backend.dr.rsqrt(1 + zx * zx + zy * zy)
        x, y = (backend.array(row) for row in surface.positions)
        return mitsuba.Point3f(x, y, z), mitsuba.Normal3f(-zx * outward, -zy * outward, outward)

    def shapes(self, mitsuba: ModuleType, names: Sequence[str] = FACES, bsdf: Any = None) -> dict[str, Any]:
        """Return the faces as Mitsuba meshes by name.  bsdf : of all of them."""
        shapes: dict[str, Any] = {}
        for name in names:
            properties = mitsuba.Properties()
            if bsdf is not None:
                properties["bsdf"] = bsdf
            triangles = self.triangles(name)
            count = 2 * len(self.rim) if name == "edges" else len(self.s) * len(self.t)
            shapes[name] = mitsuba.Mesh(
                name, count, len(triangles), has_vertex_normals=name != "edges", props=properties
            )
            parameters = mitsuba.traverse(shapes[name])
            parameters["faces"] = triangles.ravel()
            parameters.update(self._buffers(mitsuba, name, {}))
        return shapes

    def update(self, mitsuba: ModuleType, parameters: Any, coefficients: Sequence[DrArray]) -> None:
        """Move the vertices of a scene's lens to other coefficients; derivatives pass through.

        parameters : `mitsuba.traverse` of a scene that holds some of the `shapes` by their names.
        coefficients : Float64 (dim,) of every sag, front first.
        """
        moved = dict(zip(self.free, coefficients))
        for name in FACES:
            if f"{name}.vertex_positions" in parameters and (name in moved or name == "edges"):
                buffers = self._buffers(mitsuba, name, moved)
                for key, values in buffers.items():
                    parameters[f"{name}.{key}"] = values
        parameters.update()

    def _buffers(
        self, mitsuba: ModuleType, name: str, coefficients: dict[str, DrArray]
    ) -> dict[str, DrArray]:
        """Return what a face's mesh stores, by Mitsuba's names."""
        dr = mitsuba_backend(mitsuba).dr
        if name == "edges":
            rim = mitsuba.UInt32(self.rim)
            sides = (self.vertices(mitsuba, side, coefficients.get(side))[0] for side in self.surfaces)
            return {
                "vertex_positions": dr.concat(
                    [dr.ravel(dr.gather(mitsuba.Point3f, side, rim)) for side in sides]
                )
            }
        positions, normals = self.vertices(mitsuba, name, coefficients.get(name))
        return {"vertex_positions": dr.ravel(positions), "vertex_normals": dr.ravel(normals)}


def _jet_operation(backend: Backend, surface: SurfaceVertices) -> type:
    """Return the Dr.Jit operation coefficients -> z, zx, zy, Float64 (n,) each."""

    base: Any = backend.dr.CustomOp

    class Jet(base):
        def eval(self, coefficients: DrArray) -> tuple[DrArray, ...]:
            return tuple(backend.array(row) for row in surface.jet(coefficients.numpy()))

        def forward(self) -> None:
            direction = np.broadcast_to(self.grad_in("coefficients").numpy(), surface.matrix.shape[1])
            self.set_grad_out(tuple(backend.array(row) for row in surface.push_forward(direction)))

        def backward(self) -> None:
            gradients = [np.broadcast_to(g.numpy(), len(surface.positions[0])) for g in self.grad_out()]
            self.set_grad_in("coefficients", backend.array(surface.pull_back(np.stack(gradients))))

        def name(self) -> str:
            return "heights and slopes of a THB surface"

    return Jet
