"""The made surface is the designed one plus what was measured; its light, and what re-positioning brings."""

from dataclasses import replace

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.light.analysis import measure, rel_l2
from optics.scene.problem import Problem
from optics.scene.system import System
from optics.tolerancing.metrology import (
    FileFrame,
    MeasuredPoints,
    as_built_data,
    as_built_lines,
    by_datums,
    default_side,
    light_as_built,
    made_surface,
    read_measured,
    surface_of,
)
from optics.tolerancing.metrology.as_built_light import with_surface
from optics.tolerancing.metrology.as_built_text import LIKE
from optics.tolerancing.metrology.rigid_corrections import rigid_correction
from optics.tolerancing.perturbations import Perturbation, PerturbedLight
from tests.optics.cases import rough, small_system
from tests.optics.tolerancing.metrology.cases import freeform, ripple, scattered
from thbcad.fitting import quasi_interpolate
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

FINE = 1e-9  # mm, of a measurement that hardly has noise


def measured(
    surface: FreeformSurface, count: int, noise: float = 0.0, seed: int = 2, times: float = 1.0
) -> MeasuredPoints:
    x, y = np.random.default_rng(seed).uniform(-1, 1, (2, count)) * np.reshape(surface.half_width, (2, 1))
    errors = times * ripple(x, y) + noise * np.random.default_rng(seed + 1).standard_normal(count)
    return MeasuredPoints(np.stack([x, y, surface(x, y) + errors]))


@pytest.mark.parametrize("designed", [freeform(), FreeformSurface((10.0, 8.0), Conic(60.0))])
def test_the_made_surface_is_the_designed_one_and_the_error(designed: FreeformSurface) -> None:
    made = made_surface(designed, by_datums(designed, measured(designed, 6000, FINE).points))
    x, y = scattered(500, 0.95, seed=9)
    assert np.abs(made.correction(x, y) - ripple(x, y)).max() < 0.01 * 2e-4
    assert made.covered > 0.5


def test_what_points_do_not_resolve_stands_in_the_residuals() -> None:
    """The same ripple by many points leaves noise, by few points what neighbours agree in."""
    designed = FreeformSurface((10.0, 8.0), Conic(60.0))
    many, few = (
        made_surface(designed, by_datums(designed, measured(designed, count, 1e-6).points))
        for count in (6000, 150)
    )
    assert abs(many.unresolved) < LIKE[0] < LIKE[1] < few.unresolved


@pytest.mark.parametrize("periods", [(3.0, 3.0), (3.0, np.inf)])
def test_a_dense_ripple_that_cells_do_not_hold_is_no_noise(periods: tuple[float, float]) -> None:
    """Four points to a period: neighbours differ, and points two away or aslant are alike again."""
    designed = FreeformSurface((10.0, 8.0), Conic(60.0))
    x, y = (g.ravel() for g in np.meshgrid(np.arange(-10, 10.01, 0.75), np.arange(-7.5, 7.6, 0.75)))
    errors = 8e-4 * np.cos(2 * np.pi * x / periods[0]) * np.cos(2 * np.pi * y / periods[1] + 0.4)
    points = np.stack([x, y, designed(x, y) + errors])
    made = made_surface(
        designed, by_datums(designed, points), smoothing=1e3
    )  # as far from holding it as can be
    assert made.unresolved > LIKE[1]
    noise = np.random.default_rng(1).normal(0, 8e-4, x.size)
    plain = made_surface(designed, by_datums(designed, points - [[0], [0], [1]] * (errors - noise)))
    assert plain.unresolved < LIKE[0]


def test_a_correction_of_nothing_changes_no_bit_of_the_shape() -> None:
    designed = freeform()
    x, y = scattered(2000)
    made = made_surface(designed, by_datums(designed, np.stack([x, y, designed(x, y)])))
    there = scattered(500, seed=8)
    assert np.abs(made.correction(*there)).max() < 1e-15 * 10


def test_noise_is_carried_both_ways() -> None:
    designed = freeform()
    made = made_surface(designed, by_datums(designed, measured(designed, 2000, 1e-5).points))
    x, y = scattered(100, seed=8)
    noise = made.fit.noise * np.random.default_rng(0).standard_normal(2000)
    up, down = (made.with_noise(noise, sign)(x, y) for sign in (1.0, -1.0))
    assert np.allclose((up + down) / 2, made.surface(x, y), rtol=0, atol=1e-14)
    assert 1e-6 < np.std(up - down) / 2 < 1e-5


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> System:
    return small_system(tmp_path_factory.mktemp("problem"))


