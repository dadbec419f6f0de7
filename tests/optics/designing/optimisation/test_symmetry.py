"""Mirror symmetry: found where it is, left alone where it is not, kept bit for bit."""

import numpy as np
import pytest

from optics.designing.optimisation.loop import shape_lens
from optics.light.engines import ExactEngine
from optics.light.measuring import Mirrors, mirror_axes, symmetry_axes
from optics.scene.problem import Problem
from optics.scene.sources import Profile
from optics.scene.system import System
from tests.cases import slow_unless
from tests.optics.cases import small_space, small_system
from thbcad.hierarchy import THBSpace
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

CORNERS = [(0, 0), (0, 3), (4, 0), (4, 3)]


def space_of(cells, degrees=(3, 2), fine=None):
    """Return a space of 5 x 4 spans with some cells of level 0 (and of level 1) refined."""
    space = THBSpace(
        KnotVector.uniform(degrees[0], 5, -10.0, 10.0), KnotVector.uniform(degrees[1], 4, -6.0, 6.0)
    )
    if not cells:
        return space
    space = space.refine({0: cells})
    return space.refine({1: fine}) if fine else space


SPACES = {
    "uniform": (space_of([]), (0, 1)),
    "corners": (space_of(CORNERS), (0, 1)),
    "middle column": (space_of([(2, 0), (2, 1), (2, 2), (2, 3)]), (0, 1)),
    "bottom": (space_of([(0, 0), (4, 0)]), (0,)),
    "left": (space_of([(0, 0), (0, 3), (1, 1), (1, 2)]), (1,)),
    "one corner": (space_of([(0, 0)]), ()),
    "opposite corners": (space_of([(0, 0), (4, 3)]), ()),
    "two levels": (space_of(CORNERS, (2, 4), [(0, 0), (9, 0), (0, 7), (9, 7)]), (0, 1)),
    "two levels, one side": (space_of(CORNERS, (3, 3), [(0, 0), (9, 0)]), (0,)),
    "whole level": (
        space_of([(i, j) for i in range(5) for j in range(4)], fine=[(4, 3), (5, 3), (4, 4), (5, 4)]),
        (0, 1),
    ),
}
ALL = pytest.mark.parametrize(("space", "axes"), SPACES.values(), ids=SPACES.keys())


def mirrored(name, axis, extra, spans=(5, 4)):
    """Return (level, i, j) of the mirror image: function (extra = degree) or cell (extra = 0)."""
    level, *place = name
    place[axis] = (spans[axis] << level) + extra - 1 - place[axis]
    return level, *place


def brute(rows, values, axes, degrees):
    """Return values averaged with their mirror images, by a dictionary of names; an axis without all images
    is left out."""
    names = list(map(tuple, rows.tolist()))
    for axis in axes:
        by_name = dict(zip(names, values))
        images = [mirrored(name, axis, degrees[axis]) for name in names]
        values = [(by_name[n] + by_name[i]) / 2 for n, i in zip(names, images)]
    return np.array(values)


@ALL
@pytest.mark.parametrize("asked", [(), (0,), (1,), (0, 1)], ids=str)
def test_averages_are_those_of_a_dictionary(space, axes, asked):
    mirrors, rng = Mirrors(space, asked), np.random.default_rng(3)
    kept = [axis for axis in asked if axis in axes]
    degrees = space.kv_u.degree, space.kv_v.degree
    for rows, average, extra in (
        (space.functions, mirrors.of_coefficients, degrees),
        (space.cells, mirrors.of_cells, (0, 0)),
    ):
        values = rng.standard_normal(len(rows))
        np.testing.assert_array_equal(average(values), brute(rows, values, kept, extra))


@ALL
def test_averaging_twice_changes_no_bit(space, axes):
    mirrors, rng = Mirrors(space, (0, 1)), np.random.default_rng(4)
    for average, count in ((mirrors.of_coefficients, space.dim), (mirrors.of_cells, len(space.cells))):
        once = average(rng.standard_normal(count))
        assert average(once).tobytes() == once.tobytes()


