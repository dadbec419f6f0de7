"""What was not measured is not known: gaps carry no error, and datums need no best fit."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.base.runtime import UserError
from optics.scene.system import System
from optics.tolerancing.metrology import (
    MeasuredPoints,
    as_built_data,
    as_built_light,
    as_built_lines,
    light_as_built,
)
from optics.tolerancing.metrology.alignment import by_datums
from optics.tolerancing.metrology.corrected_surface import made_surface, measured_light
from tests.cases import examples
from tests.optics.cases import small_system
from tests.optics.tolerancing.metrology.cases import HALF_WIDTH, everywhere, freeform, ripple, scattered
from thbcad.outlines import Outline
from thbcad.sags import Conic


def random_points(count, seed):
    return np.random.default_rng(seed).uniform(-1, 1, (2, count)) * np.reshape(HALF_WIDTH, (2, 1))


@examples(25)
@given(st.integers(100, 20_000), st.integers(0, 1 << 30))
def test_points_at_random_all_over_leave_no_gap(count: int, seed: int) -> None:
    assert measured_light(random_points(count, seed), everywhere(), Outline(HALF_WIDTH)) == 1


@examples(15)
@given(st.integers(100, 5_000), st.integers(0, 1 << 30))
def test_points_at_random_all_over_an_ellipse_leave_no_gap(count: int, seed: int) -> None:
    """Strips at its rim are as small as it is there."""
    ellipse, rays = Outline(HALF_WIDTH, HALF_WIDTH), everywhere()
    points = random_points(2 * count, seed)
    flux = rays.flux * ellipse.contains(rays.x, rays.y)
    assert measured_light(points[:, ellipse.contains(*points)], replace(rays, flux=flux), ellipse) == 1


@examples(25)
@given(st.integers(8, 120), st.integers(8, 120))
def test_points_on_a_grid_all_over_leave_no_gap(columns: int, rows: int) -> None:
    """From rim to rim, or a step inside it, and with other steps in x and y."""
    for inside in (1.0, 1 - 2 / max(columns, rows)):
        line = (inside * h * np.linspace(-1, 1, n) for h, n in zip(HALF_WIDTH, (columns, rows)))
        points = np.stack([g.ravel() for g in np.meshgrid(*line)])
        if 0.3 < columns / rows < 4:
            assert measured_light(points, everywhere(), Outline(HALF_WIDTH)) == 1


@examples(25)
@given(st.floats(0.3, 0.9), st.integers(2000, 20_000), st.integers(0, 1 << 30), st.booleans())
def test_a_part_that_was_not_measured_is_seen(part: float, count: int, seed: int, grid: bool) -> None:
    side = round(count**0.5)
    line = (h * np.linspace(-1, 1, side) for h in HALF_WIDTH)
    points = np.stack([g.ravel() for g in np.meshgrid(*line)]) if grid else random_points(count, seed)
    cut = HALF_WIDTH[0] * (2 * part - 1)
    known = measured_light(points[:, points[0] <= cut], everywhere(), Outline(HALF_WIDTH))
    assert known < 1
    assert known == pytest.approx(part, abs=2.5 / side**0.5)


def test_a_hole_is_seen_wherever_light_crosses_it() -> None:
    points = random_points(10_000, 3)
    hole = np.hypot(points[0] - 4, points[1] + 2) > 1
    lit = everywhere()
    assert 0.985 < measured_light(points[:, hole], lit, Outline(HALF_WIDTH)) < 1
    dark = np.where(np.hypot(lit.x - 4, lit.y + 2) < 1.5, 0.0, 1.0)
    assert measured_light(points[:, hole], replace(lit, flux=dark), Outline(HALF_WIDTH)) == 1


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> System:
    return small_system(tmp_path_factory.mktemp("problem"))


def measured(surface, count=6000, part=1.0, errors=ripple):
    """Return points of a part of a surface from its -x rim on."""
    x, y = np.random.default_rng(2).uniform(-1, 1, (2, count)) * np.reshape(surface.half_width, (2, 1))
    x, y = (a[x <= surface.half_width[0] * (2 * part - 1)] for a in (x, y))
    return MeasuredPoints(np.stack([x, y, surface(x, y) + errors(x, y)]))


@pytest.mark.every(3)
@pytest.mark.parametrize("part", [0.02, 0.5, 0.93])
def test_what_was_not_measured_carries_no_error(system, backend, part: float) -> None:
    points = measured(system.base.rear, 8000, part)
    built = light_as_built(system, points, backend, "rear", correct=False)
    assert built.light_error is None
    lines = as_built_lines(built)
    assert not any("+-" in line for line in lines)
    (line,) = (line for line in lines if "not decided" in line)
    assert f"only {np.floor(1000 * built.known) / 10:g} % of the light" in line
    data = json.loads(json.dumps(as_built_data(built), allow_nan=False))
    assert data["rel_l2"]["decided"] is False
    assert data["rel_l2"]["error"] is None
    assert data["measured_light"] < 1


@pytest.mark.slow
def test_a_surface_that_was_measured_all_over_has_an_error(system, backend) -> None:
    built = light_as_built(system, measured(system.base.rear), backend, "rear", correct=False)
    assert built.known == 1
    assert any("+-" in line for line in as_built_lines(built))


def powered(surface):
    """Return the error of a surface whose base is curved by 2 % more."""
    conic = surface.conic

    def errors(x, y):
        more = Conic(conic.radius / 1.02, conic.constant)
        return more(x, y) - conic(x, y)

    return errors


def test_half_a_lens_of_other_power_is_shown_by_datums_without_its_best_fit(
    system, backend, monkeypatch
) -> None:
    rear = system.base.rear
    points = measured(rear, 6000, 0.5, powered(rear))

    def refused(*_):
        raise UserError("the best fit moves half of the points beside the surface")

    monkeypatch.setattr(as_built_light, "best_fit", refused)
    with pytest.raises(UserError, match="moves half of the points"):
        light_as_built(system, points, backend, "rear", "best fit", correct=False)
    built = light_as_built(system, points, backend, "rear", correct=False)
    x, y = points.points[:2]
    assert np.abs(built.made.correction(x, y) - powered(rear)(x, y)).max() < 1e-5
    assert built.fitted is None
    lines = as_built_lines(built)
    assert any(line.startswith("no best fit: the best fit moves half of the points") for line in lines)
    assert as_built_data(built)["alignments"]["best fit"] is None


@pytest.mark.slow
def test_outliers_have_a_sentence_of_their_own(system, backend, monkeypatch) -> None:
    points = measured(system.base.rear)
    x, y, z = points.points
    patch = (np.abs(x - 4) < 1) & (np.abs(y + 3) < 1)
    spoilt = MeasuredPoints(np.stack([x, y, z + 0.3 * patch]))
    monkeypatch.setattr(as_built_light, "_light_error", lambda *_: None)
    built = light_as_built(system, spoilt, backend, "rear", correct=False)
    (line,) = (line for line in as_built_lines(built) if "from where the others do" in line)
    assert line.startswith(f"{patch.sum()} of 6,000 points lie up to 299 um")


def test_where_noise_swamps_the_light_nothing_is_known_of_it(monkeypatch) -> None:
    """A patch of outliers passes for noise that would bring more than all that was found."""
    designed = freeform()
    x, y = scattered(2000)
    points = by_datums(designed, np.stack([x, y, designed(x, y)]))
    monkeypatch.setattr(as_built_light, "_noise", lambda *_: (0.3663**2, 1e-6))
    made = made_surface(designed, points)
    found = as_built_light._light_error(made, points, 0.1193, lambda surface: 0.12)
    assert (found.rel_l2, found.error) == (0.0, 0.12)


@pytest.mark.slow
def test_the_table_counts_the_points_that_a_fit_leaves_out(system, backend) -> None:
    rear = system.base.rear
    line = (h * np.linspace(-1, 1, 60) for h in rear.half_width)
    x, y = (g.ravel() for g in np.meshgrid(*line))
    points = MeasuredPoints(np.stack([x + 0.2, y, rear(x, y) + ripple(x, y)]), beside=60)
    built = light_as_built(system, points, backend, "rear", correct=False)
    assert built.fitted is not None
    alignments = as_built_data(built)["alignments"]
    assert (alignments["datums"]["beside"], alignments["best fit"]["beside"]) == (60, 0)