@pytest.mark.slow  # 20 traces each
@pytest.mark.parametrize("noise", [1e-6, 2e-5])
def test_the_light_of_a_made_lens_is_found_from_noisy_points(system, backend, noise: float) -> None:
    lens = system.base
    (hx, hy) = lens.rear.half_width
    knots = [KnotVector.uniform(3, 160, -h, h) for h in (hx, hy)]
    exact = quasi_interpolate(THBSpace(*knots), lambda x, y: ripple(x, y))
    bare = replace(lens, rear=FreeformSurface((hx, hy), lens.rear.conic, exact))
    true = measure(system.with_lens(bare), backend).metrics["rel_l2"]
    points = measured(lens.rear, 20_000, noise)
    built = light_as_built(system.with_lens(lens), points, backend, "rear", correct=False)
    assert abs(built.light_error.rel_l2 - true) < max(0.02 * true, built.light_error.error)
    assert built.light_error.error < 0.1 * true
    assert built.made.fit.noise == pytest.approx(noise, rel=0.05)
    assert np.linalg.norm(built.change) > 0
    assert set(as_built_data(built)["alignments"]) == {"datums", "best fit"}
    assert any("as made, aligned by datums" in line for line in as_built_lines(built))


@pytest.mark.slow
def test_ripple_that_noise_hides_leaves_the_light_undecided(system, backend) -> None:
    """So much noise lets the fit be smooth, as if the lens were."""
    lens, uniform = system.base, {"min_over_mean": 0.9, "min_over_max": 0.8, "rsd": 0.02}
    same = dict.fromkeys((f"{name}_error" for name in uniform), 0.0)
    found = []
    for noise in (FINE, 0.05):
        points = measured(lens.rear, 4000, noise, times=60)
        built = light_as_built(system.with_lens(lens), points, backend, "rear", correct=False)
        even = built.measurement.metrics | {"uniformity": uniform | same | {"reason": ""}}
        even.pop("contrast_error", None)
        measurement = replace(built.measurement, metrics=even)
        found.append((built, replace(built, measurement=measurement).verdict(system.problem.verify)))
    (clear, made), (hidden, open_) = found
    assert hidden.made.fit.freedom < 0.05 * clear.made.fit.freedom
    assert abs(hidden.light_error.rel_l2 - clear.light_error.rel_l2) < 2 * hidden.light_error.error
    assert {c.result for c in made.checks if "uniformity" in c.name} == {"passed"}
    assert {c.result for c in open_.checks if "uniformity" in c.name} == {"undecided"}


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["heights", "errors"])
def test_points_beside_the_surface_are_left_out_of_the_count(system, backend, tmp_path, kind) -> None:
    rear = system.base.rear
    x, y = 1.25 * np.random.default_rng(3).uniform(-1, 1, (2, 400)) * np.reshape(rear.half_width, (2, 1))
    on = (np.abs(x) <= rear.half_width[0]) & (np.abs(y) <= rear.half_width[1])
    heights = np.where(on, rear(np.where(on, x, 0.0), np.where(on, y, 0.0)), 0.0)
    np.savetxt(tmp_path / "a.xyz", np.column_stack([x, y, heights if kind == "heights" else 0.0 * x]))
    points = read_measured(tmp_path / "a.xyz", rear, FileFrame(kind=kind))
    built = light_as_built(system, points, backend, "rear", correct=False)
    data = as_built_data(built)
    assert (data["points"], data["beside"]) == (on.sum(), (~on).sum())
    assert as_built_lines(built)[0].startswith(f"{on.sum()} points of the rear; ")


def test_other_words_are_refused(system, backend) -> None:
    assert default_side(system.base) == "rear"
    with pytest.raises(UserError, match="surface must be front or rear"):
        surface_of(system.base, "back")
    with pytest.raises(UserError, match="align must be"):
        light_as_built(system, measured(system.base.rear, 500), backend, "rear", way="three points")


