"""The picture of a mesh: all borders of its cells, every line once, no more than one sees."""

import re

import numpy as np
import pytest

from thbcad.hierarchy import THBSpace
from thbcad.hierarchy.mesh_picture import LONGEST_TEXT, mesh_lines
from thbcad.splines import KnotVector

SIDE = 512.0  # pixels: the breaks of the cases are whole ones


def segments(path):
    """Return the lines of a path but for its frame, (n, 4) [x0, y0, x1, y1], and check the frame."""
    text = re.search(r' d="([^"]*)"', path)[1]
    frame, _, rest = text.partition("Z")
    assert frame == "M0 0H512V512H0"
    lines = []
    for x, y, way, end in re.findall(r"M([\d.e+]+) ([\d.e+]+)([HV])([\d.e+]+)", rest):
        a, b, c = float(x), float(y), float(end)
        lines.append([a, b, *((c, b) if way == "H" else (a, c))])
    return np.array(lines).reshape(-1, 4)


def drawn(lines):
    """Return how often each pixel border is drawn: across u, (513, 512), and across v, (512, 513)."""
    across = np.zeros((513, 512), int), np.zeros((512, 513), int)
    for x0, y0, x1, y1 in np.rint(lines).astype(int):
        if x0 == x1:
            across[0][x0, min(y0, y1) : max(y0, y1)] += 1
        else:
            across[1][min(x0, x1) : max(x0, x1), y0] += 1
    return across


def refined(seed, levels=3):
    """Return a space over 4 x 2 cells of unequal size, refined at random."""
    rng = np.random.default_rng(seed)
    space = THBSpace(KnotVector.clamped(2, [0.25, 0.5, 0.75], 0, 1), KnotVector.clamped(3, [0.25], 0, 1))
    for level in range(levels):
        cells = space.cells[space.cells[:, 0] == level][:, 1:]
        space = space.refine({level: cells[rng.uniform(size=len(cells)) < 0.6]})
    return space


@pytest.mark.parametrize("seed", range(4))
def test_every_border_of_a_leaf_cell_is_drawn_once_and_nothing_else(seed):
    space = refined(seed)
    path, levels = mesh_lines(space, SIDE, SIDE)
    assert levels == space.levels
    found = drawn(segments(path))
    wanted = np.zeros((513, 512), int), np.zeros((512, 513), int)
    for u0, u1, v0, v1 in np.rint(SIDE * space.boxes).astype(int):
        bottom, top = 512 - v0, 512 - v1
        wanted[0][[u0, u1], top:bottom] = 1
        wanted[1][u0:u1, [bottom, top]] = 1
    for lines in (*wanted, *found):  # the frame is drawn by itself
        long = lines if len(lines) == 513 else lines.T
        long[[0, -1]] = 0
    assert np.array_equal(found[0], wanted[0])
    assert np.array_equal(found[1], wanted[1])


def test_levels_that_one_cannot_tell_apart_are_left_out():
    kv = KnotVector.uniform(2, 40)
    space = THBSpace(kv, kv).refine({0: [(3, 4)]}).refine({1: [(6, 8)]}).refine({2: [(12, 16)]})
    assert mesh_lines(space, SIDE, SIDE)[1] == 3  # 512 / 160 = 3.2 pixels
    assert mesh_lines(space, SIDE, SIDE / 2)[1] == 2
    assert segments(mesh_lines(THBSpace(KnotVector.uniform(1, 300), kv), SIDE, SIDE)[0]).size == 0


def test_a_mesh_of_many_short_lines_stays_a_short_text():
    kv = KnotVector.uniform(1, 64)
    board = [(i, j) for i in range(64) for j in range(64) if (i + j) % 2]
    space = THBSpace(kv, kv).refine({0: board})
    path, levels = mesh_lines(space, SIDE, SIDE)
    assert levels == 1
    assert len(path) < LONGEST_TEXT + 200


def test_a_space_shows_itself_with_its_numbers():
    html = refined(0)._repr_html_()
    assert "THBSpace" in html
    assert "<td" in html
    assert f">{refined(0).dim}<" in html
    assert ">2 x 3<" in html
