"""Best fits find a known motion again, and say which motions a surface does not show."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.base.runtime import UserError
from optics.tolerancing.metrology import best_fit, by_datums, made_surface
from optics.tolerancing.metrology.alignment import outliers, without_outliers
from tests.cases import examples
from tests.optics.tolerancing.metrology.cases import HALF_WIDTH, freeform, ripple, scattered
from thbcad import Pose
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

SMALL = st.floats(-0.3, 0.3)


def freeform_of(height: float, half_width: float = 50.0) -> THBSurface:
    """Return a sag of waves, mm, without symmetry."""
    kv = KnotVector.uniform(3, 4, -half_width, half_width)
    space = THBSpace(kv, kv)
    return THBSurface(space, height * np.sin(1.7 * np.arange(space.dim)))


def points_of(surface: FreeformSurface, inside: float = 0.9, count: int = 3000) -> np.ndarray:
    x, y = scattered(count, inside)
    return np.stack([x, y, surface(x, y)])


@examples(8)
@given(st.tuples(SMALL, SMALL, SMALL), st.tuples(*[st.floats(-0.02, 0.02)] * 3))
def test_a_known_motion_is_found_again(shift: tuple[float, ...], tilt: tuple[float, ...]) -> None:
    motion = Pose.at(np.array(shift), np.array(tilt))
    found = best_fit(freeform(), motion.points(points_of(freeform())))
    assert np.abs(found.motion.shift - motion.shift).max() < 1e-9
    assert np.abs(found.motion.rotation_vector - motion.rotation_vector).max() < 1e-9
    assert found.rms < 1e-9
    assert not found.undetermined


@pytest.mark.parametrize(
    ("conic", "hidden"),
    [
        (Conic(), {"shift in x", "shift in y", "rotation about z"}),
        (Conic(40.0, -1.0), {"rotation about z"}),
        (Conic(40.0), {"shift in x", "shift in y", "tilt about x", "tilt about y", "rotation about z"}),
    ],
)
def test_motions_along_a_symmetric_surface_are_named(conic: Conic, hidden: set[str]) -> None:
    surface = FreeformSurface((10.0, 8.0), conic)
    found = best_fit(surface, points_of(surface) + np.array([[0.0], [0.0], [0.05]]))
    assert set(found.undetermined) == hidden
    assert found.rms < 1e-12


def test_the_best_fit_hides_a_tilt_that_datums_show() -> None:
    surface = freeform()
    x, y, z = points_of(surface)
    tilted = Pose.at(np.zeros(3), np.array([1e-3, 0, 0])).points(np.stack([x, y, z + ripple(x, y)]))
    datums, fitted = by_datums(surface, tilted), best_fit(surface, tilted)
    own = float(np.std(ripple(x, y)))
    assert datums.rms > 10 * own
    assert fitted.rms < 1.01 * own
    assert abs(fitted.motion.rotation_vector[0] - 1e-3) < 1e-5


@pytest.mark.parametrize("away", [1e-5, 1e-3, 9e-3])
def test_points_on_the_rim_belong_to_the_best_fit(away: float) -> None:
    """A grid from rim to rim, of a part that lies a little aside: no row is lost, and the motion is found."""
    surface = freeform()
    x, y = (g.ravel() for g in np.meshgrid(*(np.linspace(-h, h, 60) for h in surface.half_width)))
    motion = Pose.at(np.array([away, -away / 3, 3e-4]), np.array([2e-6, 1e-6, -3e-6]))
    found = best_fit(surface, motion.points(np.stack([x, y, surface(x, y)])))
    assert found.points.shape[1] == x.size
    assert np.abs(found.motion.shift - motion.shift).max() < 1e-9
    assert np.abs(found.motion.rotation_vector - motion.rotation_vector).max() < 1e-10
    assert (np.abs(found.points[:2]) <= np.reshape(surface.half_width, (2, 1))).all()


def test_a_patch_of_outliers_is_named_with_its_place() -> None:
    surface = freeform()
    x, y, z = points_of(surface)
    patch = (np.abs(x - 4) < 1) & (np.abs(y + 3) < 1)
    assert outliers(surface, by_datums(surface, np.stack([x, y, z + ripple(x, y)]))) is None
    assert outliers(surface, by_datums(surface, np.stack([x, y, 1.0001 * z]))) is None
    said = outliers(
        surface, by_datums(surface, np.stack([x, y, z + ripple(x, y) + np.where(patch, 0.5, 0.0)]))
    )
    assert said is not None
    assert said.startswith(f"{patch.sum()} of 3,000 points lie up to 500 um from where the others do, round")
    assert "x = 3.9" in said or "x = 4" in said


@pytest.mark.parametrize("moved", [False, True])
def test_a_few_outliers_are_left_out_of_what_was_made(moved: bool) -> None:
    """9 points of 14,641: with them the fit took 57 s and told the light to 20 %; the noise is 1 nm."""
    surface = freeform()
    x, y = (g.ravel() for g in np.meshgrid(*(0.99 * h * np.linspace(-1, 1, 121) for h in HALF_WIDTH)))
    patch = (np.abs(x - 4) < 0.25) & (np.abs(y + 3) < 0.2)
    assert patch.sum() == 9
    z = surface(x, y) + 1e-6 * np.random.default_rng(1).standard_normal(x.size)
    motion = Pose.at((0.02, 0.01, 0.05), (0.001, 0.0, 0.0)) if moved else Pose.at()
    points = motion.points(np.stack([x, y, z + 0.05 * patch]))
    kept, said = without_outliers(surface, points)
    np.testing.assert_array_equal(kept, points[:, ~patch])
    assert said.startswith("9 of 14,641 points lie up to ")
    assert said.endswith("; the light is that of the others")
    fit = made_surface(surface, best_fit(surface, kept)).fit
    assert fit.noise == pytest.approx(1e-6, rel=0.05)


def test_a_pit_is_an_error_of_form_and_stays_while_dust_next_to_it_goes() -> None:
    """A pit 2 um deep and 1.4 mm wide, 1.5 % of the points, on a sphere 10 mm wide; the noise is 10 nm."""
    surface, rng = FreeformSurface((5.0, 5.0), Conic(30.0)), np.random.default_rng(1)
    x, y = rng.uniform(-4.9, 4.9, (2, 5000))
    pit, dust = np.hypot(x - 1, y - 1) < 0.7, np.arange(5000) % 1700 == 3
    assert (pit.sum() > 60, dust.sum(), (pit & dust).sum()) == (True, 3, 0)
    z = surface(x, y) + 1e-5 * rng.standard_normal(5000) - 2e-3 * pit
    points = np.stack([x, y, z])
    kept, said = without_outliers(surface, points)
    assert (kept is points, said) == (True, "")
    points[2] += 0.01 * dust
    kept, said = without_outliers(surface, points)
    np.testing.assert_array_equal(kept, points[:, ~dust])
    assert said.startswith("3 of 5,000 points lie up to 9.99 um")


def test_a_part_of_the_surface_that_lies_elsewhere_is_not_left_out() -> None:
    surface = freeform()
    x, y, z = points_of(surface)
    points = np.stack([x, y, z + np.where(x > 6, 0.5, 0.0)])
    kept, said = without_outliers(surface, points)
    assert (kept is points, said) == (True, "")


@pytest.mark.slow
@examples(8)
@given(st.floats(0.96, 1.04), st.sampled_from([-1.0, 0.0, 0.5]), st.sampled_from([0, 1]))
def test_a_best_fit_brings_points_nearer_however_weak_a_motion_is(
    power: float, cut: float, axis: int
) -> None:
    """Half of a lens of other power, on a surface that hardly shows most motions."""
    surface = FreeformSurface((50.0, 50.0), Conic(150.0, -1.0), freeform_of(0.002))
    x, y = np.random.default_rng(0).uniform(-49, 49, (2, 2000))
    x, y = (a[(x, y)[axis] > 50 * cut] for a in (x, y))
    z = surface(x, y) + Conic(150 / power, -1.0)(x, y) - surface.conic(x, y)
    points = np.stack([x, y, z])
    assert best_fit(surface, points).rms <= by_datums(surface, points).rms + 1e-12


def test_points_that_leave_the_surface_are_refused() -> None:
    with pytest.raises(UserError, match="beside the surface"):
        best_fit(freeform(), points_of(freeform()) + np.array([[30.0], [0.0], [0.0]]))


def test_points_outside_the_outline_lie_beside_the_surface():
    """A square grid over an ellipse: what stands in the corners changes nothing, and all of the ellipse is
    covered."""
    surface = replace(freeform(), corners=HALF_WIDTH)
    x, y = (a.ravel() for a in np.meshgrid(*(h * np.linspace(-1, 1, 80) for h in HALF_WIDTH)))
    inside = surface.outline.contains(x, y)
    points = np.stack([x, y, surface(x, y) + np.where(inside, ripple(x, y), 5.0)])
    aligned = by_datums(surface, points)
    assert np.array_equal(aligned.points[:2], points[:2, inside])
    assert np.abs(aligned.heights).max() < 3e-4
    assert made_surface(surface, aligned).covered == 1


def test_dust_on_a_part_beside_its_datums_is_found_after_the_fit() -> None:
    """Where it lies, its slopes make heights that hide the speck."""
    surface = freeform()
    x, y, z = points_of(surface)
    points = Pose.at((0.3, -0.2, 0.1), np.radians((0.2, -0.3, 0.5))).points(np.stack([x, y, z]))
    points[2, 1234] += 0.5
    assert outliers(surface, by_datums(surface, points)) is None
    said = outliers(surface, best_fit(surface, points))
    assert said is not None
    assert said.startswith("1 of 3,000 points")
