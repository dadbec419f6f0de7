"""The start of a free surface anywhere on a light path: light lands where a picture wants it."""

import numpy as np
import pytest

from optics.designing.starts.path_start import MOST_ROUNDS, Picture, shaped_along
from optics.light.measuring import MappedCells
from optics.light.tracing import Tracer
from optics.scene.paths import AIR, LightPath, Medium, Surface
from optics.scene.receivers import FarField, Plane, Screen
from optics.scene.sources import CollimatedBeam, Divergence, PointSource
from tests.optics.cases import picture
from thbcad.fitting import fit_slopes
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface
from thbcad.poses import Pose
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

PIXELS, CELLS, LEVEL = 48, 96, 3
GLASS, HALF = Medium(1.5), (100.0, 100.0)
ASIDE = Plane(Pose([[0, 0, 1], [1, 0, 0], [0, 1, 0]], (300, 0, 0)))  # across +x: u along y, v along z


def about_y(degrees, *position):
    return Pose.at(position or (0, 0, 0), rotation_vector=(0, np.radians(degrees), 0))


def free(half_width, pose, kind):
    kv = KnotVector.uniform(3, 7)
    space = THBSpace(*(kv.rescale(-h, h) for h in half_width))
    return Surface(FreeformSurface(half_width, sag=THBSurface(space, np.zeros(space.dim))), pose, kind, 1.0)


def beam(hx, hy):
    parallel = Divergence("uniform", 0.0)
    area = {"half_width": (hx, hy), "shape": "uniform", "sigma": (1.0, 1.0), "picture": ""}
    return CollimatedBeam(flux=1.0, distance=5.0, aperture=(1e3, 1e3), divergence=parallel, **area)


def by_mirror(half_width, x, receiver=ASIDE):
    return LightPath((free(half_width, about_y(-45, x, 0, x), "reflect"),), (AIR, AIR), receiver)


def by_lens(rear, receiver):
    front = Surface(FreeformSurface((80.0, 80.0)), share=1.0)
    return LightPath((front, rear), (AIR, GLASS, AIR), receiver)


TILTED = by_lens(free((65.0, 50.0), about_y(-36.4, 0, 0, 60), "refract"), Plane(about_y(-45, 150, 0, 340)))
FAR = by_lens(free((50.0, 50.0), Pose.at((0, 0, 20)), "refract"), FarField())
POINT = PointSource(flux=1.0, distance=100.0, half_angle=25.0, exponent=0.0)
# path, source, half-widths of the picture, rel_l2 at most, and its ratio unmended, at least
CASES = {
    "mirror": (by_mirror((51.0, 50.0), 0.0), beam(33.6, 47.5), HALF, 0.08, 1.3),
    "far field": (FAR, beam(47.5, 47.5), (18.0, 18.0), 0.04, 1.0),
    "point and mirror": (by_mirror((85.0, 65.0), 14.0), POINT, HALF, 0.12, 1.0),
    "tilted away": (TILTED, beam(47.5, 47.5), HALF, 0.08, 1.3),
}


def rel_l2(backend, path, source, half, wanted, rounds=MOST_ROUNDS):
    """Return the error of the start on a fine mesh, and the share of the light on the screen."""
    number = len(path.surfaces) - 1
    screen = Screen(half, (PIXELS, PIXELS))
    asked = Picture(wanted[::-1].T, (0.0, 0.0), half)
    shaped = shaped_along(backend, path, number, source, asked, (CELLS, CELLS), LEVEL, rounds)
    shape, light = path.surfaces[number].shape, shaped.light
    space = shape.sag.space.uniform(LEVEL)
    sag = fit_slopes(space, light.x, light.y, *shaped.above, np.ones((CELLS, CELLS)))
    cells = source.cells((4 * PIXELS, 4 * PIXELS))
    rays = cells.rays()
    with backend.dr.suspend_grad():
        _, landing = Tracer(backend, path.with_shape(number, shape.with_sag(sag)), rays, False).trace()
        mapped = MappedCells(backend, screen, cells.emitted, rays.flux, cells.turned)
        image = mapped(landing.x, landing.y, landing.flux, landing.definite)
    found = image.numpy().reshape(screen.shape, order="F")
    off = found / found.mean() - wanted / wanted.mean()
    share = found.sum() * screen.pixel_area / cells.emitted.sum()
    return float(np.linalg.norm(off) / np.linalg.norm(wanted / wanted.mean())), share, shaped.bent


@pytest.mark.every(4)
@pytest.mark.parametrize("name", CASES)
def test_light_lands_where_the_picture_wants_it(backend, name):
    """But for what 56 spans resolve of a jump on 48 pixels: 0.03 on the axis, else more.

    Off axis no surface has the slopes asked for: what lands beside must be asked for elsewhere.
    """
    path, source, half, most, gain = CASES[name]
    wanted = picture(PIXELS, PIXELS).astype(float)
    error, share, bent = rel_l2(backend, path, source, half, wanted)
    assert error < most
    assert share > 0.99
    assert bent > 0.999
    once, *_ = rel_l2(backend, path, source, half, wanted, 1)
    assert once >= gain * error


def test_every_fit_has_more_cells_than_functions(backend, monkeypatch):
    """On half the cells too: else slopes alternate from knot to knot, which cells hardly see."""
    seen = []

    def fitted(space, x, y, *slopes):
        spans = [len(kv.knots) - 1 - 2 * kv.degree for kv in (space.kv_u, space.kv_v)]
        seen.append([len(row) / (n << space.cells[:, 0].max()) for row, n in zip((x, y), spans)])
        return fit_slopes(space, x, y, *slopes)

    monkeypatch.setattr("optics.designing.starts.path_start.fit_slopes", fitted)
    monkeypatch.setattr("optics.designing.starts.path_start.LEAST_CELLS", CELLS // 2)
    path, source, half, *_ = CASES["mirror"]
    asked = Picture(picture(PIXELS, PIXELS).astype(float), (0.0, 0.0), half)
    shaped_along(backend, path, 0, source, asked, (CELLS, CELLS), LEVEL)
    assert {CELLS // 2 / 28, CELLS / 56} <= set(np.ravel(seen))  # of half the cells and of all
    assert np.min(seen) >= 1.5
