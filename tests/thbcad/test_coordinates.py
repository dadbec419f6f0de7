"""Whatever is called with coordinates follows numpy: scalars, arrays of any shape, arrays that broadcast; all
refuse what lies outside in the same sentence."""

import re

import numpy as np
import pytest

from thbcad import (
    BSplineSurface,
    Conic,
    FreeformSurface,
    KnotVector,
    NURBSCurve,
    NURBSSurface,
    PolynomialSag,
    THBSpace,
    THBSurface,
)

RNG = np.random.default_rng(0)
U, V = KnotVector.uniform(3, 4), KnotVector.uniform(2, 5, -1.0, 2.0)
POINTS = RNG.uniform(-1, 1, (U.dim, V.dim, 3))
WEIGHTS = RNG.uniform(0.5, 2, (U.dim, V.dim))
SPACE = THBSpace(U, V).refine({0: [(0, 0), (0, 1), (1, 0), (1, 1)]})
DEEP = SPACE  # no tensor product: evaluated cell by cell
for level in range(1, 9):
    DEEP = DEEP.refine({level: [(0, 0), (0, 1), (1, 0), (1, 1)]})
SAG = THBSurface(SPACE, RNG.uniform(-1, 1, SPACE.dim))
UV = {"u": (0.0, 1.0), "v": (-1.0, 2.0)}
XY = {"x": (-2.0, 2.0), "y": (-3.0, 3.0)}
# what is called, the domains of its coordinates, and the shape of a value
CALLED = {
    "BSplineSurface": (BSplineSurface(U, V, POINTS[..., 0]), UV, ()),
    "BSplineSurface of points": (BSplineSurface(U, V, POINTS), UV, (3,)),
    "THBSurface": (SAG, UV, ()),
    "THBSurface, cell by cell": (THBSurface(DEEP, RNG.uniform(-1, 1, DEEP.dim)), UV, ()),
    "THBSurface of points": (THBSurface(DEEP, RNG.uniform(-1, 1, (DEEP.dim, 2))), UV, (2,)),
    "NURBSCurve": (NURBSCurve(U, POINTS[:, 0], WEIGHTS[:, 0]), {"u": (0.0, 1.0)}, (3,)),
    "NURBSSurface": (NURBSSurface(U, V, POINTS, WEIGHTS), UV, (3,)),
    "FreeformSurface": (FreeformSurface((2, 3), Conic(10.0, 0.3), SAG), XY, ()),
    "FreeformSurface without sag": (FreeformSurface((2, 3), Conic(10.0, 0.3)), XY, ()),
    "Conic": (Conic(10.0, 0.3), XY, ()),
    "PolynomialSag": (PolynomialSag((2, 3), POINTS[..., 0]), XY, ()),
}
called = pytest.mark.parametrize("name", CALLED)
of_rectangles = pytest.mark.parametrize("name", [name for name in CALLED if name != "Conic"])


def test_both_ways_of_evaluation_are_here():
    assert SPACE.is_compact
    assert not DEEP.is_compact


@called
@pytest.mark.parametrize("order", [0, 1])
def test_values_have_the_shape_of_their_coordinates(name, order):
    f, domains, tail = CALLED[name]
    rows = [RNG.uniform(*domain, 6) for domain in domains.values()]
    orders = (order,) if len(rows) == 1 else (order, 0)

    def call(*x):
        return f(*x, orders if len(rows) > 1 else order)

    wanted = call(*rows)
    assert wanted.shape == (6, *tail)
    tables = call(*(x.reshape(2, 3) for x in rows))
    assert tables.shape == (2, 3, *tail)
    assert np.array_equal(tables.reshape(6, *tail), wanted)
    assert call(*(x[:0] for x in rows)).shape == (0, *tail)
    assert np.array_equal(call(*(x.tolist() for x in rows)), wanted)
    for scalar in (float, np.float64, np.asarray):
        value = call(*(scalar(x[2]) for x in rows))
        assert value.shape == tail
        assert type(value) is (np.ndarray if tail else np.float64)
        # sums of a few products, which numpy may order as it likes
        assert np.allclose(value, wanted[2], rtol=1e-13, atol=1e-14)
    if len(rows) > 1:
        both = call(rows[0][:2, None], rows[1][:3])
        assert both.shape == (2, 3, *tail)
        assert np.allclose(both, f.grid(rows[0][:2], rows[1][:3], orders), rtol=1e-12, atol=1e-13)
        assert np.array_equal(call(rows[0][2], rows[1]), call(np.full(6, rows[0][2]), rows[1]))


@of_rectangles
@pytest.mark.filterwarnings("error")
def test_coordinates_outside_are_refused_in_one_sentence(name):
    f, domains, _ = CALLED[name]
    points = {key: start for key, (start, _) in domains.items()}
    rows = {key: [start, stop] for key, (start, stop) in domains.items()}
    for key, (start, stop) in domains.items():
        for bad in (start - 1e-9, stop + 1e-9, np.nan, np.inf):
            sentence = re.escape(f"{key} = {bad} lies outside the domain [{start}, {stop}]")
            outside = {**rows, key: [stop, bad]}
            for call, x in ((f, {**points, key: bad}), (f, outside), (getattr(f, "grid", f), outside)):
                with pytest.raises(ValueError, match=f"^{sentence}$"):
                    call(*x.values())


def test_conics_end_where_their_root_does():
    sphere = Conic(10.0)
    assert sphere(6.0, 8.0) == 10.0
    for bad in ((6.0, 8.1), ([0.0, 6.0], 8.1)):
        with pytest.raises(ValueError, match=r"^r = 10\.08\d+ lies outside the domain \[0\.0, 10\.0\]$"):
            sphere(*bad)
    with pytest.raises(ValueError, match=r"^r = nan lies outside the domain \[0\.0, inf\]$"):
        Conic(10.0, -1.0)(np.nan, 0.0)
    with np.errstate(invalid="ignore"):
        assert np.isnan(sphere.formula(np.array([11.0]), 0.0)).all()


@pytest.mark.parametrize("name", [name for name, (_, domains, _) in CALLED.items() if len(domains) == 2])
def test_shapes_that_do_not_broadcast_are_refused(name):
    with pytest.raises(ValueError, match=r"broadcast.* \(2,\) (and )?\(3,\)"):
        CALLED[name][0]([0.0, 0.0], [0.0, 0.0, 0.0])
