"""The shape's share of the loss: means by the kernel's derivatives, gradients of every penalty, and limits as
the certified bounds see them."""

from dataclasses import fields
from functools import cache

import numpy as np
import pytest

from optics.designing.penalties import ROOM, Part, shape_penalty
from optics.scene.problem import Limits
from tests.cases import slow_unless
from tests.optics.cases import coefficients, rough, small_space
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens, manufacturability, mass
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

DENSITY = 1.19
WEIGHT = 100.0  # of the mean square of relative excesses
HESSIAN = {(2, 0): 1, (1, 1): 2, (0, 2): 1}
CONICS = Conic(-60.0, 0.3), Conic(40.0, -1.0)


def lens_with(front=None, rear=None, front_half=(9.0, 6.0), rear_half=(12.0, 7.0), conics=CONICS, share=0.0):
    """Return a lens of 3 mm whose sags are functions of a space that give coefficients; None is no sag.

    share : of the half-widths, of the corners of its outline.
    """
    surfaces = []
    for half, conic, sag, refined in zip((front_half, rear_half), conics, (front, rear), (False, True)):
        space = small_space(half, refined=refined)
        sag = None if sag is None else THBSurface(space, sag(space))
        surfaces.append(FreeformSurface(half, conic, sag, (share * half[0], share * half[1])))
    return Lens(*surfaces, 3.0, 1.5)


def rough_by(height, seed=5):
    return lambda space: rough(space, height, seed)


BOTH = lens_with(rough_by(0.4), rough_by(0.3, 6))
LENSES = {"both": BOTH, "rear": lens_with(None, rough_by(0.3)), "front": lens_with(rough_by(0.4))}
EACH_LENS = pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
TIGHT = {
    "thickness": 3.5,
    "centre_thickness": 3.5,
    "edge_thickness": 5.5,
    "greatest_thickness": 3.2,
    "envelope": (0.05, 3.2),
    "radius": 15.0,
    "concave_radius": 25.0,
    "slope": 4.0,
    "sag_range": 1.0,
    "mass": 1.0,
}
LIMITS = pytest.mark.parametrize("key", TIGHT)


def penalty_of(lens, fine=False, roughness=0.0, **limits):
    return shape_penalty([Part(lens, Limits(**limits), DENSITY)], roughness, fine)


def test_every_limit_is_charged_but_that_of_the_mesh():
    assert set(TIGHT) | {"feature"} == {field.name for field in fields(Limits)}
    assert shape_penalty([Part(BOTH, Limits(feature=500.0))]) is None
    assert shape_penalty([Part(BOTH, Limits())]) is None


# Values


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
    for surface in lens.free_surfaces:
        alone = FreeformSurface(surface.half_width, Conic(), surface.sag)
        total += max(surface.half_width) ** 2 * mean(bent(alone), breaks_of(surface), count)
    return total


def principal_curvatures(surface, x, y):
    """Return both, (2, m, n): H +- sqrt(H^2 - K) of do Carmo, section 3-3."""
    p, q, r, s, t = (surface.grid(x, y, d) for d in ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2)))
    w2 = 1 + p * p + q * q
    h = ((1 + q * q) * r - 2 * p * q * s + (1 + p * p) * t) / (2 * w2**1.5)
    root = np.sqrt(np.maximum(h * h - (r * t - s * s) / w2**2, 0))
    return np.stack([h + root, h - root])


def curvature(lens, radius, count):
    def excess(surface):
        return lambda x, y: sum(
            np.maximum(0, ROOM + sign * radius * principal_curvatures(surface, x, y) - 1) ** 2
            for sign in (1, -1)
        ).sum(axis=0)

    return WEIGHT * sum(mean(excess(s), breaks_of(s), count) for s in lens.free_surfaces)


