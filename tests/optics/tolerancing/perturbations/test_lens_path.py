"""Corners of cells that stay on the lens, and what is predicted along them."""

import numpy as np
import pytest

from optics.tolerancing.perturbations import LinearLight, Perturbation, tolerances_of
from optics.tolerancing.perturbations.lens_path import RESTING, LensPaths
from tests.optics.cases import FREE_REAR, FRONT, small_system
from tests.optics.tolerancing.perturbations.cases import small_light

SHIFT = Perturbation(lens_shift=(0.05, -0.03, 0.0))
MOTIONS = {
    "shift": SHIFT,
    "tilt": Perturbation(lens_tilt=(2e-3, 1e-3, 3e-3)),
    "turned beam": Perturbation(source_tilt=(0.0, 0.0, 4e-3)),
    "wider beam": Perturbation(source_size=0.01),
}
POINT = {"source.kind": "point", "source.distance": 30.0, "source.half_angle": 15.0}
ROUND = {"source.profile": "round"}
GAUSSIAN = {"source.profile": "gaussian", "source.sigma": [0.4, 0.4]}
SOURCES = {"beam": {}, "round beam": ROUND, "Gaussian beam": GAUSSIAN}


def at_corners(light, perturbation, path):
    """Return where rays from moved corners meet the lens, (2, nx + 1, ny + 1)."""
    s, t = path.corners(light.cells, 1.0)
    _, parts, trace = next(light.colours(perturbation))
    tracer, _ = trace(parts.rays(light.cells.at(s.ravel(), t.ravel(), np.ones(s.size))))
    hits, _, _ = tracer.at(1, [sag.coefficients for sag in parts.path.sags])
    return np.stack([hits.x.numpy(), hits.y.numpy()]).reshape(2, *s.shape)


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("motion", MOTIONS)
def test_corners_stay_on_the_lens_and_the_border_on_the_source(tmp_path, backend, source, motion):
    """To second order; without the path they slide by some 0.05 mm."""
    light, p = small_light(tmp_path, backend, SOURCES[source]), MOTIONS[motion]
    path = LensPaths(light)(p)
    furthest = max(np.abs(path.ds).max(), np.abs(path.dt).max())
    assert furthest > 0.01
    n = light.cells.emitted.shape[0]
    inside = slice(3 * n // 8, 5 * n // 8)
    apart = at_corners(light, p, path) - at_corners(light, Perturbation(), LensPaths(light)(Perturbation()))
    assert np.abs(apart[:, inside, inside]).max() < 4e-3 * furthest
    lit = light.cells.emitted > 0
    dark = ~np.pad(lit, 1)
    beside = dark[1:, 1:] | dark[1:, :-1] | dark[:-1, 1:] | dark[:-1, :-1]
    assert not path.ds[beside].any()
    assert not path.dt[beside].any()
    assert RESTING > 1  # cells that a round border cuts rest too


@pytest.mark.parametrize(
    ("source", "rounding"), [("beam", 1e-14), ("round beam", 1e-14), ("Gaussian beam", 1e-4)]
)
def test_moved_cells_emit_all_of_the_flux(tmp_path, backend, source, rounding):
    light = small_light(tmp_path, backend, SOURCES[source])
    path = LensPaths(light)(SHIFT)
    emitted = path.emitted(light.cells, 1.0)
    assert emitted.min() >= 0
    assert (
        np.abs(emitted / light.cells.emitted.max() - light.cells.emitted / light.cells.emitted.max()).max()
        > 0.01
    )
    assert emitted.sum() == pytest.approx(light.cells.emitted.sum(), rel=rounding)


@pytest.mark.parametrize("source", SOURCES)
def test_light_of_cells_that_stay_on_the_lens_is_the_light(tmp_path, backend, source):
    """Their light and that of cells which slide differ by the size of cells: by its square."""
    off = []
    for per_pixel in (3, 6):
        light = small_light(tmp_path, backend, SOURCES[source], per_pixel=per_pixel)
        linear = LinearLight(light)
        free, kept = light(SHIFT)[0], linear.traced(SHIFT)
        assert kept.sum() == pytest.approx(free.sum(), rel=2e-5)
        off.append(np.linalg.norm(kept - free) / np.linalg.norm(free - linear.irradiance))
    assert off[1] < 0.4 * off[0]
    assert off[1] < 0.05


@pytest.mark.parametrize("name", ["lens.decentre_x", "source.tilt_z", "source.decentre_y", "source.size"])
def test_what_slides_over_a_rough_lens_is_predicted(tmp_path, backend, name):
    """Even where light moves by half a pixel, and slides half a millimetre over the knots."""
    light = small_light(tmp_path, backend, {"source.half_width": [7.0, 7.0]}, height=0.05)
    linear = LinearLight(light)
    tolerance = next(t for t in tolerances_of(light.system) if t.name == name)
    p = tolerance.at(tolerance.amount)
    p = p * (0.5 * light.screen.pitch[0] / light.moved_by(p))
    traced = linear.traced(p) - linear.irradiance
    assert np.linalg.norm(linear.moved(p)[1] - linear.irradiance - traced) < 0.02 * np.linalg.norm(traced)


def test_the_front_is_followed_where_it_alone_is_free(tmp_path, backend):
    from optics.tolerancing.perturbations import PerturbedLight

    system = small_system(tmp_path, FRONT, drop=FREE_REAR)
    light = PerturbedLight(system, backend)
    path = LensPaths(light)(SHIFT)
    middle = path.ds.shape[0] // 2
    # the beam is parallel, so that its points slide by the shift itself
    assert path.ds[middle, middle] == pytest.approx(0.05, rel=1e-3)
    assert path.dt[middle, middle] == pytest.approx(-0.03, rel=1e-3)


def test_light_of_a_picture_rests(tmp_path, backend):
    light = small_light(tmp_path, backend, {"source.profile": "image", "source.image": "picture.png"})
    path = LensPaths(light)(SHIFT)
    assert not path.ds.any()
    assert (path.emitted(light.cells, 1.0) == light.cells.emitted).all()
