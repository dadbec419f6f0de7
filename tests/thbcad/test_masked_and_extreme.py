"""Masked, complex and extreme numbers: every door refuses them, in one sentence and without a warning."""

import numpy as np
import pytest

from thbcad import (
    BSplineCurve,
    BSplineSurface,
    Conic,
    FreeformSurface,
    KnotVector,
    NURBSCurve,
    NURBSSurface,
    PolynomialSag,
    Samples,
    THBSpace,
    THBSurface,
    circular_arc,
    conic_arc,
    interpolate,
    line,
    quasi_interpolate,
)

KV, RING = KnotVector.uniform(3, 4), KnotVector.periodic(2, np.arange(6.0))
SPACE = THBSpace(KV, KV)
FINE = SPACE.refine({0: [(i, j) for i in range(4) for j in range(3)]})
NET = np.random.default_rng(0).uniform(-1, 1, (7, 7))
POINTS = np.stack([NET, NET.T, NET**2], axis=-1)
SHEET, SAG = BSplineSurface(KV, KV, NET), THBSurface(FINE, np.ones(FINE.dim))
PATCH, ARC = NURBSSurface(KV, KV, POINTS), circular_arc(1.0, 1.0)
REAR, POLYNOMIAL = FreeformSurface((1, 1), Conic(30.0)), PolynomialSag((1, 1), NET)

# by name: what takes a net (7, 7), or a row of numbers within (0, 1)
OF_A_NET = {
    "BSplineSurface": lambda z: BSplineSurface(KV, KV, z),
    "list of rows": lambda z: BSplineSurface(KV, KV, list(z)),
    "THBSurface": lambda z: THBSurface(SPACE, z.ravel()),
    "interpolate": lambda z: interpolate(KV, KV, z),
    "interpolated function": lambda z: interpolate(KV, KV, lambda u, v: z.ravel()),
    "quasi-interpolated function": lambda z: quasi_interpolate(SPACE, lambda u, v: z.ravel()),
    "PolynomialSag": lambda z: PolynomialSag((1, 1), z),
    "weights": lambda z: NURBSSurface(KV, KV, POINTS, z),
    "points": lambda z: NURBSCurve(KV, z),
    "grid of samples": lambda z: Samples.grid(KV.greville(), KV.greville(), z),
    "samples": lambda z: Samples(*np.random.default_rng(0).uniform(0, 1, (2, 49)), z.ravel()),
    "affine image": lambda z: NURBSCurve(KV, NET).transform(z),
}
OF_A_ROW = {
    "KnotVector": lambda u: KnotVector(1, np.ma.concatenate([[0, 0], u, [1, 1]])),
    "clamped": lambda u: KnotVector.clamped(1, u, 0, 1),
    "insert": KV.insert,
    "insert in a periodic one": RING.insert,
    "coefficients of a curve": lambda u: BSplineCurve(KV, u),
    "breaks of a period": lambda u: KnotVector.periodic(2, u),
    "span": KV.span_of,
    "basis": KV.basis,
    "collocation": KV.collocation,
    "scattered": lambda u: SHEET(u, u),
    "grid": lambda u: SHEET.grid(u, u),
    "THB scattered": lambda u: SAG(u, u),
    "THB grid": lambda u: SAG.grid(u, u),
    "curve": ARC,
    "patch": lambda u: PATCH(u, u),
    "patch grid": lambda u: PATCH.grid(u, u),
    "conic": lambda u: Conic(30.0)(u, u),
    "conic grid": lambda u: Conic(30.0).grid(u, u),
    "lens surface": lambda u: REAR(u, u),
    "lens surface grid": lambda u: REAR.grid(u, u),
    "polynomial": lambda u: POLYNOMIAL(u, u),
    "polynomial grid": lambda u: POLYNOMIAL.grid(u, u),
    "samples": lambda u: Samples(u, u, u),
    "start of a line": lambda u: line(u, ROW),
    "end of a line": lambda u: line(ROW, u),
    "middle of a conic arc": lambda u: conic_arc(ROW, u, ROW, 1.0),
    "centre of an arc": lambda u: circular_arc(1.0, 1.0, centre=u),
    "weights of samples": lambda u: Samples(np.ones(7), np.ones(7), np.ones(7), u),
}
ROW = np.linspace(0.1, 0.9, 7)


