"""From a problem file to rays, surfaces and targets: every kind of source, one or two free surfaces."""

import math
import re

import numpy as np
import pytest
from PIL import Image

from optics.base.runtime import UserError
from optics.scene.problem import load_problem
from optics.scene.sources import RayGrid, Rays, collimated_beam
from optics.scene.system import System, reach
from optics.scene.system.elements import freeforms
from optics.scene.system.reach import require_reachable
from tests.optics.cases import write_problem
from tests.optics.scene.problem.cases import refusal

LAMBERTIAN = {"source.kind": "lambertian", "source.half_width": [0.5, 0.25], "source.flux": 3.0}
POINT = {"source.kind": "point", "source.flux": 3.0, "source.half_angle": 50.0, "source.exponent": 2.0}
COLLIMATED = {"source.flux": 3.0}
KINDS = {"collimated": COLLIMATED, "lambertian": LAMBERTIAN, "point": POINT}
GLOW = np.array([[10, 0, 0, 0], [0, 0, 0, 200]], dtype=np.uint8)


def loaded(folder, changes=None):
    return load_problem(write_problem(folder, changes))


def glowing(folder, changes=None):
    """Return the small problem with a source whose light is the picture GLOW."""
    Image.fromarray(GLOW).save(folder / "glow.png")
    return loaded(folder, {"source.profile": "image", "source.image": "glow.png"} | (changes or {}))


# Rays


def test_a_collimated_source_is_a_beam(tmp_path):
    found = System(loaded(tmp_path, COLLIMATED)).source.rays((13, 11))
    wanted = collimated_beam((9.5, 9.5), 3.0, (10.0, 10.0), (13, 11))
    assert isinstance(found, RayGrid)
    np.testing.assert_array_equal(found.x, wanted.x)
    np.testing.assert_array_equal(found.y, wanted.y)
    np.testing.assert_array_equal(found.flux, wanted.flux)


@pytest.mark.parametrize(
    ("counts", "count"),
    [((64, 64), 4096), ((65, 65), 4096), ((100, 100), 8192), ((1, 1), 4), ((90, 20), 2048)],
)
def test_a_lambertian_source_takes_the_nearest_power_of_two(tmp_path, counts, count):
    found = System(loaded(tmp_path, LAMBERTIAN)).source.rays(counts)
    assert isinstance(found, Rays)
    assert found.origin.shape == found.direction.shape == (3, count)
    assert set(found.origin[2]) == {-2.0}
    assert np.abs(found.origin[0]).max() <= 0.5
    assert np.abs(found.origin[1]).max() <= 0.25


def test_a_point_takes_a_grid_of_directions_within_its_cone(tmp_path):
    found = System(loaded(tmp_path, POINT)).source.rays((31, 17))
    assert found.origin.shape == (3, 31 * 17)
    assert found.direction[2].min() >= math.cos(math.radians(50)) - 1e-15
    np.testing.assert_allclose(
        found.flux / found.flux.max(),
        (found.direction[2] / found.direction[2].max()) ** 2,
        rtol=1e-13,
    )


@pytest.mark.parametrize("changes", KINDS.values(), ids=KINDS.keys())
def test_all_rays_carry_the_flux(tmp_path, changes):
    found = System(loaded(tmp_path, changes)).source.rays((32, 32))
    assert found.total == pytest.approx(3.0, rel=1e-13)


@pytest.mark.parametrize("most", [64, 1000, 1 << 20])
@pytest.mark.filterwarnings("ignore:The balance properties of Sobol")
@pytest.mark.parametrize("changes", [COLLIMATED, LAMBERTIAN], ids=["collimated", "lambertian"])
def test_parts_are_small_and_make_up_the_whole(tmp_path, changes, most):
    parts = list(System(loaded(tmp_path, changes)).source.parts((32, 32), None, most))
    sizes = [len(p.x) * len(p.y) if isinstance(p, RayGrid) else p.origin.shape[1] for p in parts]
    assert max(sizes) <= most
    assert sum(sizes) == 1024
    assert sum(p.total for p in parts) == pytest.approx(3.0, rel=1e-13)


@pytest.mark.parametrize("changes", KINDS.values(), ids=KINDS.keys())
def test_fresh_rays_differ_and_the_usual_ones_do_not(tmp_path, changes):
    problem = loaded(tmp_path, changes)

    def numbers(fresh):
        rays = System(problem).source.rays((16, 16), fresh)
        return rays.x if isinstance(rays, RayGrid) else rays.direction

    np.testing.assert_array_equal(numbers(None), numbers(None))
    one, other, again = (numbers(np.random.default_rng(seed)) for seed in (1, 2, 1))
    np.testing.assert_array_equal(one, again)
    assert not np.isin(one.ravel(), other.ravel()).any()
    assert not np.isin(one.ravel(), numbers(None).ravel()).any()


# The source's picture


def test_the_sources_picture_is_linear_light(tmp_path):
    """200 counts 20 times as much as 10, whatever the target's encoding."""
    profile = System(glowing(tmp_path)).source.profile
    assert profile.kind == "image"
    np.testing.assert_allclose(profile.light, GLOW * (profile.light.max() / 200), rtol=1e-14)