@ALL
def test_a_surface_of_averaged_coefficients_is_its_own_mirror_image(space, axes):
    """Evaluated on mirrored points; a THB function is the mirror image of its partner up to rounding."""
    c = Mirrors(space, (0, 1)).of_coefficients(np.random.default_rng(5).standard_normal(space.dim))
    surface, x, y = THBSurface(space, c), np.linspace(-10, 10, 41), np.linspace(-6, 6, 37)
    z = surface.grid(x, y)
    for axis in (0, 1):
        difference = np.abs(z - np.flip(z, axis)).max()
        assert difference < 1e-14 * np.abs(c).max() * 10 if axis in axes else difference > 0.01


@ALL
def test_averaging_is_its_own_adjoint(space, axes):
    """A projection: <A g, c> = <g, A c>, which makes A the gradient's map as well."""
    mirrors, rng = Mirrors(space, (0, 1)), np.random.default_rng(6)
    g, c = rng.standard_normal((2, space.dim))
    assert mirrors.of_coefficients(g) @ c == pytest.approx(
        g @ mirrors.of_coefficients(c), abs=1e-13 * space.dim
    )


@pytest.mark.parametrize("axes", [(0,), (1,), (0, 1)], ids=str)
def test_a_mesh_without_symmetry_is_left_alone(axes):
    space = small_space()
    mirrors, rng = Mirrors(space, axes), np.random.default_rng(7)
    c, z = rng.standard_normal(space.dim), rng.standard_normal(len(space.cells))
    np.testing.assert_array_equal(mirrors.of_coefficients(c), c)
    np.testing.assert_array_equal(mirrors.of_cells(z), z)


# Which directions are symmetric


def image(rows, columns, kind):
    """Return a picture that is symmetric in x ("x"), in y ("y"), in both or in none."""
    s, t = ((2 * np.arange(n) + 1) / n - 1 for n in (columns, rows))
    a = np.cos(s) if "x" in kind else np.cos(s - 0.3)
    b = np.cos(t) if "y" in kind else np.cos(t - 0.3)
    return np.outer(b, a)


@pytest.mark.parametrize("shape", [(8, 8), (7, 10), (9, 5)])
@pytest.mark.parametrize("kind", ["", "x", "y", "xy"])
def test_axes_of_a_target(shape, kind):
    found = mirror_axes(image(*shape, kind), Profile())
    assert found == tuple(axis for axis, name in enumerate("xy") if name in kind)


@pytest.mark.parametrize("pixel", [(0, 0), (70, 11), (149, 3), (150, 200), (299, 12)])
@pytest.mark.parametrize("flipped", [False, True])
def test_one_pixel_anywhere_breaks_the_symmetry(pixel, flipped):
    target = image(300, 201, "xy")
    target[pixel] += 1e-9
    assert mirror_axes(target.T if flipped else target, Profile()) == ()


@pytest.mark.parametrize("kind", ["", "x", "y", "xy"])
def test_a_source_without_symmetry_takes_the_targets(kind):
    found = mirror_axes(image(8, 8, "xy"), Profile("image", light=image(6, 5, kind)))
    assert found == tuple(axis for axis, name in enumerate("xy") if name in kind)


@pytest.mark.parametrize("profile", [Profile("round"), Profile("gaussian", (0.2, 0.9))], ids=lambda p: p.kind)
def test_profiles_by_formula_are_symmetric(profile):
    assert mirror_axes(image(8, 8, "xy"), profile) == (0, 1)


def test_one_pixel_that_differs_ends_the_symmetry():
    target = image(8, 8, "xy")
    target[2, 1] *= 1 + 1e-6
    assert mirror_axes(target, Profile()) == ()
    target = image(8, 8, "xy")
    target[2, 1] *= 1 + 1e-15  # rounding does not
    assert mirror_axes(target, Profile()) == (0, 1)


# Designs

