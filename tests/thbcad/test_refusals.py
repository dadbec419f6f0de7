"""What all classes and verbs refuse alike: other types, complex numbers, bad orders and numbers."""

import warnings
from fractions import Fraction

import numpy as np
import pytest

from thbcad import (
    BSplineCurve,
    BSplineSurface,
    Conic,
    FreeformSurface,
    KnotVector,
    Lens,
    NURBSCurve,
    NURBSSurface,
    PolynomialSag,
    Samples,
    THBSpace,
    THBSurface,
    approximated,
    checks,
    circular_arc,
    error_bounds,
    fit,
    greatest_slope,
    interpolate,
    least_radii,
    least_squares,
    meridian,
    quasi_interpolate,
    revolved,
    ruled,
    value_range,
    write_lens,
    write_step,
    write_surface,
)
from thbcad.io import lens_from_dict, lens_to_dict
from thbcad.mounts import mount_of
from thbcad.poses import Pose

KV = KnotVector.uniform(3, 4)
SPACE = THBSpace(KV, KV).refine({0: [(i, j) for i in range(4) for j in range(3)]}).refine({1: [(0, 0)]})
NET = np.random.default_rng(0).uniform(-1, 1, (7, 7))
SHEET = BSplineSurface(KV, KV, NET)
CURVE = BSplineCurve(KV, NET)
RING = THBSpace(KnotVector.periodic(2, range(6)), KV)
SAG = THBSurface(SPACE, np.random.default_rng(0).uniform(-1, 1, SPACE.dim))
ARC = circular_arc(1.0, 1.0)
PATCH = NURBSSurface(KV, KV, np.stack([NET, NET.T, NET**2], axis=-1), 1 + NET**2)
GRID = Samples.grid(KV.greville(), KV.greville(), NET)
POLYNOMIAL = PolynomialSag((2, 3), NET)
FREEFORM = FreeformSurface((8, 8), Conic(60.0, -1.0), SAG)
BAD_TYPES = [None, 3, [0, 1], Conic()]
BAD_NUMBERS = [None, "a", np.nan, -np.inf, -1.0, -1e-9, 1j]

# ---- types ----