def thickness(lens, least, count):
    """Front and rear are compared at equal shares of their half-widths, at points of the finest sag."""
    finest = lens.front if lens.rear.sag is None else lens.rear

    def violation(x, y):
        s, t = x / finest.half_width[0], y / finest.half_width[1]
        front, rear = (f.grid(s * f.half_width[0], t * f.half_width[1]) for f in (lens.front, lens.rear))
        return np.maximum(0, ROOM + 1 - (lens.thickness + rear - front) / least) ** 2

    return WEIGHT * mean(violation, breaks_of(finest), count)


def slope(lens, degrees, count):
    def violation(surface):
        def squared(x, y):
            steep = np.hypot(surface.grid(x, y, (1, 0)), surface.grid(x, y, (0, 1)))
            return np.maximum(0, ROOM - 1 + steep / np.tan(np.radians(degrees))) ** 2

        return squared

    return WEIGHT * sum(mean(violation(s), breaks_of(s), count) for s in lens.free_surfaces)


TERMS = {
    "roughness": ({"roughness": 0.7}, lambda lens, n: 0.7 * roughness(lens, n)),
    "radius": ({"radius": 30.0}, lambda lens, n: curvature(lens, 30.0, n)),
    "radius at few points": ({"radius": 8.0}, lambda lens, n: curvature(lens, 8.0, n)),
    "thickness": ({"thickness": 3.5}, lambda lens, n: thickness(lens, 3.5, n)),
    "slope": ({"slope": 4.0}, lambda lens, n: slope(lens, 4.0, n)),
}


def finer(lens, times):
    """Return the same lens on meshes whose every cell is cut `times` times."""
    sags = list(lens.sags)
    for _ in range(times):
        sags = [sag.refine(np.ones(len(sag.space.cells), dtype=bool)) for sag in sags]
    return lens.with_sags(sags)


@pytest.mark.parametrize(("options", "by_kernel"), TERMS.values(), ids=TERMS.keys())
@EACH_LENS
def test_the_value_is_the_mean_over_the_rectangle(lens, options, by_kernel):
    """Against the kernel's own derivatives at six Gauss points per span, on cells cut twice: smooth terms err
    by 4^-4 of the coarse ones' error, those with kinks by 4^-2 or so.
    """
    fine = finer(lens, 2)
    loss, gradients = penalty_of(fine, **options)(coefficients(fine))
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
    options = {"roughness": 1.0} if term == "roughness" else {"radius": 120.0}
    dense = roughness(lens, 8) if term == "roughness" else curvature(lens, 120.0, 8)
    errors = []
    for times in range(3):
        cut = finer(lens, times)
        errors.append(abs(penalty_of(cut, **options)(coefficients(cut))[0] - dense))
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
    loss, _ = penalty_of(lens, roughness=2.0)([sag])
    assert loss == pytest.approx(2 * 144 * (4 * a * a + 2 * b * b + 4 * c * c), rel=1e-9)


@cache
def certified(lens):
    return manufacturability(lens, DENSITY)


def limit_at(key, lens, factor):
    """Return the limit by which the certified bounds miss by a factor of the strictest free quantity."""
    found = certified(lens)
    surfaces = [m for m, s in zip((found.front, found.rear), (lens.front, lens.rear)) if s.sag is not None]
    if key == "envelope":
        low, high = found.front.heights.least.value, lens.thickness + found.rear.heights.greatest.value
        ends = low + (factor - 1) * lens.thickness, high - (factor - 1) * lens.thickness
        return (
            -np.inf if lens.front.sag is None else ends[0],
            np.inf if lens.rear.sag is None else ends[1],
        )
    if key in ("radius", "concave_radius"):
        sides = [s.concave.value for s in surfaces]
        sides += [s.convex.value for s in surfaces] if key == "radius" else []
        return factor * min(sides)
    if key == "slope":
        steepest = max(np.tan(np.radians(s.slope.value)) for s in surfaces)
        return float(np.degrees(np.arctan(steepest / factor)))
    if key == "sag_range":
        return max(s.heights.value for s in surfaces) / factor
    if key == "mass":
        return found.mass / factor
    value = getattr(found, key).value
    return value / factor if key == "greatest_thickness" else value * factor


