"""Points with normals in packs: read back, on the surfaces, and dense enough for what they promise."""

import io

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline, RegularGridInterpolator

from optics.exchange.packs.expected import dense_points
from tests.optics.cases import failing, rough, small_lens, small_space
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic

ROUGH = small_lens(sag=rough(small_space()))
BALL = Lens(
    FreeformSurface((5.0, 4.0), Conic(30.0)), FreeformSurface((5.0, 4.0), Conic(-20.0, -0.5)), 6.0, 1.5
)


@pytest.mark.parametrize("lens", [ROUGH, BALL])
def test_points_lie_on_the_surfaces_and_normals_point_outwards(lens):
    files, checks, grids = dense_points(lens)
    assert failing(checks) == []
    for word, surface, vertex, outward in (
        ("front", lens.front, 0.0, -1),
        ("rear", lens.rear, lens.thickness, 1),
    ):
        x, y, z, *normal = np.loadtxt(io.BytesIO(files[f"points_{word}.xyz"])).T
        assert len(x) == len(grids[word].x) * len(grids[word].y)
        assert np.abs(z - vertex - surface(x, y)).max() < 1e-10
        step = 1e-4
        for axis, n in enumerate(normal[:2]):
            move = [step * (axis == k) for k in (0, 1)]
            low, high = (
                surface(
                    *np.clip(
                        [x + sign * move[0], y + sign * move[1]],
                        *np.transpose([[-h, h] for h in surface.half_width])[:, :, None],
                    )
                )
                for sign in (-1, 1)
            )
            inner = np.abs((x, y)[axis]) < surface.half_width[axis]
            slope = (high - low)[inner] / (2 * step)
            np.testing.assert_allclose(-n[inner] / normal[2][inner], slope, atol=1e-6)
        assert (outward * normal[2] > 0).all()
        np.testing.assert_allclose(np.linalg.norm(normal, axis=0), 1, atol=1e-12)


@pytest.mark.parametrize("lens", [ROUGH, BALL])
def test_scipy_interpolates_the_points_within_a_micrometre_and_a_nanometre(lens):
    """Bilinearly by RegularGridInterpolator, at random points; cubically along lines of the grid."""
    files, _, grids = dense_points(lens)
    rng = np.random.default_rng(3)
    for word, surface, vertex in (("front", lens.front, 0.0), ("rear", lens.rear, lens.thickness)):
        shape = len(grids[word].x), len(grids[word].y)
        x, y, z, a, _, c = np.loadtxt(io.BytesIO(files[f"points_{word}.xyz"])).T.reshape(6, *shape)
        at = rng.uniform(-1, 1, (2000, 2)) * surface.half_width
        linear = RegularGridInterpolator((x[:, 0], y[0]), z)(at)
        assert np.abs(linear - vertex - surface(*at.T)).max() < 1e-3
        for row in (0, shape[1] // 2):
            line = CubicHermiteSpline(x[:, 0], z[:, row], -(a / c)[:, row])(at[:, 0])
            assert np.abs(line - vertex - surface(at[:, 0], y[0, row])).max() < 1e-6
