"""What `print` shows of surfaces and lenses: one line with kind, degree and size, and no net."""

import numpy as np
import pytest

from tests.thbcad.drawings.cases import WAVY, wavy_sag
from thbcad.sags import PolynomialSag
from thbcad.splines import (
    BSplineCurve,
    BSplineSurface,
    KnotVector,
    NURBSSurface,
    circular_arc,
    revolved,
)

KV = KnotVector.uniform(3, 40)
NET = np.random.default_rng(0).uniform(-1, 1, (KV.dim, KV.dim, 3))
ONES = np.ones((KV.dim, KV.dim))
RECORDS = {
    "BSplineSurface(degree (3, 3), 43 x 43 points in 3 dimensions)": BSplineSurface(KV, KV, NET),
    "BSplineSurface(degree (3, 3), 43 x 43 scalar coefficients)": BSplineSurface(KV, KV, NET[..., 0]),
    "NURBSSurface(degree (3, 3), 43 x 43 points in 3 dimensions)": NURBSSurface(KV, KV, NET, ONES),
    "BSplineCurve(degree 3, 43 points in 3 dimensions)": BSplineCurve(KV, NET[0]),
    "NURBSCurve(degree 2, 7 points in 2 dimensions)": circular_arc(1.0),
    "THBSurface(of THBSpace(degree (3, 3), 1 levels, 30 cells, dim 72), scalar coefficients)": wavy_sag(1.0),
    "FreeformSurface(10 x 8 mm, radius -40 mm, K -1, sag of 72 coefficients)": WAVY.rear,
    "FreeformSurface(10 x 8 mm, plane, no sag)": WAVY.front,
    "PolynomialSag(10 x 8 mm, degree (2, 1))": PolynomialSag((5, 4), np.ones((3, 2))),
}


@pytest.mark.parametrize("words", RECORDS)
def test_a_record_is_printed_in_one_line(words):
    assert repr(RECORDS[words]) == words


def test_a_lens_is_its_two_surfaces():
    assert repr(WAVY) == f"Lens(front={WAVY.front!r}, rear={WAVY.rear!r}, 3 mm, n 1.5)"


def test_revolved_and_periodic_records_show_no_arrays():
    for record in (revolved(circular_arc(1.0, centre=(3.0, 0.0))), KnotVector.periodic(3, np.arange(8.0))):
        assert "\n" not in repr(record)
        assert "array" not in repr(record)