SMOOTHER = {
    "both": lens_with(rough_by(0.04), rough_by(0.02, 6)),
    "rear": lens_with(None, rough_by(0.02)),
    "front": lens_with(rough_by(0.04)),
    "ellipse": lens_with(rough_by(0.04), rough_by(0.02, 6), share=1.0),
    "rounded": lens_with(rough_by(0.04), rough_by(0.02, 6), share=0.4),
}


@pytest.mark.every(9)
@LIMITS
@pytest.mark.parametrize("name", slow_unless(lambda name: name != "ellipse", SMOOTHER))
def test_a_limit_is_exceeded_where_the_certified_bounds_say_so(name, key):
    """Curvatures of these sags change by some percent between points, heights by some thousandths, but by
    some percent between the last points and the rim of an outline."""
    lens, bent = SMOOTHER[name], key in ("radius", "concave_radius", "slope")
    room = 0.1 if bent or not lens.rear.outline.is_rectangle else 0.01
    for fine in (False, True):
        for factor, exceeded in ((1 - room, False), (1 + room, True)):
            found = penalty_of(lens, fine, **{key: limit_at(key, lens, factor)})
            assert found.exceeded(coefficients(lens)) is exceeded


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_a_mass_is_exceeded_by_what_the_volume_says(share):
    """The volume is linear in the coefficients; its solid has ruled edges that lean, and Gauss's rule is
    exact for it."""
    lens = lens_with(rough_by(0.4), rough_by(0.3, 6), share=share)
    changed = lens.with_sags([THBSurface(s.space, rough(s.space, 0.2, 9)) for s in lens.sags])
    loss, _ = penalty_of(lens, mass=mass(changed.volume(), DENSITY) / 1.5)(coefficients(changed))
    assert loss == pytest.approx(WEIGHT * (0.5 + ROOM) ** 2, rel=1e-10)


def test_penalties_on_some_limits_alone_are_part_of_all():
    at = coefficients(BOTH)
    every, few = penalty_of(BOTH, **TIGHT), ("radius", "mass")
    rest = [key for key in TIGHT if key not in few]
    assert set(every.keys) == set(TIGHT)
    assert set(every.only(few).keys) == set(few)
    assert every.only(few)(at)[0] + every.only(rest)(at)[0] == pytest.approx(every(at)[0], rel=1e-12)
    assert every.only(())(at)[0] == 0


# Gradients


@LIMITS
@EACH_LENS
def test_the_gradient_is_that_of_the_value(lens, key):
    """Central differences: the loss is C^1, its second derivative jumps at points that cross a limit within h
    = 1e-6 mm only, where the first one is of the size of h; that is 1e-5 of the gradient's usual size,
    rounding is less.
    """
    check_gradient(penalty_of(lens, roughness=0.3, **{key: TIGHT[key]}), coefficients(lens))


def check_gradient(penalty, at):
    _, gradients = penalty(at)
    rng = np.random.default_rng(3)
    whole = np.concatenate(gradients)
    assert whole.any()
    for _ in range(4):
        d = [rng.standard_normal(len(c)) for c in at]
        ahead, behind = (penalty([c + s * e for c, e in zip(at, d)])[0] for s in (1e-6, -1e-6))
        usual = np.linalg.norm(whole) * np.linalg.norm(np.concatenate(d)) / np.sqrt(len(whole))
        assert (ahead - behind) / 2e-6 == pytest.approx(whole @ np.concatenate(d), abs=1e-5 * usual)


def test_the_gradient_holds_with_every_limit_and_with_multipliers():
    at = coefficients(BOTH)
    penalty = penalty_of(BOTH, roughness=0.3, **TIGHT)
    check_gradient(penalty, at)
    check_gradient(penalty.tightened(at), at)


@pytest.mark.parametrize("share", [0.4, 1.0])
def test_the_gradient_holds_over_an_outline(share):
    lens = lens_with(rough_by(0.4), rough_by(0.3, 6), share=share)
    check_gradient(penalty_of(lens, roughness=0.3, **TIGHT), coefficients(lens))