@pytest.mark.parametrize("name", OF_A_NET)
def test_masked_nets_are_refused(name):
    """-9999 under a mask, as measured data come."""
    masked = np.ma.masked_array(np.where(NET < -0.5, -9999.0, NET), NET < -0.5)
    with pytest.raises(ValueError, match=r"numbers must not be masked, got \d+ masked; leave them out"):
        OF_A_NET[name](masked)


@pytest.mark.parametrize("name", OF_A_ROW)
def test_masked_rows_are_refused(name):
    with pytest.raises(ValueError, match=r"numbers must not be masked, got 1 masked"):
        OF_A_ROW[name](np.ma.masked_array(ROW, np.arange(7) == 2))


@pytest.mark.parametrize("name", ["BSplineSurface", "list of rows", "interpolate", "grid of samples"])
def test_masked_arrays_without_a_masked_number_are_numbers(name):
    OF_A_NET[name](np.ma.masked_array(NET, False))


def test_masked_cells_are_refused():
    cells = np.ma.masked_array([[0, 0], [1, 1]], [[False, False], [True, True]])
    with pytest.raises(ValueError, match="numbers must not be masked, got 2 masked"):
        SPACE.refine({0: cells})


@pytest.mark.parametrize("make", [list, np.asarray, lambda u: u[1]], ids=["list", "array", "number"])
@pytest.mark.parametrize("name", [name for name in OF_A_ROW if name not in ("KnotVector", "samples")])
@pytest.mark.filterwarnings("error")
def test_complex_rows_are_refused(name, make):
    with pytest.raises(ValueError, match="numbers must be real, got complex128"):
        OF_A_ROW[name](make([0.1, 0.5 + 1j]))


# ---- numbers whose products are beyond float64 ----


@pytest.mark.filterwarnings("error")
def test_points_times_weights_must_be_finite():
    with pytest.raises(
        ValueError, match=r"points times weights must be finite, got .*1e\+300.* times 1e\+150"
    ):
        NURBSCurve(KV, np.full((7, 2), 1e300), np.full(7, 1e150))
    half = NURBSCurve(KV, np.full((7, 2), 1e150), np.full(7, 1e150))
    np.testing.assert_allclose(half([0.5]), [[1e150, 1e150]], rtol=1e-14)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", ["clamped", "periodic"])
def test_derivatives_beyond_float64_are_refused(kind):
    kv = KnotVector(1, [0, 0, 1e-310, 1, 1])
    if kind == "periodic":
        kv = KnotVector.periodic(1, [0, 1e-310, 0.5, 1])
    assert np.isfinite(kv.collocation([0.0, 5e-311, 0.7]).toarray()).all()
    with pytest.raises(ValueError, match="derivative 1 is beyond float64: knots lie too near to each other"):
        kv.collocation([0.0, 5e-311, 0.7], 1)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("radius", [1e-300, -1e-300, 1e300, 1e-41, 1e41])
def test_radii_whose_powers_are_beyond_float64_are_refused(radius):
    with pytest.raises(ValueError, match=r"radius must be 1e-40 to 1e\+40 in size or inf"):
        Conic(radius)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("constant", [1e300, -1e300])
def test_conic_constants_whose_powers_are_beyond_float64_are_refused(constant):
    with pytest.raises(ValueError, match=r"conic constant must be at most 1e\+40 in size"):
        Conic(30.0, constant)


@pytest.mark.filterwarnings("error")
def test_half_widths_whose_squares_are_beyond_float64_are_refused():
    with pytest.raises(ValueError, match=r"half_width must be two positive numbers of at most 1e\+100"):
        FreeformSurface((1e300, 1.0))


def test_masks_are_seen_in_lists_of_lists():
    kv, row = KnotVector.uniform(1, 1), np.ma.array([0.0, 1.0, 9999.0], mask=[0, 0, 1])
    with pytest.raises(ValueError, match="got 4 masked"):
        BSplineSurface(kv, kv, [[row, row], [row, row]])


def test_dates_are_no_numbers():
    kv = KnotVector.uniform(1, 1)
    with pytest.raises(ValueError, match="must be real"):
        BSplineSurface(kv, kv, np.full((2, 2), "2020", dtype="datetime64[Y]"))
