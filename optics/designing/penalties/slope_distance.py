"""How far slopes differ from those of other surfaces, and the conics whose slopes differ least.

A surface moves its light by about the change of its slopes.  The distance of sags s from others s_0 is

    sum over surfaces of  mean w |grad s - grad s_0|^2 / mean w |grad z_0 - m|^2

with the weight w of the light, and with the height z_0 of conic and sag and its mean slope m.

The conics are  b.x + x.Ax / (1 + sqrt(1 - |Ax|^2)):  spheres where the eigenvalues of A are equal, whose
curvature is the same everywhere.  So steep that there is no root they are paraboloids, b.x + x.Ax / 2.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from optics.designing.penalties.sample_points import SurfaceSamples
from thbcad.checks import Floats
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface
from thbcad.sags import Conic
from thbcad.surfaces import THBSurface

SLOPES = (1, 0), (0, 1)
EVEN = 1e-6  # mean square of slopes, at least: of a plane the difference itself counts
STEEPEST = 0.1  # 1 - |Ax|^2, at least, of a conic with a root
DARK = 1e-3  # weight of points without light

Weights = tuple[Floats, Floats, Floats]  # x, y, (nx, ny) numbers of cells with these centres


class SlopeDistance:
    """The distance of sags from those of free surfaces, and its gradient by their coefficients.

    free : the surfaces.  lights : the weight of the light on each of them; None is the same everywhere.
    """

    def __init__(self, free: Sequence[FreeformSurface], lights: Sequence[Weights | None]) -> None:
        sags = [surface.sag for surface in free if surface.sag is not None]
        self._spaces = [sag.space for sag in sags]
        self._conics = [surface.conic for surface in free]
        self._samples = [SurfaceSamples(surface, number) for number, surface in enumerate(free)]
        nets = [sag.space.embedding.coefficients(sag.coefficients) for sag in sags]
        self._sags = [[samples.sag(net, d) for d in SLOPES] for samples, net in zip(self._samples, nets)]
        self._weights = [_weights(samples, light) for samples, light in zip(self._samples, lights)]
        spreads = (
            sum(float((w * (z - (w * z).sum()) ** 2).sum()) for z in slopes)
            for w, slopes in zip(self._weights, self._slopes())
        )
        self._scales = [1 / max(spread, EVEN) for spread in spreads]

    def _slopes(self) -> list[list[Floats]]:
        """Return the slopes of conic and sag of every surface."""
        return [
            [samples.conic(d) + slope for d, slope in zip(SLOPES, sags)]
            for samples, sags in zip(self._samples, self._sags)
        ]

    def __call__(self, coefficients: Sequence[Floats]) -> tuple[float, list[Floats]]:
        """Return (distance, gradients)."""
        distance, gradients = 0.0, []
        parts = zip(self._spaces, self._samples, self._sags, self._weights, self._scales)
        for c, (space, samples, sags, weights, scale) in zip(coefficients, parts):
            net = space.embedding.coefficients(c)
            slope = np.zeros_like(net)
            for derivative, wanted in zip(SLOPES, sags):
                off = samples.sag(net, derivative) - wanted
                distance += scale * float((weights * off**2).sum())
                slope += samples.pulled(2 * scale * weights * off, derivative)
            gradients.append(space.embedding.adjoint(slope))
        return distance, gradients

    def conics(self, ranges: Sequence[tuple[float, float]]) -> list[THBSurface]:
        """Return the sags that turn the surfaces into the conics nearest to them, on the coarsest mesh.

        ranges : least and greatest curvature of every surface, 1/mm, to which the eigenvalues of A are cut.
        """
        nearest = [
            _nearest(samples, weights, slopes, ends)
            for samples, weights, slopes, ends in zip(self._samples, self._weights, self._slopes(), ranges)
        ]
        return [_conic_sag(s, conic, a, b) for s, conic, (a, b) in zip(self._spaces, self._conics, nearest)]


def _weights(samples: SurfaceSamples, light: Weights | None) -> Floats:
    """Return the weights of the points of a surface, (m, n), whose sum is 1."""
    if light is None:
        return samples.mean
    x, y, weight = light
    lit = RegularGridInterpolator(
        (x, y), weight / weight.max(), method="nearest", bounds_error=False, fill_value=0.0
    )
    found: Floats = samples.mean * np.maximum(lit((samples.x[:, None], samples.y[None, :])), DARK)
    return found / found.sum()


def _nearest(
    samples: SurfaceSamples, weights: Floats, slopes: Sequence[Floats], ends: tuple[float, float]
) -> tuple[Floats, Floats]:
    """Return A, (2, 2), and b, (2,), of the conic nearest to slopes, with the eigenvalues of A cut."""
    x, y = (s + np.zeros_like(weights) for s in (samples.x[:, None], samples.y[None, :]))
    zero, one, root = np.zeros_like(x), np.ones_like(x), np.sqrt(weights)
    rows = [[x, y, zero, one, zero], [zero, x, y, zero, one]]  # of xx, xy, yy, x, y
    matrix = np.concatenate([np.stack([(root * c).ravel() for c in row], axis=1) for row in rows])
    xx, xy, yy, *_ = np.linalg.lstsq(matrix, np.concatenate([(root * s).ravel() for s in slopes]))[0]
    curvatures, axes = np.linalg.eigh([[xx, xy], [xy, yy]])
    a = axes @ np.diag(np.clip(curvatures, *ends)) @ axes.T
    b = [float((weights * (z - i * x - j * y)).sum()) for z, (i, j) in zip(slopes, a)]
    return a, np.array(b)


def _conic_sag(space: THBSpace, conic: Conic, a: Floats, b: Floats) -> THBSurface:
    """Return the sag between the conic of a surface and that of A and b, on the coarsest mesh."""
    knots = space.kv_u, space.kv_v
    x, y = (kv.greville() for kv in knots)
    bent = np.einsum("ij,jkl->ikl", a, np.stack(np.meshgrid(x, y, indexing="ij")))
    under = 1 - (bent**2).sum(axis=0)
    root = np.sqrt(under) if under.min() > STEEPEST else 1.0
    x, y = x[:, None], y[None, :]
    heights = (x * bent[0] + y * bent[1]) / (1 + root) + b[0] * x + b[1] * y - conic(x, y)
    for kv in knots:
        heights = np.linalg.solve(kv.collocation(kv.greville()).toarray(), heights).T
    coarse = THBSpace(*knots)
    return THBSurface(space, coarse.prolongation(space) @ heights.ravel())