@pytest.mark.parametrize("bad", BAD_TYPES, ids=lambda x: type(x).__name__)
def test_nouns_need_knot_vectors_and_spaces(bad):
    nouns = (BSplineSurface, NET), (NURBSSurface, NET[..., None]), (lambda u, v, _: THBSpace(u, v), NET)
    for noun, net in nouns:
        with pytest.raises(ValueError, match=f"kv_u must be a KnotVector, got {type(bad).__name__}"):
            noun(bad, KV, net)
        with pytest.raises(ValueError, match=f"kv_v must be a KnotVector, got {type(bad).__name__}"):
            noun(KV, bad, net)
    with pytest.raises(ValueError, match=f"kv must be a KnotVector, got {type(bad).__name__}"):
        NURBSCurve(bad, np.zeros((7, 2)))
    with pytest.raises(ValueError, match=f"space must be a THBSpace, got {type(bad).__name__}"):
        THBSurface(bad, np.zeros(49))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: KV.prolongation(None), "finer must be a KnotVector, got NoneType"),
        (lambda: KV.restriction(3), "coarser must be a KnotVector, got int"),
        (lambda: KV.merge(None), "other must be a KnotVector"),
        (
            lambda: write_surface(FREEFORM, "x"),
            "surface must be a THBSurface or BSplineSurface or NURBSSurface, got FreeformSurface",
        ),
        (lambda: write_lens(SHEET, "x"), "lens must be a Lens, got BSplineSurface"),
        (lambda: write_step(SHEET, "x.igs"), "x.igs must end in .step or .stp"),
        (lambda: write_step(SHEET, "x.step"), "lens must be a Lens, got BSplineSurface"),
        (lambda: Lens(SHEET, FREEFORM, 1.0, 1.5), "front must be a FreeformSurface, got BSplineSurface"),
        (lambda: FreeformSurface((8, 8), 60.0), "conic must be a Conic, got float"),
        (
            lambda: FreeformSurface((8, 8), sag=SHEET),
            "sag must be a THBSurface or NoneType, got BSplineSurface",
        ),
        (
            lambda: FreeformSurface((8, 8)).to_parameters(np.zeros(1), np.zeros(1)),
            "a surface without sag has no spline parameters",
        ),
        (lambda: least_squares(SPACE, ([0.5], [0.5], [1.0])), "samples must be a Samples, got tuple"),
        (lambda: least_squares(KV, GRID), "space must be a THBSpace, got KnotVector"),
        (lambda: fit(KV, GRID, 1.0), "space must be a THBSpace, got KnotVector"),
        (lambda: fit(SPACE, 3.0, 1.0), "a function of u and v is needed, got float"),
        (
            lambda: fit(SPACE, ([0.5], [0.5], [1.0]), 1.0),
            "got tuple; fit and least_squares take points as Sam",
        ),
        (lambda: error_bounds(Conic(10.0), SAG), "surface must be a BSplineSurface, got THBSurface"),
        (lambda: approximated(np.hypot, KV, KV, 1.0), "function must be a BoundedFunction, got ufunc"),
        (lambda: FREEFORM.grid(NET, [1.0]), r"x must be one row of numbers, got shape \(7, 7\)"),
        (lambda: POLYNOMIAL.grid([1.0], NET), r"y must be one row of numbers, got shape \(7, 7\)"),
        (lambda: Conic(9.0).grid(NET, [1.0]), r"x must be one row of numbers, got shape \(7, 7\)"),
        (lambda: SAG.grid([[0.5]], [1.0]), r"u must be one row of numbers, got shape \(1, 1\)"),
        (lambda: SHEET.grid([[0.5]], [1.0]), r"u must be one row of numbers, got shape \(1, 1\)"),
        (lambda: value_range(None), "graph must be a BSplineSurface, got NoneType"),
        (lambda: value_range([SHEET, 3]), "graph must be a BSplineSurface, got int"),
        (lambda: least_radii(NET[0]), "graph must be a BSplineSurface, got float64"),
        (lambda: meridian(None, 1.0), "conic must be a Conic"),
        (lambda: revolved(Conic()), "curve must be a NURBSCurve, got Conic"),
        (lambda: ruled(ARC, None), "other must be a NURBSCurve, got NoneType"),
        (lambda: interpolate(KV, None, NET), "kv_v must be a KnotVector, got NoneType"),
        (lambda: quasi_interpolate(KV, np.hypot), "space must be a THBSpace, got KnotVector"),
        (lambda: BSplineCurve(SPACE, NET), "kv must be a KnotVector, got THBSpace"),
        (lambda: NURBSSurface.from_bspline(SAG), "spline must be a BSplineSurface, got THBSurface"),
        (lambda: NURBSCurve.from_homogeneous(SHEET), "spline must be a BSplineCurve, got BSplineSurface"),
        (
            lambda: FreeformSurface((8, 8), sag=THBSurface(RING, np.zeros(RING.dim))),
            "the sag must have clamped knots",
        ),
        (lambda: KV.segment(None, 1.0), "start must be a number, got None"),
        (lambda: KV.rescale(0.0, "a"), "stop must be a finite number, got a"),
        (
            lambda: THBSpace(KnotVector.uniform(1, 10**5), KnotVector.uniform(1, 10**5)),
            "at most 10000000 cells on level 0, got 100000 x",
        ),
    ],
)
def test_other_types_and_sizes_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_patches_may_come_one_by_one():
    assert value_range(iter([SHEET])) == value_range(SHEET)
    assert least_radii(iter([SHEET])) == least_radii(SHEET)


def test_conics_take_lists():
    assert (
        Conic(10.0)([1.0, 2.0], [2.0, 0.0]).tolist()
        == Conic(10.0)(np.array([1.0, 2.0]), np.array([2.0, 0.0])).tolist()
    )


# ---- arrays ----


