"""The picture of a THB surface: its own values, its numbers, and a text of 40 kB at most."""

from xml.etree import ElementTree

import numpy as np
import pytest

from thbcad.hierarchy import THBSpace
from thbcad.splines import KnotVector
from thbcad.surfaces.thb_surface import PIXELS, THBSurface, value_map

MOST = 40_000  # bytes


@pytest.fixture(scope="module")
def large():
    """A surface of 227 x 227 poles on level 6, rough enough that nothing of its picture compresses."""
    kv = KnotVector.uniform(3, 7)
    board = [(i, j) for i in range(100) for j in range(i % 2, 100, 2)]
    space = THBSpace(kv, kv).uniform(5).refine({5: board})
    return THBSurface(space, np.random.default_rng(0).uniform(size=space.dim))


def wavy(d=None):
    space = THBSpace(KnotVector.uniform(3, 4, -2, 2), KnotVector.uniform(2, 3)).refine({0: [(1, 1)]})
    shape = space.dim if d is None else (space.dim, d)
    return THBSurface(space, np.random.default_rng(1).normal(size=shape))


def test_a_large_surface_has_a_small_picture(large):
    html = large._repr_html_()
    assert large.space.levels == 7
    assert len(html.encode()) <= MOST
    assert len(large.space._repr_html_().encode()) <= MOST


def test_the_picture_is_whole_and_asks_for_nothing():
    html = wavy()._repr_html_()
    page = ElementTree.fromstring(html)
    links = [e.attrib["href"] for e in page.iter() if "href" in e.attrib]
    assert len(links) == 1
    assert links[0].startswith("data:image/png;base64,")
    assert "script" not in html
    assert "http" not in html.replace('xmlns="http://www.w3.org/2000/svg"', "")


def test_the_values_on_the_map_are_those_of_the_surface():
    surface = wavy()
    _, values, drawn = value_map(surface, (200.0, 100.0))
    step = 1 / PIXELS
    u, v = -2 + 4 * step * (np.arange(PIXELS) + 0.5), step * (np.arange(PIXELS) + 0.5)
    k, m = 17, 90
    assert values.shape == (PIXELS, PIXELS)
    assert values[k, m] == pytest.approx(surface([u[k]], [v[m]])[0], abs=1e-13)
    assert drawn == 2


def test_the_numbers_stand_beside_it():
    surface = wavy()
    html = surface._repr_html_()
    _, values, _ = value_map(surface, (1.0, 1.0))
    for text in ("3 x 2", surface.space.dim, "-2 to 2", f"{values.min():.4g} to {values.max():.4g}"):
        assert f">{text}<" in html


@pytest.mark.parametrize("d", [1, 3])
def test_of_vectors_the_last_component_is_shown(d):
    surface = wavy(d)
    last = THBSurface(surface.space, surface.coefficients[:, -1])
    assert np.array_equal(value_map(surface, (9.0, 9.0))[1], value_map(last, (9.0, 9.0))[1])
    assert f">{d}, the last of them shown<" in surface._repr_html_()


def test_numbers_of_any_size_have_a_picture():
    space = wavy().space
    for size in (0.0, 1e-300, 1e300):
        assert "values" in THBSurface(space, size * np.resize([1.0, -1.0], space.dim))._repr_html_()
