"""The fewest rectangles, and exact patches."""

import json
from functools import cache

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from tests.cases import DATA
from tests.thbcad.cases import knot_vectors
from thbcad.hierarchy import THBSpace
from thbcad.splines import KnotVector
from thbcad.surfaces.level_patches import cell_rectangles, rectangles
from thbcad.surfaces.thb_surface import THBSurface


def fewest(mask):
    """Return the least number of rectangles that tile a small mask, by trying all tilings."""

    @cache
    def count(cells):
        left = np.array(cells).reshape(mask.shape)
        if not left.any():
            return 0
        i, j = np.argwhere(left)[0]
        best = left.size
        for i1 in range(i + 1, mask.shape[0] + 1):
            for j1 in range(j + 1, mask.shape[1] + 1):
                if left[i:i1, j:j1].all():
                    rest = left.copy()
                    rest[i:i1, j:j1] = False
                    best = min(best, 1 + count(tuple(rest.ravel().tolist())))
        return best

    return count(tuple(mask.ravel().tolist()))


def assert_tiles(mask, found):
    covered = np.zeros(mask.shape, dtype=int)
    for i0, i1, j0, j1 in found:
        covered[i0:i1, j0:j1] += 1
    assert np.array_equal(covered, mask.astype(int))


@given(arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=5)))
def test_rectangles_are_the_fewest_that_tile(mask):
    found = rectangles(np.argwhere(mask))
    assert_tiles(mask, found)
    assert len(found) == fewest(mask)


@given(arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=30)))
def test_rectangles_tile_and_the_transposed_mask_needs_as_many(mask):
    found = rectangles(np.argwhere(mask))
    assert_tiles(mask, found)
    assert len(rectangles(np.argwhere(mask.T))) == len(found)
    assert len(rectangles(np.argwhere(mask[::-1]))) == len(found)


def annulus():
    data = json.loads((DATA / "thb_annulus.json").read_text())
    kv = KnotVector.uniform(data["degree"], data["n0"])
    space = THBSpace(kv, kv)
    for level, marked in enumerate(data["marked"]):
        space = space.refine({level: marked})
    return space


def test_the_annulus_needs_381_patches():
    """The proven minimum; one patch per quadtree leaf would be 1261, a greedy choice 400."""
    assert len(cell_rectangles(annulus())) == 381


@pytest.mark.every(2)
@pytest.mark.parametrize("components", [None, 3])
def test_annulus_patches_are_the_surface(components):
    space = annulus()
    shape = (space.dim,) if components is None else (space.dim, components)
    surface = THBSurface(space, np.random.default_rng(0).normal(size=shape))
    area = 0.0
    for patch in surface.to_patches():
        u, v = (np.linspace(kv.start, kv.stop, 5) for kv in (patch.kv_u, patch.kv_v))
        assert abs(patch.grid(u, v) - surface.grid(u, v)).max() <= 1e-13
        area += (patch.kv_u.stop - patch.kv_u.start) * (patch.kv_v.stop - patch.kv_v.start)
    assert area == pytest.approx(1.0, rel=1e-13)


@given(
    knot_vectors(max_degree=4, max_spans=4, scales=(1.0,)),
    knot_vectors(max_degree=4, max_spans=4, scales=(1.0,)),
    st.integers(0, 2**32 - 1),
)
def test_patches_of_random_hierarchies_are_the_surface(kv_u, kv_v, seed):
    """Multiple knots, orphan cells, islands: every patch agrees with the surface inside its rectangle."""
    rng = np.random.default_rng(seed)
    space = THBSpace(kv_u, kv_v)
    for level in range(3):
        cells = space.cells[space.cells[:, 0] == level, 1:]
        space = space.refine({level: cells[rng.random(len(cells)) < 0.4]})
    surface = THBSurface(space, rng.normal(size=space.dim))
    for patch in surface.to_patches():
        u, v = (
            kv.start + (kv.stop - kv.start) * np.linspace(0.01, 0.99, 7) for kv in (patch.kv_u, patch.kv_v)
        )
        assert abs(patch.grid(u, v) - surface.grid(u, v)).max() <= 1e-11