@pytest.mark.parametrize(
    "call",
    [
        lambda x: KnotVector(1, np.r_[0, 0, 1, 1] * x),
        lambda x: BSplineSurface(KV, KV, NET * x),
        lambda x: THBSurface(SPACE, SAG.coefficients * x),
        lambda x: NURBSSurface(KV, KV, PATCH.coefficients * x),
        lambda x: NURBSCurve(ARC.kv, ARC.coefficients, ARC.weights * x),
        lambda x: Samples(GRID.u, GRID.v, GRID.values * x),
        lambda x: Samples.grid(KV.greville(), KV.greville(), NET * x),
        lambda x: interpolate(KV, KV, NET * x),
        lambda x: quasi_interpolate(SPACE, lambda u, v: u * x),
        lambda x: BSplineCurve(KV, NET * x),
        lambda x: SHEET(np.array([0.5]) * x, [0.5]),
    ],
)
def test_complex_numbers_are_refused(call):
    call(1.0)
    with pytest.raises(ValueError, match="numbers must be real, got complex128"):
        call(1.0 + 0j)


def test_splines_without_components_are_refused():
    for call in (
        lambda: BSplineSurface(KV, KV, np.zeros((7, 7, 0))),
        lambda: THBSurface(SPACE, np.zeros((SPACE.dim, 0))),
        lambda: NURBSCurve(KV, np.zeros((7, 0))),
        lambda: NURBSSurface(KV, KV, np.zeros((7, 7, 0))),
        lambda: Samples(GRID.u, GRID.v, np.zeros((49, 0))),
    ):
        with pytest.raises(ValueError, match=r"shapes?.*, 0\)"):
            call()


def test_knots_beyond_1e300_are_refused():
    with pytest.raises(ValueError, match=r"knots must lie between -1e\+300 and 1e\+300, got"):
        KnotVector.uniform(3, 2, 0.0, 1e308)
    assert np.isfinite(KnotVector.uniform(3, 2, -1e300, 1e300).greville()).all()


# ---- orders and numbers ----


@pytest.mark.parametrize(
    "derivative",
    [(1, 2, 3), (0,), 1, None, (), "ab", (0, -1), (0.5, 0), (1.0, 0), (None, 0), (True, 0)],
    ids=repr,
)
def test_orders_are_refused(derivative):
    u = np.array([0.5])
    for call in (
        SHEET,
        SHEET.grid,
        SAG,
        SAG.grid,
        PATCH,
        PATCH.grid,
        SPACE.collocation,
        FREEFORM,
        FREEFORM.grid,
        POLYNOMIAL,
        POLYNOMIAL.grid,
    ):
        with pytest.raises(ValueError, match="derivative must be"):
            call(u, u, derivative)
    for call in (Conic(10.0), Conic()):
        with pytest.raises(ValueError, match="derivative must be"):
            call(u, u, derivative)
    with pytest.raises(ValueError, match="derivative must be"):
        value_range(SHEET, derivative)


@pytest.mark.parametrize("digits", [400, 5000])  # Python writes no integer of 5000
@pytest.mark.parametrize(
    ("call", "name"),
    [
        (Conic, "radius"),
        (lambda x: Conic(5.0, x), "conic constant"),
        (lambda x: Lens(FREEFORM, FREEFORM, x, 1.5), "thickness"),
        (lambda x: KnotVector.uniform(3, 2, -x, 0), "start"),
        (lambda x: KV.rescale(0, x), "stop"),
        (lambda x: KnotVector.uniform(x, 2), "degree"),
        (lambda x: KnotVector.uniform(3, x), "spans"),
        (lambda x: KnotVector.clamped(3, [x], 0, 1), "numbers"),
        (lambda x: KnotVector(1, [0, 0, x, x]), "numbers"),
        (lambda x: KV.collocation([x]), "numbers"),
        (lambda x: FreeformSurface((1, x)), "half_width"),
        (lambda x: PolynomialSag.legendre((1, 1), [[x]]), "numbers"),
        (lambda x: PolynomialSag.zernike((1, 1), x, {(0, 0): 1.0}), "radius"),
        (lambda x: PolynomialSag.zernike((x, 1), 1.0, {(0, 0): 1.0}), "half_width"),
        (lambda x: PolynomialSag.zernike((1, 1), 1.0, {(0, 0): x}), "numbers"),
    ],
)
def test_integers_beyond_float64_are_refused_in_a_short_sentence(call, name, digits):
    with pytest.raises(ValueError, match=f"{name} must be") as raised:
        call(10**digits)
    assert len(str(raised.value)) < 120
    assert name == "numbers" or f"an integer of about {digits} digits" in str(raised.value)