TOPHAT = {
    "target.kind": "tophat",
    "target.shape": "ellipse",
    "refinement.alpha": [0.9],
    "optimizer.iterations": [4],
    "target.pixels": [48, 40],
    "lens.rear.freeform.spans": [5, 4],
}
SOURCES = {
    "flat": {"optimizer.start": "flat"},
    "transport": {},
    "curved front": {"lens.front.radius": 60.0},
    "front free": {"lens.front.freeform": {"spans": [4, 4], "max_level": 1, "z_freedom": 0.5}},
    "lambertian": {
        "source.kind": "lambertian",
        "source.half_width": [0.5, 0.5],
        "source.half_angle": 30.0,
        "optimizer.rays_per_pixel": 1.0,
    },
    "point": {
        "source.kind": "point",
        "source.half_angle": 40.0,
        "source.distance": 8.0,
        "optimizer.rays_per_pixel": 1.0,
    },
}


@pytest.fixture
def two_threads(backend):
    """Dr.Jit on two threads, among which rays are shared without regard to symmetry."""
    backend.dr.set_thread_count(2)
    yield backend
    backend.dr.set_thread_count(1)


def rows_by_name(rows, values):
    return dict(zip(map(tuple, rows.tolist()), values))


@pytest.mark.every(3)
@pytest.mark.parametrize("source", slow_unless(("flat", "transport", "front free").count, SOURCES))
def test_a_symmetric_problem_gets_a_symmetric_lens_bit_for_bit(tmp_path, two_threads, source):
    system = small_system(tmp_path, TOPHAT | SOURCES[source])
    shaped, _ = shape_lens(system, two_threads, ExactEngine(two_threads))
    lens = shaped.designed
    rear = lens.rear.sag.space
    assert len(rear.cells) < 20 << (2 * (rear.levels - 1))  # refined here and there
    for sag, spans in zip(lens.sags, ((5, 4),) if len(lens.sags) == 1 else ((4, 4), (5, 4)), strict=True):
        space = sag.space
        assert space.levels > 1
        assert np.ptp(sag.coefficients) > 1e-4
        by_function = rows_by_name(space.functions, sag.coefficients)
        cells = set(map(tuple, space.cells.tolist()))
        for axis in (0, 1):
            for name, value in by_function.items():
                assert by_function[mirrored(name, axis, 3, spans)] == value
            assert {mirrored(name, axis, 0, spans) for name in cells} == cells


@pytest.mark.slow
def test_a_problem_symmetric_in_one_direction_keeps_that_one(tmp_path, two_threads):
    """A crescent is its own mirror image in x only."""
    changes = TOPHAT | {"target.shape": "crescent", "lens.rear.freeform.max_level": 1}
    shaped, _ = shape_lens(small_system(tmp_path, changes), two_threads, ExactEngine(two_threads))
    lens = shaped.designed
    sag = lens.rear.sag
    by_function = rows_by_name(sag.space.functions, sag.coefficients)
    across = [abs(by_function[n, (5 << n) + 2 - i, j] - v) for (n, i, j), v in by_function.items()]
    assert max(across) == 0
    up = [abs(by_function.get((n, i, (4 << n) + 2 - j), np.inf) - v) for (n, i, j), v in by_function.items()]
    assert max(up) > 1e-3


@pytest.mark.parametrize(
    ("changes", "axes"),
    [
        ({}, (0, 1)),
        ({"element.L1.tilt": [10, 0, 0]}, (0,)),
        ({"element.L1.position": [3, 0, -30]}, (1,)),
        ({"element.L2.tilt": [0, 5, 0]}, (1,)),
        ({"element.L2.position": [0, 2, 0]}, (0,)),
    ],
)
def test_an_element_out_of_a_plane_ends_the_symmetry_across_it(changes, axes):
    sides = {"front": {"half_width": (14, 14)}, "rear": {"half_width": (14, 14)}}
    lens = {"kind": "lens", "index": 1.5, "thickness": 6, **sides}
    fixed = sides | {"rear": {"half_width": (14, 14), "radius": 200, "freeform": False}}
    problem = Problem(
        source={"kind": "collimated", "half_width": (9, 9), "distance": 60},
        element=[lens | fixed | {"name": "L1", "position": (0, 0, -30)}, lens | {"name": "L2"}],
        target={"kind": "tophat", "position": (0, 0, 90), "half_width": (20, 20), "pixels": (8, 8)},
    )
    assert symmetry_axes(System(problem.with_(**changes))) == axes
