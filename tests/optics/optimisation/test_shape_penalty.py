"""The shape's share of the loss: means by the kernel's derivatives, gradients, and designs that keep to their
limits."""

from __future__ import annotations

import numpy as np
import pytest

from optics.optimisation.shape_penalty import ShapePenalty, ShapeWeights
from tests.optics.cases import coefficients, rough, small_space
from tests.optics.optimisation.cases import run
from thbcad.certified import least_radii
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

ROOM = 1.02  # limits are kept with two percent to spare
HESSIAN = {(2, 0): 1, (1, 1): 2, (0, 2): 1}


CONICS = Conic(-60.0, 0.3), Conic(40.0, -1.0)


def lens_with(front=None, rear=None, front_half=(9.0, 6.0), rear_half=(12.0, 7.0), conics=CONICS):
    """Return a lens of 3 mm whose sags are functions of a space that give coefficients; None is no sag."""
    surfaces = []
    for half, conic, sag, refined in zip((front_half, rear_half), conics, (front, rear), (False, True)):
        space = small_space(half, refined=refined)
        surfaces.append(FreeformSurface(half, conic, None if sag is None else THBSurface(space, sag(space))))
    return Lens(*surfaces, 3.0, 1.5)


def rough_by(height, seed=5):
    return lambda space: rough(space, height, seed)


BOTH = lens_with(rough_by(0.4), rough_by(0.3, 6))


def nodes(breaks, count):
    """Return Gauss points of every span, and weights of the mean."""
    s, w = np.polynomial.legendre.leggauss(count)
    half = np.diff(breaks)[:, None] / 2
    return (breaks[:-1, None] + half * (1 + s)).ravel(), (half * w).ravel() / np.ptp(breaks)


def mean(function, breaks, count):
    """Return the mean of f(x, y) over a rectangle by `count` Gauss points per span and direction."""
    (x, wx), (y, wy) = (nodes(b, count) for b in breaks)
    return wx @ function(x, y) @ wy


def breaks_of(surface):
    e = surface.sag.space.embedding
    return e.kv_u.breaks, e.kv_v.breaks


def bent(surface):
    """Return |D^2 z|^2 as a function of a grid, by the kernel."""
    return lambda x, y: sum(n * surface.grid(x, y, d) ** 2 for d, n in HESSIAN.items())


def roughness(lens, count):
    total = 0.0
    for surface in (lens.front, lens.rear):
        if surface.sag is not None:
            alone = FreeformSurface(surface.half_width, Conic(), surface.sag)
            total += max(surface.half_width) ** 2 * mean(bent(alone), breaks_of(surface), count)
    return total


def curvature(lens, radius, count):
    return sum(
        mean(
            lambda x, y, s=s: np.maximum(0, ROOM * radius * np.sqrt(bent(s)(x, y)) - 1) ** 2,
            breaks_of(s),
            count,
        )
        for s in (lens.front, lens.rear)
        if s.sag is not None
    )


def thickness(lens, least, count):
    """Front and rear are compared at equal shares of their half-widths, at points of the finest sag."""
    finest = lens.front if lens.rear.sag is None else lens.rear

    def violation(x, y):
        s, t = x / finest.half_width[0], y / finest.half_width[1]
        front, rear = (f.grid(s * f.half_width[0], t * f.half_width[1]) for f in (lens.front, lens.rear))
        return np.maximum(0, 1 - (lens.thickness + rear - front) / (ROOM * least)) ** 2

    return mean(violation, breaks_of(finest), count)


def every_term(lens, count):
    return 0.7 * roughness(lens, count) + 3 * (curvature(lens, 15.0, count) + thickness(lens, 3.5, count))


TERMS = {
    "roughness": (ShapeWeights(roughness=0.7), lambda lens, n: 0.7 * roughness(lens, n)),
    "curvature": (ShapeWeights(limits=3.0, radius=30.0), lambda lens, n: 3 * curvature(lens, 30.0, n)),
    "curvature, few": (ShapeWeights(limits=3.0, radius=8.0), lambda lens, n: 3 * curvature(lens, 8.0, n)),
    "thickness": (ShapeWeights(limits=2.0, thickness=3.5), lambda lens, n: 2 * thickness(lens, 3.5, n)),
    "all": (ShapeWeights(0.7, 3.0, 15.0, 3.5), every_term),
}
EACH = pytest.mark.parametrize(("weights", "by_kernel"), TERMS.values(), ids=TERMS.keys())
LENSES = {"both": BOTH, "rear": lens_with(None, rough_by(0.3)), "front": lens_with(rough_by(0.4))}


