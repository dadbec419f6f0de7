"""Mirror symmetry: a problem that is its own mirror image gets a lens that is, whose light one half tells.

Rounding breaks the symmetry of a long optimisation; so coefficients and indicators are averaged with their
mirror images, which makes them equal bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from optics.scene.sources import Profile
from optics.scene.system import System, pose_of
from thbcad.checks import Floats, Integers
from thbcad.hierarchy import THBSpace
from thbcad.surfaces import THBSurface

TOLERANCE = 1e-12  # of the greatest value
STRIP = 64  # rows that are compared at once


def mirror_axes(target: Floats, profile: Profile) -> tuple[int, ...]:
    """Return the directions (0 for x, 1 for y) in which target and source are their own mirror images.

    target : (rows, columns), on the target's pixels.
    """
    images = [target] if profile.light is None else [target, profile.light]
    return tuple(a for a in (0, 1) if all(_is_mirrored(image if a == 0 else image.T) for image in images))


def _is_mirrored(image: Floats) -> bool:
    """Return whether every row is its own mirror image; of most pictures the first ones are not."""
    least = TOLERANCE * image.max()
    strips = (image[start : start + STRIP] for start in range(0, len(image), STRIP))
    return all(np.abs(strip - strip[:, ::-1]).max() <= least for strip in strips)


def symmetry_axes(system: System) -> tuple[int, ...]:
    """Return the directions in which source, elements, stops, receiver and target are their own mirror
    images."""
    if not system.source.symmetric:
        return ()
    axes = mirror_axes(system.target.irradiance(system.target.screen(), 1.0), system.source.profile)
    poses = [system.pose, *(pose_of(optic) for optic, _ in system.others)]
    poses += [system.target.receiver.pose, *(stop.pose for stop in system.stops)]
    return tuple(axis for axis in axes if all(axis in pose.mirror_axes for pose in poses))


def light_axes(system: System) -> tuple[int, ...]:
    """Return the directions in which the light of a lens is its own mirror image, and so are the source's
    rays, see `mirror_half`: none where chance, or what a script or a body brings, is not.

    The sags of all elements are their own mirror images bit for bit.
    """
    scripted = system.own.source is not None or system.own.receiver is not None
    made = system.body is not None or system.problem.optic.array is not None
    if scripted or made or any(system.slope_rms) or not system.source.extended:
        return ()
    axes = symmetry_axes(system)
    return tuple(axis for axis in axes if all(_is_symmetric(sag, axis) for sag in system.sags))


def _is_symmetric(sag: THBSurface, axis: int) -> bool:
    mirrors = Mirrors(sag.space, (axis,))
    averaged = mirrors.of_coefficients(sag.coefficients)
    return mirrors.keeps(axis) and np.array_equal(averaged, sag.coefficients)


class Mirrors:
    """Averaging over the mirror images of a mesh.

    axes : directions; those in which the mesh is not its own mirror image are left out.
    """

    def __init__(self, space: THBSpace, axes: Sequence[int]) -> None:
        counts = [kv.dim - kv.degree for kv in (space.kv_u, space.kv_v)]  # spans of level 0
        degrees = space.kv_u.degree, space.kv_v.degree
        self._functions, self._cells, self._axes = [], [], []
        for axis in axes:
            functions = _mirrored(space.functions, axis, counts[axis], degrees[axis])
            cells = _mirrored(space.cells, axis, counts[axis], 0)
            if functions is not None and cells is not None:
                self._axes.append(axis)
                self._functions.append(functions)
                self._cells.append(cells)

    def keeps(self, axis: int) -> bool:
        """Whether values are averaged in a direction."""
        return axis in self._axes

    def of_coefficients(self, values: Floats) -> Floats:
        """Return coefficients (or their gradient) averaged with their mirror images, (dim,)."""
        return _averaged(values, self._functions)

    def of_cells(self, values: Floats) -> Floats:
        """Return numbers of leaf cells averaged with their mirror images, (n_cells,)."""
        return _averaged(values, self._cells)


def _averaged(values: Floats, permutations: Sequence[Integers]) -> Floats:
    for permutation in permutations:
        values = (values + values[permutation]) / 2
    return values


def _mirrored(rows: Integers, axis: int, spans: int, extra: int) -> Integers | None:
    """Return the row of the mirror image of every [level, i, j]; None where one is missing."""
    images = rows.copy()
    images[:, 1 + axis] = (spans << rows[:, 0]) + extra - 1 - rows[:, 1 + axis]
    order, mirrored = (np.lexsort(r.T[::-1]) for r in (rows, images))
    if not np.array_equal(rows[order], images[mirrored]):
        return None
    permutation = np.empty(len(rows), dtype=np.int64)
    permutation[mirrored] = order
    return permutation