@pytest.mark.parametrize("changes", [COLLIMATED, LAMBERTIAN], ids=["collimated", "lambertian"])
def test_the_sources_picture_glows_where_it_is_bright(tmp_path, changes):
    """Row 0 at +y: 10 parts of 210 at the upper left, the others at the lower right; counts to 2 n^-1/2."""
    rays = System(glowing(tmp_path, changes)).source.rays((64, 64))
    if isinstance(rays, RayGrid):
        x, y = np.meshgrid(rays.x / 9.5, rays.y / 9.5, indexing="ij")
        flux = rays.flux
    else:
        x, y, flux = rays.origin[0] / 0.5, rays.origin[1] / 0.25, rays.flux
    upper, lower = flux[(x < -0.5) & (y > 0)].sum() / 3.0, flux[(x > 0.5) & (y < 0)].sum() / 3.0
    assert [upper, lower] == pytest.approx([10 / 210, 200 / 210], abs=2 / 64)
    assert upper + lower == pytest.approx(flux.sum() / 3.0, rel=1e-13)


# Surfaces

FREE_FRONT = {
    "lens.front.freeform.degree": 4,
    "lens.front.freeform.spans": [3, 2],
    "lens.front.freeform.max_level": 1,
    "lens.front.freeform.z_freedom": 0.25,
}


def test_the_rear_alone_is_free_by_default(tmp_path):
    problem = loaded(tmp_path)
    lens = System(problem).base
    assert lens.front.sag is None
    assert len(lens.sags) == 1
    assert freeforms(problem) == (problem.lens.rear.freeform,)


def test_a_free_front_has_a_sag_of_zeros_on_its_own_mesh(tmp_path):
    problem = loaded(tmp_path, FREE_FRONT | {"lens.front.half_width": [10.0, 8.0]})
    lens = System(problem).base
    assert freeforms(problem) == (problem.lens.front.freeform, problem.lens.rear.freeform)
    assert lens.sags == (lens.front.sag, lens.rear.sag)
    for sag, degree, spans, half_width in (
        (lens.front.sag, 4, (3, 2), (10.0, 8.0)),
        (lens.rear.sag, 3, (4, 4), (10.0, 10.0)),
    ):
        assert not sag.coefficients.any()
        assert sag.space.dim == (spans[0] + degree) * (spans[1] + degree)
        for kv, n, h in zip((sag.space.kv_u, sag.space.kv_v), spans, half_width):
            assert (kv.degree, kv.start, kv.stop, len(kv.breaks)) == (degree, -h, h, n + 1)


def test_sags_are_put_back_where_they_belong(tmp_path):
    lens = System(loaded(tmp_path, FREE_FRONT)).base
    lifted = [
        type(sag)(sag.space, np.full(sag.space.dim, value)) for sag, value in zip(lens.sags, (-0.25, 0.5))
    ]
    found = lens.with_sags(lifted)
    assert found.sags == tuple(lifted)
    assert [found.front([0.0], [0.0])[0], found.rear([0.0], [0.0])[0]] == pytest.approx(
        [-0.25, 0.5], abs=1e-15
    )
    assert (found.front.conic, found.rear.conic, found.thickness) == (
        lens.front.conic,
        lens.rear.conic,
        lens.thickness,
    )
    for wrong in ([], lifted[:1], [*lifted, lifted[0]]):
        with pytest.raises(ValueError, match=rf"sags must be 2 surfaces, got {len(wrong)}"):
            lens.with_sags(wrong)


# What can be lit at all

WIDE = {"target.distance": 20.0, "target.half_width": [90.0, 90.0]}


def test_a_target_beyond_the_greatest_deflection_is_refused_for_a_beam_behind_a_plane(tmp_path):
    problem = loaded(tmp_path, WIDE)
    with pytest.raises(UserError, match=r"degrees aside from the beam"):
        require_reachable(System(problem))


def test_the_corner_of_a_square_lies_farther_aside_than_its_sides(tmp_path):
    """43.1 degrees in x and in y are 52.9 aside; a far field comes no nearer by a larger distance."""
    far = {"target.distance": math.inf, "target.half_width": [44.0, 44.0]}
    with pytest.raises(UserError, match=r"52\.9 degrees aside .* turn target\.tilt nearer") as refused:
        require_reachable(System(loaded(tmp_path, far)))
    proposed = float(re.search(r"half_width=\[([\d.]+)", str(refused.value))[1])
    assert 36 < proposed < 40
    require_reachable(System(loaded(tmp_path, far | {"target.half_width": [proposed] * 2})))


def test_a_target_of_many_pixels_is_judged_by_merged_ones(tmp_path, monkeypatch):
    """12 x 12 in place of 48 x 48: within the part of the light that lies in a pixel at the edge."""

    def refused():
        system = System(loaded(tmp_path, WIDE | {"target.pixels": [48, 48]}))
        told = refusal(require_reachable, system)
        share, degrees = re.match(r"(\d+)% .* up to ([\d.]+) degrees", told).groups()
        return float(share), float(degrees)

    share, degrees = refused()
    monkeypatch.setattr(reach, "MOST_PIXELS", 12)
    assert refused() == (pytest.approx(share, abs=100 * 4 / 12), pytest.approx(degrees, abs=2))
    assert refused() != (share, degrees)


@pytest.mark.parametrize(
    "changes",
    [
        LAMBERTIAN,
        POINT,
        {"lens.front.radius": 60.0},
        {"target.distance": math.inf, "target.half_width": [36.0, 36.0]},
    ],
    ids=["lambertian", "point", "curved front", "far field"],
)
def test_other_light_is_not_refused(tmp_path, changes):
    problem = loaded(tmp_path, WIDE | changes)
    require_reachable(System(problem))