def test_a_design_that_is_finer_than_its_correction_keeps_its_cells() -> None:
    plain = freeform()
    fine = plain.sag.refine({1: [(0, 0), (1, 0), (0, 1)]})
    wavy = fine.coefficients + 0.1 * np.cos(np.arange(fine.space.dim))
    designed = plain.with_sag(THBSurface(fine.space, wavy))
    x, y = scattered(120)
    made = made_surface(designed, by_datums(designed, np.stack([x, y, designed(x, y) + 1e-3 + 1e-5 * x])))
    assert made.surface.sag.space.levels == 3 > made.fit.surface.space.levels
    u, v = scattered(400, seed=8)
    assert np.allclose(made.correction(u, v), 1e-3 + 1e-5 * u, rtol=0, atol=1e-11)


class RippleError:
    """The error of height that is measured here, as the tracer takes it at every ray."""

    def jet(self, x, y):
        step = 1e-5
        slopes = [ripple(x + step, y) - ripple(x - step, y), ripple(x, y + step) - ripple(x, y - step)]
        return np.stack([ripple(x, y), *(s / (2 * step) for s in slopes)])


@pytest.mark.every(2)
@pytest.mark.parametrize("side", ["front", "rear"])
def test_the_light_of_a_made_lens_is_that_of_its_error_at_the_rays(system, backend, side: str) -> None:
    designed = surface_of(system.base, side)
    made = made_surface(designed, by_datums(designed, measured(designed, 8000, FINE).points))
    light = PerturbedLight(system, backend)
    (before, _), (exact, _) = light(), light(Perturbation(**{f"{side}_error": RippleError()}))
    after, _ = PerturbedLight(system.with_lens(with_surface(system.base, side, made.surface)), backend)()
    assert np.linalg.norm(after - exact) < 0.02 * np.linalg.norm(exact - before)


SHIFT = 0.15  # mm


@pytest.mark.slow  # 60 traces
def test_a_decentred_lens_is_put_back(system: System, backend) -> None:
    """The light asked for is that of the same lens in another place, which is to be found."""
    lens = system.base.with_sags([THBSurface(sag.space, rough(sag.space)) for sag in system.base.sags])
    wanted = Perturbation(lens_shift=(SHIFT, -SHIFT / 2, 0.0), lens_tilt=(0.0, 0.0, 0.01))
    target, _ = PerturbedLight(system.with_lens(lens), backend)(wanted)
    found = rigid_correction(system.with_lens(lens), target, backend)
    amounts = {move.name: move.amount for move in found.moves}
    assert found.after < 0.05 * found.before
    assert amounts["lens.decentre_x"] == pytest.approx(SHIFT, rel=0.1)
    assert amounts["lens.decentre_y"] == pytest.approx(-SHIFT / 2, rel=0.1)
    assert amounts["lens.tilt_z"] == pytest.approx(np.degrees(0.01), rel=0.2)
    again, _ = PerturbedLight(system.with_lens(lens), backend)(found.perturbation)
    assert rel_l2(again, target) == pytest.approx(found.after)


@pytest.mark.slow  # 13 traces
def test_a_lens_that_stands_well_stays(system: System, backend) -> None:
    lens = system.base.with_sags([THBSurface(sag.space, rough(sag.space)) for sag in system.base.sags])
    target, _ = PerturbedLight(system.with_lens(lens), backend)()
    found = rigid_correction(system.with_lens(lens), target, backend)
    assert found.after <= found.before < 1e-12
    assert all(abs(move.amount) < 1e-9 for move in found.moves)


def test_what_was_measured_must_make_a_lens(system, backend) -> None:
    rear = system.base.rear
    points = measured(rear, 2000).points + np.array([[0.0], [0.0], [-30.0]])
    with pytest.raises(UserError, match=r"no lens has the rear that was measured: .*cross"):
        light_as_built(system, MeasuredPoints(points), backend, "rear", correct=False)


def test_a_surface_that_light_meets_from_behind_too_is_refused(backend) -> None:
    size = {"half_width": (20, 20)}
    lens = {"kind": "lens", "name": "L1", "index": 1.5, "thickness": 8, "front": size}
    problem = Problem(
        source={"kind": "collimated", "half_width": (15, 15), "distance": 50},
        element=[lens | {"rear": size | {"reflectance": 0.9}}],
        path=[{"faces": ["L1.front", "L1.rear:reflect", "L1.front"]}],
        target={"kind": "tophat", "position": (0, 0, -200), "tilt": (180, 0, 0), "half_width": (20, 20)}
        | {"pixels": (16, 16)},
    )
    system = System(problem)
    points = measured(system.base.front, 500)
    with pytest.raises(UserError, match=r"light meets L1.front from behind"):
        light_as_built(system, points, backend, "front", correct=False)