def test_equal_curvatures_have_a_gradient():
    """A paraboloid bends alike in all directions at its vertex, where eigenvectors jump but the charge does
    not; the vertex is a knot."""
    lens = lens_with(None, lambda space: np.zeros(space.dim))
    check_gradient(penalty_of(lens, radius=60.0), [np.zeros(lens.sags[0].space.dim)])


def test_a_flat_surface_has_no_curvature_and_no_slope_to_pull():
    """Where both are 0 they have no derivative; the excess is -1 there and the gradient 0."""
    kv = KnotVector.uniform(3, 2, -5.0, 5.0)
    space = THBSpace(kv, kv)
    flat = FreeformSurface((5.0, 5.0), Conic(), THBSurface(space, np.zeros(space.dim)))
    lens = Lens(FreeformSurface((5.0, 5.0)), flat, 2.0, 1.5)
    loss, (gradient,) = penalty_of(lens, radius=7.0, slope=5.0)([np.zeros(space.dim)])
    assert loss == 0.0
    assert np.array_equal(gradient, np.zeros(space.dim))


def test_every_sag_has_a_gradient_of_its_own():
    """A higher front or a lower rear makes the lens thinner."""
    front, rear = penalty_of(BOTH, thickness=3.5)(coefficients(BOTH))[1]
    assert front.sum() > 0 > rear.sum()
    # both sums are the derivative by the thickness
    assert front.sum() == pytest.approx(-rear.sum(), rel=1e-9)


# Room and multipliers


@LIMITS
def test_a_limit_that_is_kept_costs_nothing(key):
    loss, gradients = penalty_of(BOTH, **{key: limit_at(key, BOTH, 0.9)})(coefficients(BOTH))
    assert loss == 0.0
    assert all(not g.any() for g in gradients)


def test_room_is_charged_from_before_the_limit_and_half_of_it_is_enough():
    limit = certified(BOTH).centre_thickness.value / 0.97  # exceeded by 3 %
    penalty, at = penalty_of(BOTH, centre_thickness=limit), coefficients(BOTH)
    higher = [at[0], at[1] + 0.032 * limit]  # 0.2 % within
    assert penalty.exceeded(at)
    assert not penalty.exceeded(higher)
    assert penalty.cleared(higher)
    assert penalty(higher)[0] == 0
    roomy = penalty.with_rooms({"centre_thickness": 0.005})
    assert roomy(higher)[0] == pytest.approx(WEIGHT * 0.003**2, rel=1e-6)
    assert not roomy.cleared(higher)
    assert penalty.with_rooms({"centre_thickness": 0.0039}).cleared(higher)


def test_multipliers_follow_the_excess_and_keep_the_force():
    """With 10 times the weight and a tenth of the shifted excess as the multiplier, its force w (g + s)
    stays; the excess g over the limit with its room adds 10 w g."""
    limit = certified(BOTH).centre_thickness.value / 0.97
    penalty, at = penalty_of(BOTH, centre_thickness=limit), coefficients(BOTH)
    before, after = (p(at)[0] for p in (penalty, penalty.tightened(at)))
    shifted = 0.03 + ROOM
    assert before == pytest.approx(WEIGHT * shifted**2, rel=1e-6)
    assert after == pytest.approx(10 * WEIGHT * (shifted + shifted / 10) ** 2, rel=1e-6)


def test_the_mass_of_a_body_and_of_a_plate_is_that_of_what_is_made():
    lens = lens_with(rough_by(0.4), rough_by(0.3, 6))
    grams = mass(3 * lens.volume() + 50.0, DENSITY)
    part = Part(lens, Limits(mass=grams / 1.5), DENSITY, (3, 50.0))
    loss, _ = shape_penalty([part])(coefficients(lens))
    assert loss == pytest.approx(WEIGHT * (0.5 + ROOM) ** 2, rel=1e-10)