def finer(lens, times):
    """Return the same lens on meshes whose every cell is cut `times` times."""
    sags = list(lens.sags)
    for _ in range(times):
        sags = [
            s.refine(
                {int(n): s.space.cells[s.space.cells[:, 0] == n, 1:] for n in np.unique(s.space.cells[:, 0])}
            )
            for s in sags
        ]
    return lens.with_sags(sags)


@EACH
@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
def test_the_value_is_the_mean_over_the_rectangle(lens, weights, by_kernel):
    """Against the kernel's own derivatives at six Gauss points per span, on cells cut twice: smooth terms err
    by 4^-4 of the coarse ones' error, those with kinks by 4^-2 or so.
    """
    fine = finer(lens, 2)
    loss, gradients = ShapePenalty(fine, weights)(coefficients(fine))
    dense = by_kernel(fine, 6)
    assert dense > 1e-3
    assert loss == pytest.approx(dense, rel=0.02)
    assert [g.shape for g in gradients] == [c.shape for c in coefficients(fine)]


@pytest.mark.parametrize("term", ["roughness", "curvature"])
def test_the_means_converge_with_the_fourth_power_of_the_spans(term):
    """Against eight Gauss points per span; the curvature is violated everywhere, so that no kink lowers the
    order.

    Halving spans divides the error by 16; 8 and 12 leave room for the terms of higher order.
    """
    lens = lens_with(rough_by(0.002), rough_by(0.001, 6), conics=(Conic(-30.0, -1.0), Conic(30.0, -1.0)))
    weights = ShapeWeights(roughness=1.0) if term == "roughness" else ShapeWeights(limits=1.0, radius=120.0)
    dense = roughness(lens, 8) if term == "roughness" else curvature(lens, 120.0, 8)
    errors = []
    for times in range(3):
        fine = finer(lens, times)
        errors.append(abs(ShapePenalty(fine, weights)(coefficients(fine))[0] - dense))
    assert errors[0] < 0.2 * dense
    assert errors[1] < errors[0] / 8
    assert errors[2] < errors[1] / 12


def test_the_roughness_of_a_quadratic_sag_is_known_exactly():
    """s = a x^2 + b x y + c y^2 on a rectangle of half-width 12 mm: 144 (4 a^2 + 2 b^2 + 4 c^2), whatever the
    conic."""
    a, b, c = 0.01, -0.004, 0.002
    space = small_space((12.0, 7.0))
    x, y = (g.ravel() for g in np.meshgrid(np.linspace(-12, 12, 60), np.linspace(-7, 7, 60)))
    sag = np.linalg.lstsq(space.collocation(x, y).toarray(), a * x * x + b * x * y + c * y * y, rcond=None)[0]
    lens = lens_with(None, lambda _: sag)
    loss, _ = ShapePenalty(lens, ShapeWeights(roughness=2.0))([sag])
    assert loss == pytest.approx(2 * 144 * (4 * a * a + 2 * b * b + 4 * c * c), rel=1e-9)


@EACH
@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
def test_the_gradient_is_that_of_the_value(lens, weights, by_kernel):
    """Central differences: the loss is C^1, its second derivative jumps at points that cross a limit within h
    = 1e-6 mm only, where the first one is of the size of h; that is 1e-5 of the gradient's usual size,
    rounding is less.
    """
    penalty, at = ShapePenalty(lens, weights), coefficients(lens)
    _, gradients = penalty(at)
    rng = np.random.default_rng(3)
    whole = np.concatenate(gradients)
    for _ in range(10):
        d = [rng.standard_normal(len(c)) for c in at]
        ahead, behind = (penalty([c + s * e for c, e in zip(at, d)])[0] for s in (1e-6, -1e-6))
        usual = np.linalg.norm(whole) * np.linalg.norm(np.concatenate(d)) / np.sqrt(len(whole))
        assert (ahead - behind) / 2e-6 == pytest.approx(whole @ np.concatenate(d), abs=1e-5 * usual)


def test_every_sag_has_a_gradient_of_its_own():
    """Each term pulls both sags, the thickness in opposite directions: a higher front or a lower rear makes
    the lens thinner."""
    for weights, _ in TERMS.values():
        for g in ShapePenalty(BOTH, weights)(coefficients(BOTH))[1]:
            assert np.linalg.norm(g) > 1e-4
    front, rear = ShapePenalty(BOTH, ShapeWeights(limits=1.0, thickness=3.5))(coefficients(BOTH))[1]
    assert front.sum() > 0 > rear.sum()
    assert front.sum() == pytest.approx(
        -rear.sum(), rel=1e-9
    )  # both sums are the derivative by the thickness


