"""Best fits find a known motion again, and say which motions a surface does not show."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from optics.as_built import Motion, best_fit, by_datums
from optics.runtime import UserError
from tests.optics.as_built.cases import freeform, ripple, scattered
from thbcad.lens import FreeformSurface
from thbcad.sags import Conic

SMALL = st.floats(-0.3, 0.3)


def points_of(surface: FreeformSurface, inside: float = 0.9, count: int = 3000) -> np.ndarray:
    x, y = scattered(count, inside)
    return np.stack([x, y, surface(x, y)])


@settings(deadline=None, max_examples=8)
@given(st.tuples(SMALL, SMALL, SMALL), st.tuples(*[st.floats(-0.02, 0.02)] * 3))
def test_a_known_motion_is_found_again(shift: tuple[float, ...], tilt: tuple[float, ...]) -> None:
    motion = Motion(np.array(shift), np.array(tilt))
    found = best_fit(freeform(), motion.done(points_of(freeform())))
    assert np.abs(found.motion.shift - motion.shift).max() < 1e-9
    assert np.abs(found.motion.tilt - motion.tilt).max() < 1e-9
    assert found.rms < 1e-9
    assert not found.undetermined


def test_a_motion_is_undone_by_its_inverse() -> None:
    motion = Motion(np.array([0.1, -0.2, 0.3]), np.array([0.02, 0.01, -0.5]))
    points = points_of(freeform())
    assert np.allclose(motion.undone(motion.done(points)), points, rtol=0, atol=1e-13)
    twice = motion.then(motion).done(points)
    assert np.allclose(twice, motion.done(motion.done(points)), rtol=0, atol=1e-13)


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
    tilted = Motion(np.zeros(3), np.array([1e-3, 0, 0])).done(np.stack([x, y, z + ripple(x, y)]))
    datums, fitted = by_datums(surface, tilted), best_fit(surface, tilted)
    own = float(np.std(ripple(x, y)))
    assert datums.rms > 10 * own
    assert fitted.rms < 1.01 * own
    assert abs(fitted.motion.tilt[0] - 1e-3) < 1e-5


def test_points_that_leave_the_surface_are_refused() -> None:
    with pytest.raises(UserError, match="beside the surface"):
        best_fit(freeform(), points_of(freeform()) + np.array([[30.0], [0.0], [0.0]]))