@pytest.mark.parametrize(
    "value",
    [Fraction(10**400), np.longdouble("1e4000"), Fraction(1, 10**400)],
    ids=["large fraction", "long double", "small fraction"],
)
def test_other_numbers_beyond_float64_are_refused(value):
    with pytest.raises(ValueError, match="thickness must be"):
        Lens(FREEFORM, FREEFORM, value, 1.5)


def test_numbers_of_any_type_make_the_same_record():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert FreeformSurface(np.float32([5, 4])) == FreeformSurface((5, 4))
    assert Conic(-np.inf) == Conic()


@pytest.mark.parametrize("derivative", [[1, 0], np.array([1, 0])])
def test_orders_may_come_as_a_list(derivative):
    u = np.array([0.5])
    for call in (SHEET, SAG, PATCH, FREEFORM, POLYNOMIAL, Conic(10.0)):
        assert np.array_equal(call(u, u, derivative), call(u, u, (1, 0)))


@pytest.mark.parametrize(
    ("call", "wanted"),
    [
        (CURVE.remove_knots, "tolerance must be a number of at least 0"),
        (SHEET.remove_knots, "tolerance must be a number of at least 0"),
        (PATCH.remove_knots, "tolerance must be a number of at least 0"),
        (lambda x: fit(SPACE, GRID, x), "tolerance must be a positive number"),
        (lambda x: approximated(Conic(30.0), KV, KV, x), "tolerance must be a positive number"),
        (lambda x: value_range(SHEET, tolerance=x), "tolerance must be a number of at least 0"),
        (lambda x: greatest_slope(SHEET, x), "tolerance must be a number of at least 0"),
        (lambda x: least_radii(SHEET, x), "tolerance must be a number of at least 0"),
        (SAG.to_faces, "the price of a face must be a number of at least 0"),
        (lambda x: least_squares(SPACE, GRID, x), "smoothing must be a (finite number of at|number or one)"),
        (circular_arc, "radius must be a positive finite number"),
        (lambda x: meridian(Conic(30.0), x), "radius must be a positive finite number"),
        (
            lambda x: PolynomialSag.zernike((1, 1), x, {(0, 0): 1.0}),
            "radius must be a positive finite number",
        ),
    ],
)
def test_numbers_are_refused(call, wanted):
    for bad in (*BAD_NUMBERS, *[0.0] * ("positive" in wanted), *[np.inf] * ("finite" in wanted)):
        with pytest.raises(ValueError, match=f"{wanted}.*, got '?{bad}"):
            call(bad)


LONG = "A" * 100_000
PLATE = FreeformSurface((5.0, 4.0))


@pytest.mark.parametrize(
    "refuse",
    [
        lambda: checks.require_number("index", LONG),
        lambda: checks.require_integer("degree", LONG, 1, 10),
        lambda: checks.half_widths(LONG),
        lambda: Pose.tilted(LONG, (0, 0, 0)),
        lambda: KnotVector.uniform(LONG, 3),
        lambda: Lens(PLATE, PLATE, thickness=LONG, index=1.5),
        lambda: mount_of({"flange": {"outline": LONG, "thickness": 2.0, "diameter": 30.0}}),
        lambda: lens_from_dict(lens_to_dict(Lens(PLATE, PLATE, 1.0, 1.5)) | {"version": LONG}),
    ],
)
def test_a_value_of_100_000_letters_is_not_echoed_in_full(refuse):
    with pytest.raises(ValueError) as refused:  # noqa: PT011 - what it says differs
        refuse()
    assert len(str(refused.value)) < 400
    assert "A" * 20 in str(refused.value)
