"""Records are values: equal, with equal hashes, where what they hold is equal; so are their copies."""

import copy
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest

from thbcad import (
    Approximation,
    BSplineSurface,
    Conic,
    Fit,
    FreeformSurface,
    KnotVector,
    Lens,
    NURBSCurve,
    NURBSSurface,
    PeriodicKnotVector,
    PolynomialSag,
    Pose,
    Samples,
    THBSpace,
    THBSurface,
    approximated,
    fit,
    manufacturability,
)

KV = KnotVector.uniform(1, 2)
NET = np.arange(9.0).reshape(3, 3)
# records that hold one number x among others
MAKE = {
    "KnotVector": lambda x: KnotVector(1, [x, x, 1, 1]),
    "PeriodicKnotVector": lambda x: PeriodicKnotVector(2, [x, 0.7, 1]),
    "THBSpace": lambda x: THBSpace(KV, KnotVector(1, [x, x, 1, 1])).refine({0: [(1, 0)]}),
    "THBSurface": lambda x: THBSurface(THBSpace(KV, KV), [x] * 9),
    "BSplineSurface": lambda x: BSplineSurface(KV, KV, x * NET),
    "Approximation": lambda x: Approximation(BSplineSurface(KV, KV, NET), x),
    "NURBSCurve": lambda x: NURBSCurve(KV, [[x], [1], [2]], 2.0),
    "NURBSSurface": lambda x: NURBSSurface(KV, KV, NET[..., None] + x, NET + 1),
    "Conic": lambda x: Conic(30.0, x),
    "PolynomialSag": lambda x: PolynomialSag((2, 3), [[x, 1.0]]),
    "FreeformSurface": lambda x: FreeformSurface((2, 3), Conic(30.0, x)),
    "Lens": lambda x: Lens(FreeformSurface((2, 3)), FreeformSurface((2, 3), Conic(30.0, x)), 1.0, 1.5),
    "Samples": lambda x: Samples([0.0, 1.0], [x, 1.0], [[1.0, 2.0], [3.0, 4.0]]),
    "Fit": lambda x: Fit(MAKE["THBSurface"](x), 1.0, x, "noise", (), np.array([3, 5]), False),
    "Pose": lambda x: Pose.at((x, 0, 1), (0, 0, 1.0)),
}
named = pytest.mark.parametrize("name", MAKE)


@named
def test_records_are_equal_where_their_numbers_are(name):
    one, same, other = map(MAKE[name], (0.0, -0.0, 0.5))
    assert one == same
    assert hash(one) == hash(same)
    assert one != other
    assert len({one, same, other}) == 2
    assert all(one != make(0.0) for key, make in MAKE.items() if key != name)


@named
@pytest.mark.parametrize(
    "again",
    [copy.copy, copy.deepcopy, lambda record: pickle.loads(pickle.dumps(record))],
    ids=["copy", "deepcopy", "pickle"],
)
def test_copies_are_equal_and_read_only_and_have_no_caches(name, again):
    record = MAKE[name](0.0)
    for cache in ("breaks", "homogeneous", "cells"):  # fill them
        getattr(record, cache, None)
    other = again(record)
    assert set(vars(other)) == set(type(record).__dataclass_fields__)
    assert all(not x.flags.writeable for x in vars(other).values() if isinstance(x, np.ndarray))
    assert other == record
    assert hash(other) == hash(record)


def test_records_are_found_again_in_another_process():
    """Hashes of bytes and names differ between processes: none travels with a pickle."""
    hash_of_each = {MAKE[name](0.0): name for name in MAKE}
    code = (
        "import pickle, sys; from tests.thbcad.test_values import MAKE; "
        "found = pickle.load(sys.stdin.buffer); "
        "assert [found[make(-0.0)] for make in MAKE.values()] == list(MAKE)"
    )
    env = {**os.environ, "PYTHONHASHSEED": "1"}
    subprocess.run([sys.executable, "-c", code], input=pickle.dumps(hash_of_each), env=env, check=True)


def test_spaces_are_equal_where_their_cells_are():
    """However they came about."""
    space = THBSpace(KV, KV)
    fine = space.refine({0: [(0, 0), (1, 1)]})
    assert space.refine({0: [(1, 1)]}).refine({0: [(0, 0)]}) == fine == pickle.loads(pickle.dumps(fine))
    assert fine != space.refine({0: [(0, 0), (0, 1)]})
    assert fine.coarsen({0: [(0, 0), (1, 1)]}) == space != fine


def test_records_of_other_types_are_not_equal():
    assert KnotVector(2, [0, 0, 0, 1, 1, 1]) != PeriodicKnotVector(2, [0, 0, 1])
    assert KV.knots.tolist() != KV
    assert (THBSurface(THBSpace(KV, KV), np.ones(9)) == 1) is False


def test_records_print_one_line():
    """The results of searches and proofs, too."""
    lens = MAKE["Lens"](0.0)
    found = [fit(THBSpace(KV, KV), lambda u, v: u * v, 1.0), manufacturability(lens)]
    found += [approximated(Conic(30.0), KV, KV, 1.0), Samples(*np.ones((3, 9)))]
    for record in (*found, *(make(0.0) for make in MAKE.values())):
        assert repr(record).startswith(f"{type(record).__name__}(")
        assert "\n" not in repr(record)
        assert "array" not in repr(record)
    assert repr(Pose.at((1, 2, 3), (0, 0, np.pi / 2))) == "Pose(shift (1, 2, 3) mm, rotated by 90 degrees)"
    assert repr(MAKE["Samples"](0.0)) == "Samples(2 points, values in 2 dimensions)"