def test_limits_that_are_kept_cost_nothing():
    """The least radius of the kernel is that of the curvature, at least 1 / |D^2 z|; the gap is at least the
    certified one."""
    most = max(
        np.sqrt(bent(s)(*(np.linspace(-h, h, 301) for h in s.half_width))).max()
        for s in (BOTH.front, BOTH.rear)
    )
    kept = ShapeWeights(0.0, 100.0, 0.98 / most / ROOM, 0.999 * BOTH.least_thickness().lower / ROOM)
    loss, gradients = ShapePenalty(BOTH, kept)(coefficients(BOTH))
    assert loss == 0.0
    assert all(not g.any() for g in gradients)


@pytest.mark.parametrize("surface", ["front", "rear"])
def test_a_curvature_beyond_the_limit_is_charged_wherever_it_is(surface):
    """Second derivatives of cubics are greatest at knots, of these rough sags at the rim; there the radius is
    a fifth below the limit."""
    lens = LENSES[surface]
    bends = bent(getattr(lens, surface))(*breaks_of(getattr(lens, surface)))
    limits = ShapeWeights(0.0, 100.0, 1.25 / np.sqrt(bends.max()))
    assert ShapePenalty(lens, limits)(coefficients(lens))[0] > 0


@pytest.mark.parametrize(
    ("weights", "any_"),
    [
        (ShapeWeights(), False),
        (ShapeWeights(limits=100.0), False),
        (ShapeWeights(radius=5.0, thickness=1.0), False),
        (ShapeWeights(roughness=1e-9), True),
        (ShapeWeights(limits=1.0, radius=5.0), True),
        (ShapeWeights(limits=1.0, thickness=5.0), True),
    ],
)
def test_nothing_to_charge(weights, any_):
    assert weights.any is any_
    loss, gradients = ShapePenalty(BOTH, weights)(coefficients(BOTH))
    assert bool(loss) is any_
    assert any(g.any() for g in gradients) is any_


def test_a_flat_surface_has_no_curvature_to_pull():
    """Where D^2 z = 0 the norm has no derivative; the violation is zero there and so is the gradient."""
    kv = KnotVector.uniform(3, 2, -5.0, 5.0)
    space = THBSpace(kv, kv)
    flat = FreeformSurface((5.0, 5.0), Conic(), THBSurface(space, np.zeros(space.dim)))
    loss, (gradient,) = ShapePenalty(
        Lens(FreeformSurface((5.0, 5.0)), flat, 2.0, 1.5), ShapeWeights(0.0, 1.0, 7.0)
    )([np.zeros(space.dim)])
    assert loss == 0.0
    assert np.array_equal(gradient, np.zeros(space.dim))


# Designs

CRAMPED = {
    "lens.thickness": 4.0,
    "lens.rear.radius": np.inf,
    "lens.rear.conic": 0.0,
    "target.half_width": [14.0, 14.0],
    "optimizer.start": "flat",
}
FREE_FRONT = {
    "lens.front.freeform.spans": [4, 4],
    "lens.front.freeform.max_level": 1,
    "lens.front.freeform.z_freedom": 1.0,
}

RADIUS = 10.0  # mm


def designed(folder, backend, limits):
    folder.mkdir()
    return run(folder, backend, CRAMPED | FREE_FRONT | {"optimizer.iterations": [15]} | limits).lens


@pytest.fixture(scope="module")
def unlimited(tmp_path_factory, backend):
    return designed(tmp_path_factory.mktemp("shape") / "free", backend, {})


def test_a_design_keeps_to_the_least_radius(unlimited, tmp_path, backend):
    def violations(lens, least):
        found = [least_radii(s.graph()) for s in (lens.front, lens.rear)]
        return [
            bound
            for f in found
            for side in (f.concave, f.convex)
            for bound in (side.lower, side.upper)
            if bound < least
        ]

    assert violations(unlimited, RADIUS)
    assert not violations(designed(tmp_path / "kept", backend, {"limits.radius": RADIUS}), RADIUS)


def test_a_design_keeps_to_the_least_thickness(unlimited, tmp_path, backend):
    least = unlimited.least_thickness().upper + 0.3
    assert least < 4.0
    assert designed(tmp_path / "kept", backend, {"limits.thickness": least}).least_thickness().lower >= least
